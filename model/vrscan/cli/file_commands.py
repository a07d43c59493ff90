"""The commands that take points.csv: ``export`` to other formats, ``filter`` to a better one."""

import contextlib
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vrscan.cli.checks import check_suffix
from vrscan.cli.progress import console, telling
from vrscan.data.errors import InputError

if TYPE_CHECKING:
    from vrscan.data.table import Table

_ORDER = "vrscan.filters"  # in a context: the filters as they were given
PointsArgument = Annotated[
    Path, typer.Argument(metavar="POINTS", help="Points: .csv, or a recording, .mcap.")
]


def _read(path: Path) -> "Table":
    """Return the points of a file; what a damaged recording lacks is told."""
    from vrscan.data.recordings import read_points

    with telling():
        return read_points(path)


def export(
    points: PointsArgument,
    out: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="[OUT]...",
            help="Files: .ply, .pcd, .xyz, .las, .laz, .e57, .mcap (ROS 2) or .rrd (Rerun).",
        ),
    ] = None,
    pose: Annotated[
        Path | None,
        typer.Option(
            help="CSV file of the scanner's poses: time_s, x_mm, y_mm, z_mm, and roll_deg, "
            "pitch_deg, yaw_deg or qx, qy, qz, qw."
        ),
    ] = None,
    image: Annotated[
        Path | None,
        typer.Option(
            "--range-image",
            help="File for an image of the distances, .png or .tif: a row a sweep, a column an "
            "angle.",
        ),
    ] = None,
    columns: Annotated[
        int | None,
        typer.Option(help="Columns of the image and of a LaserScan; default: hardly a hole."),
    ] = None,
    rate: Annotated[
        float | None, typer.Option(help="Lines a second, for points without a time.")
    ] = None,
    frame: Annotated[str, typer.Option(help="The scanner's frame_id in ROS messages.")] = "vrscan",
) -> None:
    """Write points in the formats of other programs, which the files' endings choose."""
    from vrscan.data import clouds, poses, range_image
    from vrscan.data.points import atomic_file
    from vrscan.data.ros import check_frame

    paths = list(out or ())
    for path in paths:
        check_suffix(path, clouds.SUFFIXES)
    if image is not None:
        check_suffix(image, range_image.SUFFIXES)
        paths.append(image)
    if not paths:
        raise InputError("export: no file to write: name one or more, or give --range-image")
    for path in paths:
        if path.resolve() == points.resolve() or paths.count(path) > 1:
            raise InputError(f"{path}: given twice")
    if rate is not None and not 0.0 < rate < float("inf"):
        raise InputError(f"--rate: must be above 0 ({rate:g})")
    check_frame("--frame", frame)
    with contextlib.ExitStack() as stack:
        files = {path: stack.enter_context(atomic_file(path)) for path in paths}
        table = _read(points)
        moved = None if pose is None else poses.read(pose)
        found = clouds.cloud(table, name=str(points), poses=moved, rate_hz=rate, columns=columns)
        note = ""
        for path, file in files.items():
            if path == image:
                drawn = range_image.range_image(found.points, found.sweep, found.columns)
                range_image.write_image(drawn, path.suffix, file)
                if path.suffix == ".png":
                    note = f"; {path} is in steps of {range_image.step_mm(drawn):g} mm"
            else:
                clouds.write(found, path.suffix, file, name=str(points), frame=frame)
    names = ", ".join(map(str, paths))
    console().print(f"{len(found)} points of {len(table)} lines: {names}{note}", highlight=False)
    told = [f"{path} {found.note(path.suffix)}" for path in paths if found.note(path.suffix)]
    if told:
        print(f"far from the origin: {'; '.join(told)}")


def _noted(ctx: typer.Context, param: typer.CallbackParam, value: Any) -> Any:
    """Keep the order in which options are given, which is that of these calls."""
    if value is not None:
        ctx.meta.setdefault(_ORDER, []).append(param.name)
    return value


def filter_points(
    ctx: typer.Context,
    points: PointsArgument,
    out: Annotated[Path, typer.Argument(metavar="OUT.csv", help="File for the filtered points.")],
    median: Annotated[
        int | None,
        typer.Option(
            callback=_noted,
            help="Move points towards the median of so many lines of a sweep, an odd number.",
        ),
    ] = None,
    spike: Annotated[
        float | None,
        typer.Option(
            callback=_noted,
            metavar="MM",
            help="Remove points that stand out from both neighbours by more than this in z, unless "
            "other sweeps see them as well.",
        ),
    ] = None,
    min_confidence: Annotated[
        float | None,
        typer.Option(callback=_noted, metavar="C", help="Remove points of less c_obj, 0 to 1."),
    ] = None,
    without: Annotated[
        str | None,
        typer.Option(
            callback=_noted,
            metavar="FLAG,...",
            help="Remove points with one of these flags, such as MIXED,RIVAL.",
        ),
    ] = None,
    average: Annotated[
        int | None,
        typer.Option(
            callback=_noted,
            metavar="N",
            help="Move points towards the mean of N interlaced sweeps.",
        ),
    ] = None,
    outlier: Annotated[
        float | None,
        typer.Option(
            callback=_noted,
            metavar="K",
            help="Remove points more than K standard deviations off the 7 lines around, unless "
            "other sweeps see them as well.",
        ),
    ] = None,
) -> None:
    """Filter points, with each filter that is given, in the order in which they are given."""
    from vrscan.data import filters
    from vrscan.data.points import atomic_file, write_csv

    known: dict[str, tuple[Callable[..., Any], Any]] = {
        "median": (filters.median, median),
        "spike": (filters.spike, spike),
        "min_confidence": (filters.min_confidence, min_confidence),
        "without": (filters.without_flags, without),
        "average": (filters.average, average),
        "outlier": (filters.outlier, outlier),
    }
    order: list[str] = ctx.meta.get(_ORDER, [])
    if not order:
        names = ", ".join("--" + name.replace("_", "-") for name in known)
        raise InputError(f"filter: no filter is given: {names}")
    check_suffix(out, (".csv",))
    with atomic_file(out) as file:
        table = _read(points)
        found = table
        for name in order:
            call, value = known[name]
            found = call(found, value)
        write_csv(found, file)
    before, after = int(table.located.sum()), int(found.located.sum())
    console().print(f"{out}: {after} points of {before}", highlight=False)

"""A laser against the sun: tables of light, brightness ratio and powers, their file and picture."""

from dataclasses import dataclass
from datetime import timedelta
from typing import BinaryIO

import numpy as np
from matplotlib.axes import Axes
from rich.console import Group
from rich.table import Table as RichTable

from vrscan.data.arrays import Floats
from vrscan.data.errors import InputError
from vrscan.scene.safety import PUPIL_MM
from vrscan.scene.site import EXPOSURES_S, Moment, Outlook, Site, eye_limits_w
from vrscan.show.sheet import Column, Sheet, listed, number, words
from vrscan.show.style import COLOURS, INK, QUIET, drawing

_HOURS = np.arange(0.0, 24.01, 0.25)
_CURVE = 120  # number of ranges of a drawn curve


@dataclass(frozen=True)
class _Row:
    """One range at one time."""

    outlook: Outlook
    index: int

    @property
    def range_mm(self) -> float:
        """Distance of the wall."""
        return self.outlook.site.range_mm[self.index]

    def of(self, name: str) -> float:
        """Return a figure of the outlook at this range."""
        return float(getattr(self.outlook, name)[self.index])

    def error(self, name: str) -> float:
        """Return a model's B over that of the reference, less 1; NaN without one."""
        return self.of(name) / self.of("reference") - 1.0


def outlooks(site: Site) -> list[Outlook]:
    """Return every time of a site.

    Raises:
        InputError: if the sun is not above the horizon.
    """
    found = [Outlook(site, moment) for moment in site.moments]
    for each in found:
        _ = each.sun_w_m2  # raises
    return found


def _rows(found: list[Outlook]) -> list[_Row]:
    return [_Row(each, k) for each in found for k in range(len(each.site.range_mm))]


def _when(moment: Moment, form: str = "%Y-%m-%d %H:%M") -> str:
    return f"{moment.time:{form}}, {'in shade' if moment.shaded else 'in the sun'}"


def _reference(found: list[Outlook]) -> str:
    """Return how the references are known: "measured", "inferred", both, or nothing."""
    moments = [each.moment for each in found]
    known = {
        "measured": any(each.measured_w_m2 is not None for each in moments),
        "inferred": any(each.inferred_w_m2 is not None for each in moments),
    }
    return " or ".join(name for name, there in known.items() if there)


def report(found: list[Outlook]) -> Group:
    """Return all tables for the terminal, 120 columns wide."""
    return Group(light_table(found), "", ratio_table(found), "", *_eye(found[0].site))


def light_table(found: list[Outlook]) -> RichTable:
    """Return the light on the wall by where it comes from."""

    def part(heading: str, name: str) -> Column[Outlook]:
        return Column(heading, lambda each: each.parts_w_m2[name], "{:.0f}")

    columns: list[Column[Outlook]] = [
        words("time", lambda each: _when(each.moment)),
        Column("sun's height", lambda each: each.elevation_deg, "{:.1f}°"),
        Column("heading", lambda each: each.azimuth_deg, "{:.0f}°"),
        part("direct", "direct"),
        part("sky", "sky"),
        part("ground", "ground"),
        part("facades", "facades"),
        Column("on the wall", lambda each: each.sun_w_m2, "{:.0f}"),
    ]
    reference = _reference(found)
    if reference:
        columns.append(
            Column(reference, lambda each: each.moment.reference_w_m2, "{:.0f}", absent="-")
        )
    site = found[0].site
    sun, low, high = site.sun, *site.filter.band_nm
    if sun.sky == "clear":
        weather = f"clear sky of Linke turbidity {sun.linke_turbidity:g}"
    else:
        weather = "given sky"
    around = (
        f"buildings of reflectance {sun.facade_reflectance:g} up to {sun.skyline_deg:g}°"
        if sun.skyline_deg
        else "open land"
    )
    return Sheet(columns, found).terminal(
        f"{site.title}: irradiance, W/m²",
        f"Latitude {sun.latitude_deg:g}, longitude {sun.longitude_deg:g}; {weather} (Perez); the "
        f"ground reflects {sun.albedo:g} of the band; {around}. The wall faces "
        f"{site.wall.facing_deg:g}°. Light of {low:g} to {high:g} nm, as the irradiance of the "
        "full spectrum (ASTM G173, global) that has as much there.",
        gap=2,
    )


def ratio_table(found: list[Outlook]) -> RichTable:
    """Return B and the least power at every time and range."""
    reference = _reference(found)
    columns: list[Column[_Row]] = [
        words("\ntime", lambda row: _when(row.outlook.moment)),
        Column("range\nmm", lambda row: row.range_mm, "{:.0f}"),
        Column("laser\nW/m²", lambda row: row.of("laser_w_m2"), number),
        Column("\nB", lambda row: row.of("model"), "{:.3f}"),
        Column("B, direct\nsun only", lambda row: row.of("direct_sun"), "{:.3f}"),
    ]
    if reference:
        columns += [
            Column(f"B\n{reference}", lambda row: row.of("reference"), "{:.3f}", absent="-"),
            Column("error\nof B", lambda row: row.error("model"), "{:+.1f} %", scale=100),
            Column("direct\nsun", lambda row: row.error("direct_sun"), "{:+.1f} %", scale=100),
        ]
    columns += [
        Column("least\nmW", lambda row: row.of("least_w"), number, scale=1e3),
        Column("(6) as\nprinted", lambda row: row.of("printed_least_w"), number, scale=1e3),
    ]
    site = found[0].site
    glass, wall, laser = site.filter.glass, site.wall, site.laser
    return Sheet(columns, _rows(found)).terminal(
        f"Brightness ratio B of {laser.power_mw:g} mW at {laser.wavelength_nm:g} nm",
        f"B, (4): the pixel with the laser over that without, both of reflectance "
        f"{wall.reflectance:g}; the filter passes {100 * glass.laser:g} % at the laser's line and "
        f"{100 * glass.band:g} % of its band, which has {100 * glass.ratio:.2f} % of the sun's "
        f"light. Direct sun only: 900 W/m² on the wall at any time. {_published(found)}Least "
        f"power, (6) as (4) has it: for B = 1 with the laser on {wall.darkest:g} beside "
        f"{wall.brightest:g}.",
        apart=lambda row: row.outlook.moment,
        gap=2,
    )


def _published(found: list[Outlook]) -> str:
    """Return what others state for models of theirs."""
    stated = [
        f"{100 * each.moment.published_error:.1f} % at {each.moment.time:%H:%M}"
        for each in found
        if each.moment.published_error is not None
    ]
    return f"Largest published errors of B: {', '.join(stated)}. " if stated else ""


def _eye(site: Site) -> list[RichTable | str]:
    """Return the largest powers for an eye at the nearest range, or why there are none."""
    near = min(site.range_mm)
    if site.laser.fan_rad is None:
        return ["(5) is of a line: there is no limit for a spot"]
    try:
        limits = [(t, *eye_limits_w(site.laser, near, t)) for t in EXPOSURES_S]
    except InputError as error:
        return [str(error)]
    power = site.laser.power_mw
    rows = [
        (f"{t:g}", f"{1e3 * a:.1f}", f"{1e3 * b:.1f}", "yes" if power <= 1e3 * b else "no")
        for t, a, b in limits
    ]
    names = "exposure, s", "(5) as printed, mW", "ANSI's exposure, mW", f"{power:g} mW is below it"
    return [
        listed(names, rows).terminal(
            f"Largest power for an eye at {near:g} mm",
            f"ANSI's exposure: the mean over a pupil of {PUPIL_MM:g} mm in the line. (5) divides "
            "by the line's width instead of multiplying with it, and is pi/4 of that for a line "
            "as wide as the pupil.",
            gap=2,
        )
    ]


def csv_file(found: list[Outlook]) -> bytes:
    """Return all times and ranges as a file."""
    site = found[0].site
    limits: dict[float, tuple[float, float]] = {}
    if site.laser.fan_rad is not None and 700.0 <= site.laser.wavelength_nm <= 1050.0:
        limits = {t: eye_limits_w(site.laser, min(site.range_mm), t) for t in EXPOSURES_S}

    def part(name: str) -> Column[_Row]:
        return Column(None, lambda row: row.outlook.parts_w_m2[name], name=f"{name}_w_m2")

    def figure(name: str, column: str) -> Column[_Row]:
        return Column(None, lambda row: row.of(name), name=column)

    def limit(time_s: float, index: int, name: str) -> Column[_Row]:
        value = limits[time_s][index]
        return Column(None, lambda _: value, name=f"{name}_{time_s:g}s_w")

    columns: list[Column[_Row]] = [
        Column(None, lambda row: row.outlook.moment.time.isoformat(), name="time"),
        Column(None, lambda row: int(row.outlook.moment.shaded), name="shaded"),
        Column(None, lambda row: row.range_mm, name="range_mm"),
        *map(part, found[0].parts_w_m2),
        Column(None, lambda row: row.outlook.sun_w_m2, name="sun_w_m2"),
        Column(None, lambda row: row.outlook.moment.measured_w_m2, name="measured_w_m2"),
        Column(None, lambda row: row.outlook.moment.inferred_w_m2, name="inferred_w_m2"),
        figure("laser_w_m2", "laser_w_m2"),
        figure("model", "ratio"),
        figure("direct_sun", "ratio_direct_sun"),
        figure("reference", "ratio_reference"),
        figure("least_w", "least_w"),
        figure("printed_least_w", "least_as_printed_w"),
        *(
            limit(time_s, index, name)
            for time_s in limits
            for index, name in enumerate(("eye_as_printed", "eye"))
        ),
    ]
    return Sheet(columns, _rows(found)).csv()


def picture(found: list[Outlook], file: BinaryIO) -> None:
    """Draw the light on the wall over the first time's day, and B over range, as PNG."""
    count = len(found)
    with drawing(4.6 + 3.0 * count, 4.2, found[0].site.title) as figure:
        grid = figure.add_gridspec(1, 1 + count, width_ratios=[1.5, *[1.0] * count])
        _draw_day(figure.add_subplot(grid[0]), found)
        ratios = [getattr(each, name) for each in found for name in ("model", "reference")]
        top = 1.0 + 1.15 * (float(np.nanmax(ratios)) - 1.0)
        for k, each in enumerate(found):
            _draw_ratio(figure.add_subplot(grid[1 + k]), each, top, legend=k == 0)
        figure.savefig(file, format="png", dpi=130)


def _day(outlook: Outlook) -> dict[str, Floats]:
    """Return the hours with a sun, and the light of each part and in shade."""
    midnight = outlook.moment.time.replace(hour=0, minute=0, second=0, microsecond=0)
    kept: dict[str, list[float]] = {"hour": []}
    for hour in _HOURS:
        time = midnight + timedelta(hours=float(hour))
        at = Outlook(outlook.site, Moment(time=time))
        try:
            parts = at.parts_w_m2
        except InputError:
            continue
        shade = Outlook(outlook.site, Moment(time=time, shaded=True)).sun_w_m2
        for name, value in {"hour": float(hour), **parts, "shade": shade}.items():
            kept.setdefault(name, []).append(value)
    return {name: np.array(values) for name, values in kept.items()}


def _draw_day(axes: Axes, found: list[Outlook]) -> None:
    """Draw the wall's irradiance over the day in its parts, with the times of the site."""
    site = found[0].site
    day = _day(found[0])
    names = [name for name in ("ground", "facades", "sky", "direct") if day[name].any()]
    order = ("sky", "direct", "ground", "facades")
    colours = dict(zip(order, COLOURS, strict=True))
    axes.stackplot(
        day["hour"],
        [day[name] for name in names],
        labels=names,
        colors=[colours[name] for name in names],
        alpha=0.45,
        linewidth=0,
    )
    axes.plot(day["hour"], day["shade"], color=INK, linewidth=1.2, linestyle="--", label="in shade")
    for each in found:
        if each.moment.time.date() != found[0].moment.time.date():
            continue
        hour = each.moment.time.hour + each.moment.time.minute / 60.0
        axes.plot(hour, each.sun_w_m2, "o", color=INK, markersize=5)
        if each.moment.reference_w_m2 is not None:
            axes.plot(
                hour, each.moment.reference_w_m2, "s", mfc="white", mec=COLOURS[1], markersize=6
            )
    axes.plot([], [], "o", color=INK, markersize=5, label="as modelled")
    if reference := _reference(found):
        label = f"as {reference}"
        axes.plot([], [], "s", mfc="white", mec=COLOURS[1], markersize=6, label=label)
    axes.set(
        xlabel=f"hour of {found[0].moment.time:%Y-%m-%d}",
        ylabel="irradiance of the wall in W/m²",
        title="Light on the wall" + ", the given sky at any hour" * (site.sun.sky == "given"),
        ylim=(0.0, 1.45 * float(np.sum([day[name] for name in names], axis=0).max())),
        xlim=(day["hour"][0], day["hour"][-1]),
    )
    axes.legend(loc="upper left", ncols=2)


def _draw_ratio(axes: Axes, outlook: Outlook, top: float, *, legend: bool) -> None:
    """Draw B over range: this model, the direct sun alone, and the reference."""
    places = np.array(outlook.site.range_mm)
    wide = np.linspace(0.9 * places.min(), 1.1 * places.max(), _CURVE)
    axes.plot(wide, outlook.ratio(outlook.sun_w_m2, wide), color=COLOURS[0], label="this model")
    axes.plot(
        wide,
        outlook.ratio(outlook.direct_sun_w_m2, wide),
        color=QUIET,
        linestyle="--",
        label="direct sun",
    )
    if outlook.moment.reference_w_m2 is not None:
        axes.plot(
            places, outlook.reference, "s", mfc="white", mec=COLOURS[1], markersize=6,
            label=_reference([outlook]),
        )  # fmt: skip
    axes.axhline(1.0, color=INK, linewidth=0.8)
    axes.set_ylim(0.8, top)
    axes.set(xlabel="range in mm", title=_when(outlook.moment, "%H:%M"))
    if legend:
        axes.set_ylabel("brightness ratio B")
        axes.legend(loc="upper right")

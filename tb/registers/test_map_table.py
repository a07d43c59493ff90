"""Correction maps in a configuration: all engines take them, and what does not fit is refused."""

from pathlib import Path

import numpy as np
import pytest
from scanners import EACH_SCANNER, SCANNERS

from vrscan.calibrate import results
from vrscan.data import pkg
from vrscan.data.config import Config, load, to_toml
from vrscan.data.correction_maps import COLUMNS, ROWS, FieldMaps, extension_mm
from vrscan.data.errors import InputError
from vrscan.engines.engine import Engine, run
from vrscan.ideal.correction_map import correction
from vrscan.ideal.geometry import triangle, undistorted
from vrscan.registers.map_table import map_registers, map_table, nodes_of
from vrscan.scene.simulate import take

EVERY = pytest.mark.parametrize("engine", list(Engine))
DEFAULT = SCANNERS["default"]
FOCAL = DEFAULT.geometry.focal_mm
FOCUS_MM = 430.0


def smooth(
    count: int = 3, step_mm: float = 0.512, size_px: float = 3.0, config: Config = DEFAULT
) -> FieldMaps:
    i, j = np.meshgrid(np.arange(ROWS), np.arange(COLUMNS), indexing="ij")
    waves = [np.sin(0.2 * i + 0.1 * j + k) for k in range(count)]
    filled = np.zeros((count, ROWS, COLUMNS), np.bool_)
    focal_mm = config.geometry.focal_mm
    return FieldMaps(focal_mm, 1.2, step_mm, size_px * np.array(waves), filled, np.zeros(count))


def configured(
    folder: Path, maps: FieldMaps, config: Config = DEFAULT, **more: dict[str, object]
) -> Config:
    """Return a scanner with maps and other changes of its sections, as read from a file."""
    with (folder / "map.npz").open("wb") as file:
        results.write_maps(maps, {}, file)
    more["map"] = {"file": "map.npz", "focus_mm": FOCUS_MM} | more.get("map", {})
    own = {name: getattr(config, name).model_copy(update=each) for name, each in more.items()}
    (folder / "own.toml").write_text(to_toml(config.model_copy(update=own)))
    return load(folder / "own.toml")


@EVERY
@EACH_SCANNER
def test_every_engine_corrects_the_position(engine: Engine, config: Config, tmp_path: Path) -> None:
    """z is that of (3) at the corrected position; the position itself is told as it was seen."""
    maps, bare = smooth(config=config), config
    config = configured(tmp_path, maps, bare)
    lines = take("default", 300, config, "minimal").lines
    plain, found = run(engine, lines, bare), run(engine, lines, config)
    assert np.array_equal(plain.position_px, found.position_px)
    both = plain.located & found.located
    assert both.sum() > 100
    lens = np.full(len(lines), maps.lens(FOCUS_MM))
    given = found.position_px, found.angle_rad, lens, maps.words() * 2.0**-pkg.MAP_FRACTION
    moved = found.position_px + correction(*given, line_length=config.sensor.line_length)
    u, _ = undistorted(moved, config.geometry)
    exact = triangle(u, found.angle_rad, config.geometry).z
    error = np.abs(found.z_mm - exact)[both].max()
    shift = np.abs(found.z_mm - plain.z_mm)[both].max()
    print(f"{engine}: maps move z by up to {shift:.2f} mm; error {1e3 * error:.2f} um")
    assert shift > 1.0
    assert error < 0.01


@EACH_SCANNER
def test_rtl_equals_its_twin_with_maps(config: Config, tmp_path: Path) -> None:
    config = configured(tmp_path, smooth(9, 0.256, 40.0, config), config)
    lines = take("default", 200, config, "minimal").lines
    first, second = (run(engine, lines, config) for engine in (Engine.RTL, Engine.FIXED))
    for name in ("x_mm", "z_mm", "sigma_z_mm", "position_px", "c_obj"):
        assert np.array_equal(getattr(first, name), getattr(second, name)), name
    assert all(np.array_equal(first.flags[name], second.flags[name]) for name in first.flags)


def test_words_and_place(tmp_path: Path) -> None:
    table = map_table(configured(tmp_path, smooth()))
    assert table is not None
    assert table.nodes.shape == (3, ROWS, COLUMNS)
    for got, want in zip(nodes_of(table.words), (table.nodes, table.filled), strict=True):
        assert np.array_equal(got, want)
    assert (table.map_begin, table.map_shift) == (2400, 10)
    assert table.lens == round(extension_mm(FOCUS_MM, FOCAL) / 5e-4)


@EACH_SCANNER
def test_registers_of_the_maps(config: Config, tmp_path: Path) -> None:
    """Positions are those of the motor, which the maps follow where it moves the lens."""
    assert map_table(config) is None and map_registers(config)["map_enable"] == 0
    maps, moved = smooth(config=config), {"infinity_mm": 0.1, "mode": "manual"}
    still = configured(tmp_path, maps, config)
    assert map_registers(still)["map_follow"] == 0
    config = configured(tmp_path, maps, config, focus=moved)
    lens = round((0.1 + extension_mm(FOCUS_MM, maps.focal_mm)) / 5e-4)
    wanted = {"map_enable": 1, "map_count": 3, "map_begin": 2600, "map_shift": 10}
    assert map_registers(config) == wanted | {"map_follow": 1, "map_lens": lens}


@EVERY
@EACH_SCANNER
def test_a_point_beside_a_filled_node_says_so(
    engine: Engine, config: Config, tmp_path: Path
) -> None:
    """In the cells around the nodes and nowhere else."""
    maps, bare = smooth(config=config), config
    maps.filled[:, :, 28:33] = True
    config = configured(tmp_path, maps, bare)
    lines = take("default", 200, config, "minimal").lines
    plain, found = run(engine, lines, bare), run(engine, lines, config)
    assert not plain.flags["MAP_FILLED"].any()
    cell = found.position_px / (2.0 ** (config.sensor.line_length - 1).bit_length() / 64)
    beside = found.measured & (np.floor(cell) >= 27) & (np.floor(cell) <= 32)
    clear = np.abs(cell - np.round(cell)) > 1e-3  # of a node, where rounding decides
    assert 5 < beside.sum() < 0.9 * found.measured.sum()
    assert np.array_equal(found.flags["MAP_FILLED"][clear], beside[clear])


def test_what_does_not_fit_is_refused(tmp_path: Path) -> None:
    for maps, more, wanted in (
        (smooth(10), {}, "10 maps"),
        (smooth(step_mm=0.5), {}, "1000 steps of the lens apart"),
        (smooth(), {"focus": {"infinity_mm": -1.3}}, "first map is at -200 steps"),
        (smooth(size_px=70.0), {}, "a correction of 70.0 px"),
        (smooth(), {"map": {"focus_mm": 20.0}}, r"map\.focus_mm = 20"),
    ):
        with pytest.raises(InputError, match=wanted):
            map_table(configured(tmp_path, maps, **more))
    (tmp_path / "map.npz").unlink()
    with pytest.raises(InputError, match=r"map\.file.*No such file"):
        map_table(load(tmp_path / "own.toml"))

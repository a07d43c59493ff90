"""Correction maps in a configuration: all engines take them, and what does not fit is refused."""

from pathlib import Path

import numpy as np
import pytest

from vrscan.calibrate import results
from vrscan.data import pkg
from vrscan.data.config import Config, load
from vrscan.data.correction_maps import COLUMNS, ROWS, FieldMaps, extension_mm
from vrscan.data.errors import InputError
from vrscan.engines.engine import Engine, run
from vrscan.ideal.correction_map import correction
from vrscan.ideal.geometry import triangle, undistorted
from vrscan.registers.map_table import map_registers, map_table, nodes_of
from vrscan.scene.simulate import take

FOCAL = Config().geometry.focal_mm


def smooth(count: int = 3, step_mm: float = 0.512, size_px: float = 3.0) -> FieldMaps:
    i, j = np.meshgrid(np.arange(ROWS), np.arange(COLUMNS), indexing="ij")
    waves = [np.sin(0.2 * i + 0.1 * j + k) for k in range(count)]
    filled = np.zeros((count, ROWS, COLUMNS), np.bool_)
    return FieldMaps(FOCAL, 1.2, step_mm, size_px * np.array(waves), filled, np.zeros(count))


def configured(folder: Path, maps: FieldMaps, more: str = "focus_mm = 430.0") -> Config:
    with (folder / "map.npz").open("wb") as file:
        results.write_maps(maps, {}, file)
    (folder / "own.toml").write_text(f'[map]\nfile = "map.npz"\n{more}\n')
    return load(folder / "own.toml")


@pytest.mark.parametrize("engine", list(Engine))
def test_every_engine_corrects_the_position(engine: Engine, tmp_path: Path) -> None:
    """z is that of (3) at the corrected position; the position itself is told as it was seen."""
    maps = smooth()
    config = configured(tmp_path, maps)
    lines = take("default", 300, config, "minimal").lines
    plain, found = run(engine, lines, Config()), run(engine, lines, config)
    assert np.array_equal(plain.position_px, found.position_px)
    both = plain.located & found.located
    assert both.sum() > 100
    lens = np.full(len(lines), maps.lens(430.0))
    given = found.position_px, found.angle_rad, lens, maps.words() * 2.0**-pkg.MAP_FRACTION
    moved = found.position_px + correction(*given, line_length=2048)
    u, _ = undistorted(moved, config.geometry)
    exact = triangle(u, found.angle_rad, config.geometry).z
    error = np.abs(found.z_mm - exact)[both].max()
    shift = np.abs(found.z_mm - plain.z_mm)[both].max()
    print(f"{engine}: maps move z by up to {shift:.2f} mm; error {1e3 * error:.2f} um")
    assert shift > 1.0
    assert error < 0.01


def test_rtl_equals_its_twin_with_maps(tmp_path: Path) -> None:
    config = configured(tmp_path, smooth(9, 0.256, 40.0))
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
    assert table.lens == round(extension_mm(430.0, FOCAL) / 5e-4)
    assert map_table(Config()) is None


def test_registers_of_the_maps(tmp_path: Path) -> None:
    """Positions are those of the motor, which the maps follow where it moves the lens."""
    config = configured(tmp_path, smooth(), "[focus]\ninfinity_mm = 0.1\nmode = 'manual'")
    lens = round((0.1 + extension_mm(420.0, FOCAL)) / 5e-4)
    wanted = {"map_enable": 1, "map_count": 3, "map_begin": 2600, "map_shift": 10}
    assert map_registers(config) == wanted | {"map_follow": 1, "map_lens": lens}
    still = configured(tmp_path, smooth())
    assert map_registers(still)["map_follow"] == 0
    assert map_registers(Config())["map_enable"] == 0


@pytest.mark.parametrize("engine", list(Engine))
def test_a_point_beside_a_filled_node_says_so(engine: Engine, tmp_path: Path) -> None:
    """In the cells around the nodes and nowhere else."""
    maps = smooth()
    maps.filled[:, :, 28:33] = True
    config = configured(tmp_path, maps)
    lines = take("default", 200, config, "minimal").lines
    plain, found = run(engine, lines, Config()), run(engine, lines, config)
    assert not plain.flags["MAP_FILLED"].any()
    cell = found.position_px / 32.0
    beside = found.measured & (np.floor(cell) >= 27) & (np.floor(cell) <= 32)
    clear = np.abs(cell - np.round(cell)) > 1e-3  # of a node, where rounding decides
    assert 5 < beside.sum() < 0.9 * found.measured.sum()
    assert np.array_equal(found.flags["MAP_FILLED"][clear], beside[clear])


def test_what_does_not_fit_is_refused(tmp_path: Path) -> None:
    for maps, more, wanted in (
        (smooth(10), "", "10 maps"),
        (smooth(step_mm=0.5), "", "1000 steps of the lens apart"),
        (smooth(), "[focus]\ninfinity_mm = -1.3", "first map is at -200 steps"),
        (smooth(size_px=70.0), "", "a correction of 70.0 px"),
        (smooth(), "focus_mm = 20.0", r"map\.focus_mm = 20"),
    ):
        with pytest.raises(InputError, match=wanted):
            map_table(configured(tmp_path, maps, more))
    (tmp_path / "map.npz").unlink()
    with pytest.raises(InputError, match=r"map\.file.*No such file"):
        map_table(load(tmp_path / "own.toml"))

"""Commits over the link while the virtual board scans: no point is of two configurations.

The model computes every captured line twice, with either configuration alone; the record has to
be the one whose bit it shows, to the last bit. The angles' oracle is the mirror's own motion over
time.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from harness import generator, in_volume
from slow_board import CONFIG, SCENE

from vrscan.calibrate.results import write_maps
from vrscan.data import link_pkg, pkg
from vrscan.data.correction_maps import COLUMNS, ROWS, FieldMaps
from vrscan.data.records import CONFIGURATION, FULL
from vrscan.engines.board import Board, on_board
from vrscan.fixed.point_record import point_record
from vrscan.fixed.vrscan_chain import run_fixed
from vrscan.link.device import Device
from vrscan.link.register_host import DeviceError
from vrscan.link.stream import Captured, CaptureStream
from vrscan.registers import values
from vrscan.registers.chain_registers import Registers
from vrscan.registers.map_table import MapTable, map_registers, map_table
from vrscan.registers.register_map import WINDOWS
from vrscan.registers.values import Block

TIMEOUT_S = 60.0
LENS_CLKS = 10_000 * 5_000  # more steps than the lens has, and their time on the board
LINES = 4  # captured after each
MOTION = 0.8  # of the second configuration's motion to the first one's
LOST = 1 << pkg.FLAG_LINES_LOST | 1 << pkg.FLAG_POINTS_LOST


def configured(**parts: dict[str, Any]) -> tuple[Any, Registers]:
    """Return a configuration of the board, and what the chain takes of it."""
    given = CONFIG.model_dump(exclude_unset=True)
    for name, part in parts.items():
        given[name] = given.get(name, {}) | part
    config = on_board(type(CONFIG).model_validate(given))
    return config, Registers.from_config(config)


def record_of(
    captured: Any,
    chain: Registers,
    bit: int,
    maps: MapTable | None = None,
    lens: int | None = None,
) -> np.ndarray:
    """Return the record that a configuration alone gives for a captured line."""
    got = captured.record[0]
    one = np.ones(1, np.int64)
    points = run_fixed(
        captured.pixels[None].astype(np.uint16),
        one * int(got["angle"]),
        one * int(got["power"]),
        chain,
        mirror_flags=one * (int(got["flags"]) >> pkg.FLAG_NOT_RUNNING & 7),
        maps=maps,
        lens=None if lens is None else one * lens,
    )
    beside = [one * int(got["power"]), one * int(got["confidence"])]
    inward, test = ((got["bits"] >> k & 1 != 0) & (one != 0) for k in (1, 2))
    want = point_record(points, *beside, inward, test, one * int(got["time"]), bit)
    want["line"] = got["line"]
    want["lost"] = got["lost"]
    want["flags"] |= got["flags"] & LOST
    return want


@pytest.mark.parametrize("commits", [3, in_volume(20)])
def test_points_of_a_scan_are_of_one_configuration_each(commits: int, tmp_path: Path) -> None:
    first, second = (
        configured(peak={"window": "two_pass"}),
        configured(
            peak={"window": "threshold", "k_noise": 9.0},
            geometry={"offset_mm": CONFIG.geometry.offset_mm + 3.0, "tolerance": 0.003},
            free={"far_mm": 0.7 * CONFIG.free.far_mm},
        ),
    )
    port = tmp_path / "port"
    with (
        Board(SCENE, CONFIG, port=port, swinging=True) as board,
        Device(str(board.port), timeout=TIMEOUT_S) as device,
    ):
        device.load(first[0])
        wanted = []
        for (config, _), scale in ((first, 1.0), (second, MOTION)):
            found = {n: v for n, v in device.settings(config).items() if values.find(n).commit}
            for name in ("motion_a", "motion_da"):
                found[name] = tuple(round(scale * one) for one in found[name])
            # The table is of the mirror's motion, which is one.
            wanted.append({n: v for n, v in found.items() if not n.startswith("table_")})
        changed = [n for n in wanted[0] if wanted[0][n] != wanted[1][n]]
        assert {"window_two_pass", "k_noise", "n0", "tolerance", "motion_a"} <= set(changed)
        assert {"free_table_from", "free_table_to"} & set(changed)
        with device.started():
            bit = int(device.read("configuration"))
            before = int(device.read("skipped_count"))
            got = []
            with device.captured(link_pkg.CAPTURE_EVERY, 1) as lines:
                for k in range(commits + 1):
                    for _ in range(LINES):
                        captured = lines.get(3.0 * TIMEOUT_S)
                        assert captured is not None
                        got.append(captured)
                    # What waits is not seen, and takes effect as one.
                    named = changed + [n for n in wanted[0] if n.startswith("free_table")]
                    device.write_many(
                        [(n, wanted[(k + 1) % 2][n]) for n in dict.fromkeys(named)], commit=False
                    )
                    if k < commits:
                        captured = lines.get(3.0 * TIMEOUT_S)
                        assert captured is not None
                        got.append(captured)
                        assert device.commit() == bit ^ (k + 1) % 2
            skipped = int(device.read("skipped_count")) - before
            lost = int(device.read("unread_count"))
    assert commits <= skipped <= 6 * commits and not lost

    chains = first[1], second[1]
    told = 0
    angle, time, which = [], [], []
    kept = [one for one in got if one.record is not None]
    assert len(kept) >= len(got) - commits
    for one in kept:
        shown = int(one.record["bits"][0]) // CONFIGURATION & 1
        own, other = (record_of(one, chains[k ^ bit ^ shown], shown) for k in (0, 1))
        assert one.record.dtype == FULL
        for name in FULL.names or ():
            assert one.record[name][0] == own[name][0], (name, one.line)
        told += bool(np.any(own != other))
        if not int(one.record["flags"][0]) >> pkg.FLAG_NOT_RUNNING:
            angle.append(int(one.record["angle"][0]))
            time.append(int(one.record["time"][0]))
            which.append(shown ^ bit)
    assert told > len(kept) // 2
    shown = np.array(which)
    assert min(np.sum(shown == 0), np.sum(shown == 1)) >= 6

    # Over time the angles of both are one motion, but for their scale.
    word = int(values.integer(board_word(first[0])))
    turns = 2.0 * np.pi * word * np.array(time, float) / 2.0**pkg.TURN_WIDTH
    scaled = np.array(angle) / np.where(shown == 1, MOTION, 1.0)
    basis = np.column_stack([np.cos(turns), np.sin(turns)])
    fitted, *_ = np.linalg.lstsq(basis, scaled, rcond=None)
    size = np.hypot(*fitted)
    assert np.abs(basis @ fitted - scaled).max() < 0.03 * size


def taken(lines: CaptureStream, count: int) -> list[Captured]:
    """Return so many captured lines."""
    found = [lines.get(3.0 * TIMEOUT_S) for _ in range(count)]
    return [one for one in found if one is not None]


def mapped(folder: Path, name: str, phase: float, **parts: dict[str, Any]) -> Any:
    """Return a configuration with smooth maps, filled in places; the lens is at their end."""
    i, j = np.meshgrid(np.arange(ROWS), np.arange(COLUMNS), indexing="ij")
    waves = np.array([np.sin(0.2 * i + 0.3 * j + 2 * k + phase) for k in range(2)])
    filled = generator(round(10 * phase)).random(waves.shape) < 0.15
    maps = FieldMaps(CONFIG.geometry.focal_mm, 0.9, 0.512, 6.0 * waves, filled, np.zeros(2))
    with (folder / name).open("wb") as file:
        write_maps(maps, {}, file)
    given = {"file": str(folder / name), "focus_mm": 480.0}
    return configured(peak={"window": "two_pass"}, map=given, **parts)[0]


@pytest.mark.timeout(1200)  # two loads of 4,290 nodes, and the way of the lens
def test_maps_take_effect_in_the_middle_of_a_scan(tmp_path: Path) -> None:
    """Loaded in either bank, followed with the lens, refused while in use, and switched off."""
    plain, chain = configured(peak={"window": "two_pass"})
    lens_mm = {"mode": "manual", "manual_mm": 700.0}  # between the first two maps, and not far
    stages = [
        plain,
        mapped(tmp_path, "one.npz", 0.0),
        mapped(tmp_path, "two.npz", 1.0, focus=lens_mm),
        plain,
    ]
    tables = [map_table(stage) for stage in stages]
    port, filled, told = tmp_path / "port", 0, 0
    with (
        Board(SCENE, CONFIG, port=port, swinging=True) as board,
        Device(str(board.port), timeout=TIMEOUT_S) as device,
    ):
        device.load(plain)
        with device.started():
            for k, (stage, table) in enumerate(zip(stages[1:], tables[1:], strict=True)):
                wanted: dict[str, Any] = dict(map_registers(stage))
                if table is not None:
                    wanted["map_bank"] = device.write_maps(table)
                    assert wanted["map_bank"] == 1 - k
                if wanted["map_follow"]:
                    focus = {n: v for n, v in device.settings(stage).items() if "focus_" in n}
                    device.write_many(focus.items())
                    end = device.uptime() + LENS_CLKS
                    while not device.read("focus_in_position"):
                        assert device.uptime() < end
                lens = int(device.read("focus_position")) if k else 0
                with device.captured(link_pkg.CAPTURE_EVERY, 1) as lines:
                    got = taken(lines, 2)
                    device.write_many(wanted.items(), commit=False)
                    got += taken(lines, 2)
                    bit = device.commit()
                    got += taken(lines, LINES)
                bits = {bit: k + 1, 1 - bit: k}
                for one in (each for each in got if each.record is not None):
                    shown = int(one.record["bits"][0]) // CONFIGURATION & 1
                    records = []
                    for stage_of in (bits[shown], bits[1 - shown]):
                        follows = map_registers(stages[stage_of])["map_follow"]
                        given = tables[stage_of], lens if follows else None
                        records.append(record_of(one, chain, shown, *given))
                    for name in FULL.names or ():
                        assert one.record[name][0] == records[0][name][0], (k, name, one.line)
                    told += bool(np.any(records[0] != records[1]))
                    filled += int(one.record["bits"][0]) >> 5 & 1
                if wanted["map_follow"]:  # what is in use is what was loaded, and is not written
                    assert table is not None and lens != table.lens
                    device.write("map_access_bank", wanted["map_bank"])
                    with pytest.raises(DeviceError, match="BUSY"):
                        device.write_words(Block(WINDOWS["map_table"].address + 7, [0]))
                    found = device.read_maps()
                    assert found is not None and np.array_equal(found.nodes, table.nodes)
                    assert np.array_equal(found.filled, table.filled)
            assert device.read_maps() is None
    assert told > 6 and filled > 2


def board_word(config: Any) -> int:
    """Return the frequency at which the mirror is driven."""
    from vrscan.registers.mirror_registers import MirrorRegisters

    return MirrorRegisters.from_config(config).work_word

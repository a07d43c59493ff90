"""Readouts that come late, on the virtual board: the angle is that of the light, or there is none.

The truth is the scene's: where the beam of the angle that a point carries would have been seen.
"""

import numpy as np
import pytest
from harness import in_volume
from rich.console import Console
from slow_board import CONFIG, SCENE

from vrscan.data import pkg
from vrscan.data.config import Config
from vrscan.data.records import Form, Records
from vrscan.engines.board import Board
from vrscan.link.device import Device
from vrscan.link.link_report import info_table
from vrscan.registers.values import integer
from vrscan.scene import library as lines
from vrscan.scene.description import load

POWER = round(0.4 * CONFIG.laser.power_max)
PAUSE_CLKS = 40_000  # in which the sensor forgets what it holds
STEP = 3  # as many as the serial line carries
UNSETTLED = 1 << pkg.FLAG_UNSETTLED


def points(device: Device, count: int) -> Records:
    """Return so many full records of lines that all came."""
    found: list[Records] = []
    with device.stream(Form.FULL, STEP) as stream:
        for some in stream:
            found.append(some)
            if sum(map(len, found)) >= count:
                break
    assert stream.account.lost == 0
    return np.concatenate(found)


def begin_lines(device: Device, board: Board, lag: int) -> int:
    """Start the lines anew with a lag, and return the readouts that were mistimed before."""
    device.write("line_enable", 0)
    board.wait(PAUSE_CLKS)
    device.write("readout_lag", lag)
    before = integer(device.read("mistimed_count"))
    device.write("line_enable", 1)
    board.wait(PAUSE_CLKS)
    return before


def missed_px(found: Records) -> np.ndarray:
    """Return how far from the spot of a point's own angle its position is."""
    angle = 2.0 * np.pi * found["angle"] / 2.0**pkg.ANGLE_WIDTH
    made = lines.renderer(load(SCENE), CONFIG)
    words = np.zeros((len(found), CONFIG.sensor.line_length), np.uint16)
    truth = made.render(lines.at_angles(angle, CONFIG.mirror), words).truth
    bad = UNSETTLED | 1 << pkg.FLAG_AT_EDGE | 1 << pkg.FLAG_RIVAL
    seen = (found["bits"] & 1 == 1) & (found["flags"] & bad == 0) & np.isfinite(truth.position_px)
    off: np.ndarray = np.abs(found["position"] / 2.0**pkg.POSITION_FRACTION - truth.position_px)
    return off[seen]


@pytest.mark.parametrize(
    ("late", "wrong"),
    [(2.5, [0]), in_volume(2.5, [1, 3]), in_volume(0.5, [1, 2, 3]), in_volume(1.0, [0, 2, 3])],
)
def test_late_readouts_have_the_angle_of_their_light_or_none(
    late: float, wrong: list[int], tmp_path_factory: pytest.TempPathFactory
) -> None:
    right = int(late)
    config = Config.model_validate(
        CONFIG.model_dump(exclude_unset=True) | {"sensor": {"readout_lag": right}}
    )
    port = tmp_path_factory.mktemp("lag") / "port"
    with (
        Board(SCENE, config, port=port, swinging=True, late_lines=late) as board,
        Device(str(port), timeout=20.0) as device,
    ):
        device.load(config)
        device.write_many([("laser_adapt", 0), ("laser_power", POWER)])
        device.start()
        board.wait(PAUSE_CLKS)
        for lag in (*wrong, right):
            before = begin_lines(device, board, lag)
            found = points(device, 80 if lag == right else 15)
            mistimed = integer(device.read("mistimed_count")) - before
            console = Console(width=200)
            with console.capture() as shown:
                console.print(info_table(device))
            if lag == right:
                assert mistimed == 0
                assert (found["flags"] & UNSETTLED == 0).all()
                off = missed_px(found)
                other = found.copy()
                other["angle"] = np.roll(found["angle"], 1)
                assert np.median(missed_px(other)) > 5.0  # so the angle of another line is seen
                print(f"\n{late} lines late: {len(off)} points, {np.median(off):.3f} px off")
                assert len(off) > 20 and np.median(off) < 0.5 and (off < 4.0).mean() > 0.9
            else:
                assert mistimed >= STEP * len(found)
                assert (found["flags"] & UNSETTLED != 0).all()
                assert (found["angle"] == 0).all() and (found["power"] == 0).all()
                assert "mistimed_count" in shown.get()
        assert board.status().lines_lost <= 4  # those that the lines' end cut short

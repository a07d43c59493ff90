"""The virtual board as a whole: a host that starts the mirror gets the scene's points.

At a clock of 25 MHz and with fewer lines, where a second of mirror time takes a quarter.
"""

import time
from collections.abc import Iterator

import numpy as np
import pytest
from rich.console import Console
from slow_board import CONFIG, SCENE

from vrscan.data import pkg
from vrscan.data.config import BLANKING_CLKS
from vrscan.engines.board import Board
from vrscan.link.device import Device
from vrscan.link.link_report import info_table
from vrscan.registers.values import integer
from vrscan.scene import library as lines
from vrscan.scene.description import load

POWER = round(0.4 * CONFIG.laser.power_max)
STREAM_CLKS = 4_000_000
LEAST_CLKS = CONFIG.sensor.line_length + BLANKING_CLKS  # from line to line
LOSSES = (
    *("short_count", "long_count", "unfinished_count", "early_count"),
    *("untagged_count", "mistimed_count"),
)


@pytest.fixture(scope="module")
def board(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Board]:
    port = tmp_path_factory.mktemp("board") / "port"
    with Board(SCENE, CONFIG, port=port, swinging=True) as running:
        with Device(str(port), timeout=20.0) as host:
            host.load(CONFIG)
            host.write_many([("line_enable", 1), ("laser_adapt", 0), ("laser_power", POWER)])
            host.write_many([("laser_enable", 1), ("mirror_enable", 1)])
            host.wait_for_mirror()
        yield running


@pytest.fixture
def device(board: Board) -> Iterator[Device]:
    with Device(str(board.port), timeout=20.0) as found:
        yield found


def test_it_says_what_it_is(device: Device) -> None:
    build = device.build
    assert (build.clock_hz, build.board_id) == (25_000_000, 255)
    assert build.line_length == CONFIG.sensor.line_length
    assert build.index_oversample == CONFIG.mirror.oversample


def test_the_points_are_the_scenes(board: Board, device: Device) -> None:
    begin, rows = board.clocks(), []
    with device.stream(step=5) as points:
        for some in points:
            rows.append(some)
            if board.clocks() > begin + STREAM_CLKS:
                break
    found = np.concatenate(rows)
    fields = {name: found[name] for name in found.dtype.names}
    assert len(found) > 150 and (np.diff(fields["line"].astype(int)) > 0).all()
    raised = fields["flags"] >> pkg.FLAG_NOT_RUNNING
    assert (raised == 0).mean() > 0.9 and (fields["power"] == POWER).mean() > 0.9

    scale = 2.0**pkg.LENGTH_FRACTION
    angle = 2.0 * np.pi * fields["angle"] / 2.0**pkg.ANGLE_WIDTH
    x, z, sigma = fields["x"] / scale, fields["z"] / scale, fields["sigma_z"] / scale
    made = lines.renderer(load(SCENE), CONFIG)
    words = np.zeros((len(found), CONFIG.sensor.line_length), np.uint16)
    truth = made.render(lines.at_angles(angle, CONFIG.mirror), words).truth
    # LOW_SNR .. NO_PHASE but RIVAL, which noise raises, and the mirror's.
    bad = (1 << pkg.FLAG_LOW_SNR) | (1 << pkg.FLAG_TOO_WIDE) | (1 << pkg.FLAG_TOO_NARROW)
    bad |= (1 << pkg.FLAG_AT_EDGE) | (1 << pkg.FLAG_NO_PHASE) | (7 << pkg.FLAG_NOT_RUNNING)
    seen = (fields["flags"] & bad == 0) & np.isfinite(truth.position_px)
    assert seen.sum() > 80
    off = np.abs(z - truth.z_mm)[seen]
    print(f"{seen.sum()} points: z off by {np.median(off):.3f} mm in the middle of all")
    # Speckle is not in sigma, and spots at edges are nobody's.
    assert np.median(off) < 0.5 and np.median(sigma[seen]) < 0.5
    assert (off < 3.0).mean() > 0.9
    assert (np.abs(x - truth.x_mm)[seen] < 1.0).mean() > 0.9
    assert np.ptp(z[seen]) > 50.0  # of table, block and pin


def test_a_captured_line_is_what_the_sensor_made(board: Board, device: Device) -> None:
    pixels = device.capture().pixels
    assert len(pixels) == CONFIG.sensor.line_length
    dark = load(SCENE).sensor
    assert abs(np.median(pixels) - dark.offset_counts) < 20 and pixels.std() > 0.5


def test_its_lines_are_all_read_out(board: Board, device: Device) -> None:
    board.wait(STREAM_CLKS // 4)
    status = board.status()
    assert status.lines > 200 and status.lines_lost == 0 and status.framing == 0
    names = (*LOSSES, "unread_count", "uart_framing")
    assert [device.read(name) for name in names] == [0] * len(names)


@pytest.mark.parametrize(("period", "lost"), [(LEAST_CLKS + 2, False), (LEAST_CLKS - 4, True)])
def test_exposures_that_are_never_read_out_are_counted(
    board: Board, device: Device, period: int, lost: bool
) -> None:
    """Just below the largest rate that a configuration may have there is none, just above many.

    The simulated sensor knows itself which exposures it lost.
    """
    counters = ["unread_count", *LOSSES]
    kept = device.read_many(["ratio", "exposure_clks"])

    def counted() -> tuple[int, list[int], int]:
        """Return the counters, and what the sensor lost before and behind them."""
        early = board.status().lines_lost
        found = device.read_many(counters)
        board.wait(0)  # a status is up to a twentieth of a second old
        return early, [integer(found[name]) for name in counters], board.status().lines_lost

    try:
        word = integer(device.read("mirror_word"))
        ratio = round(2.0 ** (pkg.TURN_WIDTH + pkg.RATIO_FRACTION) / period / word)
        device.write_many([("exposure_clks", 1000), ("ratio", ratio)])
        board.wait(20_000)
        (early, before, least), lines = counted(), board.status().lines
        board.wait(1_000_000)
        more, (most, after, late) = board.status().lines, counted()
        console = Console(width=200)
        with console.capture() as shown:
            console.print(info_table(device))
    finally:
        device.write_many(kept.items())
    assert more - lines > 150
    unread, *others = (b - a for a, b in zip(before, after, strict=True))
    assert others == [0] * len(LOSSES)
    assert most - least - 1 <= unread <= late - early + 1  # one is not known to be lost yet
    assert unread > 100 if lost else (unread, late - early) == (0, 0)
    assert ("unread_count" in shown.get()) == (after[0] > 0)


def test_unplugging_stops_nothing_and_the_next_host_is_heard(board: Board, device: Device) -> None:
    device.close()
    before = board.status()
    time.sleep(0.2)
    with Device(str(board.port), timeout=20.0) as again:
        assert again.build.board_id == 255
        assert again.read("mirror_state") == pkg.MIRROR_RUN
    assert board.running and board.status().lines > before.lines

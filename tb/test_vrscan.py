"""The wiring of vrscan.sv: what no module below it can get wrong, on the virtual board.

The modules are proven where they live. Here the points that leave the instrument, the light and the
lens have to follow what the mirror, the clock and the scene do.
"""

import contextlib
from collections.abc import Iterator

import numpy as np
import pytest
from slow_board import CONFIG, SCENE

from vrscan.data import link_pkg, pkg
from vrscan.data.records import Form, Records
from vrscan.engines.board import Board
from vrscan.link.device import Device, integer
from vrscan.link.selftest import SelfTest, arranged, runs

POWER = round(0.4 * CONFIG.laser.power_max)
FULL_SCALE = 2**CONFIG.sensor.pixel_width - 1
LINE_CLKS = CONFIG.clock.frequency_hz / CONFIG.line.rate_hz
PERIOD_CLKS = round(CONFIG.clock.frequency_hz / CONFIG.mirror.frequency_hz)
PATIENCE_S = 60.0
AHEAD = 600  # lines to one that is asked for: in the time that the one before takes on its way
STEP = 3  # full records of every line are more than 3 Mbaud carry
GUARD, TRIPPED = 1 << 1, 1 << 4  # of laser_status
SPENT = 1 << 2  # of laser_guard_fault


@pytest.fixture(scope="module")
def board(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Board]:
    port = tmp_path_factory.mktemp("wiring") / "port"
    with Board(SCENE, CONFIG, port=port, swinging=True) as running:
        yield running


@pytest.fixture(scope="module")
def device(board: Board) -> Iterator[Device]:
    """The board in RUN, at a constant power."""
    with Device(str(board.port), timeout=20.0, keep_alive=False) as found:
        found.load(CONFIG)
        found.write_many({"laser_adapt": 0, "laser_power": POWER}.items())
        found.start()
        yield found


@contextlib.contextmanager
def changed(device: Device, board: Board, periods: int, **settings: int) -> Iterator[None]:
    """Change registers for the time of a block, which begins some periods of the mirror later."""
    held = device.read_many(settings)
    device.write_many(settings.items())
    try:
        board.wait(periods * PERIOD_CLKS)
        yield
    finally:
        device.write_many(held.items())


def points(device: Device, count: int) -> Records:
    """Return full records of lines that all came, one by one in the distance ``STEP``."""
    found: list[Records] = []
    with device.stream(Form.FULL, STEP) as stream:
        while sum(map(len, found)) < count:
            some = stream.get(timeout=PATIENCE_S)
            assert some is not None, f"no point in {PATIENCE_S:g} s"
            found.append(some)
    assert stream.account.lost == 0
    return np.concatenate(found)


def test_a_point_says_when_where_and_by_what_light(device: Device) -> None:
    found = points(device, 300)
    bits = found["bits"]
    assert (bits & 0b100 == 0).all()  # none is a test line's
    power = found["power"]
    assert (power == POWER).mean() > 0.95
    assert (power[power != POWER] == 0).all()

    lines = np.diff(found["line"])
    clks = np.diff(found["time"])  # u32, which wraps as the counter does
    assert (clks < 1 << 31).all()
    assert np.abs(clks / (lines * LINE_CLKS) - 1.0).max() < 0.02

    # Inward is the half turn that begins at the mark's turning point.
    inward = bits & 0b010 != 0
    assert 0.4 < inward.mean() < 0.6
    angle = found["angle"].astype(float)
    falls = np.diff(angle) < 0
    same = inward[1:] == inward[:-1]
    assert same.mean() > 0.7
    assert (falls[same] == inward[1:][same]).mean() > 0.97


def test_the_confidence_is_the_mirror_models(device: Device, board: Board) -> None:
    with changed(device, board, 3, confidence_gain=0):
        assert (points(device, 60)["confidence"] == 255).all()
    with changed(device, board, 3, confidence_gain=2**24 - 1):
        assert (points(device, 60)["confidence"] < 255).mean() > 0.5


def test_a_line_comes_whole_and_by_its_number(device: Device, board: Board) -> None:
    """While points go the same way."""
    with device.stream(Form.FULL, 50):
        number = device.capture(timeout=PATIENCE_S).line + AHEAD
        found = device.capture(link_pkg.CAPTURE_LINE, number, timeout=PATIENCE_S)
    assert found.line == number and found.record is not None
    assert found.record["line"][0] == number & 0xFFFF_FFFF
    assert found.pixels.max() == found.record["maximum"][0] > 0


def test_the_time_goes_on(device: Device, board: Board) -> None:
    first = device.uptime()
    board.wait(2 * PERIOD_CLKS)
    assert 2 * PERIOD_CLKS < device.uptime() - first < board.clocks()


@pytest.mark.parametrize(("begin", "target"), [(2000, 0.3), (65_535, 0.3), (4000, 0.04)])
def test_the_power_follows_the_peaks(
    begin: int, target: float, device: Device, board: Board
) -> None:
    """From below and from above, to a height that is one above the background of 0.015."""
    # So slowly that the light of a whole turn counts.
    gains = {"laser_up": 4096, "laser_down": 4096, "laser_search": 16, "laser_cut": 14_746}
    with (
        changed(device, board, 1, laser_power=begin, laser_power_min=100, **gains),
        changed(device, board, 16, laser_adapt=1, laser_target=round(target * 2**16)),
    ):
        found = points(device, 240)
    found = found[(found["bits"] & 1 == 1) & (found["power"] > 0)]
    background = found["background"] / 2.0 ** (24 - CONFIG.sensor.pixel_width)
    height = (found["maximum"] - background) / FULL_SCALE
    print(f"\nfrom a power of {begin}: height {height.mean():.4f} of {target}")
    assert 0.8 < height.mean() / target < 1.25


@pytest.mark.parametrize(
    ("limit", "value", "count"),
    [
        ("laser_limit_pulse_clks", 10, "laser_cut_count"),
        ("laser_limit_bucket", 400_000, "laser_duty_count"),
    ],
)
def test_a_limit_cuts_and_counts(
    limit: str, value: int, count: str, device: Device, board: Board
) -> None:
    counters = "laser_cut_count", "laser_duty_count", "laser_watchdog_count"
    before = device.read_many(counters)
    with changed(device, board, 2, **{limit: value}):
        found = points(device, 60)
    after = device.read_many(counters)
    rose = {name for name in counters if integer(after[name]) > integer(before[name])}
    assert rose == {count}
    assert (found["power"] < POWER).mean() > 0.3


def test_the_largest_power_is_the_limits(device: Device, board: Board) -> None:
    with changed(device, board, 2, laser_limit_power=POWER // 3):
        power = points(device, 60)["power"]
    assert (power == POWER // 3).mean() > 0.95 and power.max() == POWER // 3


def test_the_lens_follows_the_distance(device: Device, board: Board) -> None:
    with changed(device, board, 6, focus_mode=2, focus_average_shift=5, focus_hold_points=8):
        found = points(device, 240)
        status = device.read_many(("focus_distance", "focus_target", "focus_position"))
    scale = 2.0**pkg.LENGTH_FRACTION
    good = found["z"][(found["bits"] & 1 == 1) & (found["flags"] == 0)] / scale
    distance = integer(status["focus_distance"]) / scale
    print(f"\n{distance:.0f} mm of {good.min():.0f} to {good.max():.0f}; {status}")
    assert good.min() < distance < good.max()
    assert 0 < integer(status["focus_position"]) <= integer(status["focus_target"])


def test_the_guard_ends_what_the_registers_allow(device: Device, board: Board) -> None:
    """Faint pulses in a sixth of the time, which no limit of the core forbids; until a new enable.

    The mirror goes on meanwhile for as long as it may without an index.
    """
    names = ("laser_guard_count", "laser_guard_fault", "laser_status")
    before = device.read_many(names)
    assert integer(before["laser_status"]) & GUARD
    quick = {"ratio": 2 * integer(device.read("ratio")), "pulse_clks": 240}
    with changed(device, board, 1, laser_limit_pulse_clks=1000, laser_power=100, **quick):
        tripped = device.read_many(names)
    board.wait(PERIOD_CLKS // 8)
    after = device.read_many((*names, "mirror_state"))
    lit = board.status().pulse_at
    board.wait(PERIOD_CLKS // 4)
    assert not integer(after["laser_status"]) & GUARD and board.status().pulse_at == lit
    assert integer(tripped["laser_guard_count"]) == integer(before["laser_guard_count"]) + 1
    assert integer(after["laser_guard_count"]) == integer(tripped["laser_guard_count"])
    assert integer(after["laser_guard_fault"]) == SPENT
    device.write("laser_enable", 0)
    device.write("laser_enable", 1)
    board.wait(2 * PERIOD_CLKS)
    assert integer(device.read("laser_status")) & GUARD and board.status().pulse_at > lit


def test_lines_of_the_boards_own_say_so(device: Device, board: Board) -> None:
    """And give the model's points."""
    name, settings = next(iter(runs(device.build.line_length).items()))
    with changed(device, board, 1, line_enable=0), arranged(device):
        check = SelfTest(device).run(name, settings, Form.FULL, 1 << 18, POWER)
    assert check.difference is None and check.compared > settings.lines


def test_a_silent_host_ends_the_light(device: Device, board: Board) -> None:
    """The last one, because the mirror loses its index."""
    before = integer(device.read("laser_watchdog_count"))
    with changed(device, board, 1, laser_watchdog_clks=PERIOD_CLKS // 4):
        assert integer(device.read("laser_watchdog_count")) == before + 1
        assert integer(device.read("laser_status")) & TRIPPED

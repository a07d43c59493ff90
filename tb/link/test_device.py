"""``Device`` against a board made of the twins, on a line that can be bad."""

import itertools
import math
import re
import termios
import threading
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fake_board import CLOCK_HZ, LINE_LENGTH, FakeBoard
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from random_records import random_records
from scanners import EACH_SCANNER

from vrscan.data import link_pkg, records
from vrscan.data.config import Config
from vrscan.data.errors import InputError
from vrscan.data.records import Form
from vrscan.link import device as device_module
from vrscan.link import transport as transport_module
from vrscan.link.device import Device
from vrscan.link.protocol import Batch
from vrscan.link.register_host import DeviceError
from vrscan.link.stream import PointStream
from vrscan.link.transport import LinkError, NoAnswerError, UnpluggedError
from vrscan.registers import values
from vrscan.registers.load import settings as load_settings
from vrscan.registers.register_map import MAP_HASH, REGISTERS, WINDOWS

TIMEOUT_S = 4.0
SEED = 20261122


@pytest.fixture
def board(tmp_path: Path) -> Iterator[FakeBoard]:
    with FakeBoard(tmp_path / "port") as made:
        made.made = random_records(np.random.default_rng(SEED), range(997))
        made.pixels = np.random.default_rng(SEED).integers(
            0, 4096, (7, LINE_LENGTH), dtype=np.uint16
        )
        yield made


@pytest.fixture
def device(board: FakeBoard) -> Iterator[Device]:
    with Device(str(board.path), timeout=TIMEOUT_S) as made:
        yield made


@pytest.fixture
def quiet(board: FakeBoard) -> Iterator[Device]:
    """A device that sends no signs of life."""
    with connected(board, keep_alive=False) as made:
        yield made


def connected(board: FakeBoard, **more: Any) -> Device:
    return Device(str(board.path), timeout=TIMEOUT_S, **more)


# ---- registers ----


def test_what_a_board_is(device: Device) -> None:
    build = device.build
    assert (build.clock_hz, build.line_length, build.board_id) == (100_000_000, LINE_LENGTH, 7)
    assert build.version_text.count(".") == 2
    assert build.map_hash == MAP_HASH


@settings(
    deadline=None,
    max_examples=30,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(data=st.data())
def test_every_legal_value_comes_back(
    device: Device, board: FakeBoard, data: st.DataObject
) -> None:
    writable = [r for r in REGISTERS.values() if r.access == "rw" and not r.name.startswith("lock")]
    register = data.draw(st.sampled_from(writable))
    one = st.integers(register.minimum, register.maximum)
    value: values.Value = data.draw(one)
    if register.count > 1:
        value = tuple(data.draw(st.lists(one, min_size=register.count, max_size=register.count)))
    setattr(device.registers, register.name, value)
    assert getattr(device.registers, register.name) == value == device.registers[register.name]
    held = board.file.values[register.name]
    assert tuple(held) == (value if isinstance(value, tuple) else (value,))


@settings(deadline=None, max_examples=50)
@given(
    name=st.sampled_from(sorted(n for n, r in REGISTERS.items() if r.width <= 48 and r.count == 1)),
    data=st.data(),
)
def test_units_and_integers_are_the_same(name: str, data: st.DataObject) -> None:
    register = REGISTERS[name]
    value = data.draw(st.integers(register.minimum, register.maximum))
    scaled = values.to_scaled(name, value)
    assert values.from_scaled(name, scaled) == value
    assert values.from_words(name, values.to_words(name, value)) == value
    with pytest.raises(InputError, match=name):
        values.to_words(name, register.maximum + 1)
    with pytest.raises(InputError, match=name):
        values.from_scaled(name, (register.maximum + 1) * 2.0**-register.fraction)


def test_blocks_are_few_and_tear_nothing() -> None:
    wide = {r.address for r in REGISTERS.values() if r.width > 32}
    names = [r.name for r in REGISTERS.values() if r.access == "rw"]
    fields = [field.name for window in WINDOWS.values() for field in window.fields]
    zeros = [
        (name, tuple([max(0, values.find(name).minimum)] * values.count(name)))
        for name in names + fields
    ]
    blocks = values.write_blocks(zeros)
    written = [block.address + k for block in blocks for k in range(len(block.words))]
    wanted = sorted(address for name in names + fields for address in values.addresses(name))
    assert written == wanted
    assert max(len(block.words) for block in blocks) <= link_pkg.MAX_WORDS
    for block in blocks:
        assert block.address + len(block.words) - 1 not in wide
        for window in WINDOWS.values():
            inside = window.address <= block.address < window.address + 2 * window.entries
            assert not inside or (block.address - window.address) % window.stride == 0
    neighbours = sum(
        1 for a, b in itertools.pairwise(blocks)
        if a.address + len(a.words) == b.address and len(a.words) < link_pkg.MAX_WORDS - 1
    )  # fmt: skip
    assert neighbours == 0


@pytest.mark.parametrize("most", [2, 3, 5, 8])
def test_shorter_commands_tear_nothing(monkeypatch: pytest.MonkeyPatch, most: int) -> None:
    monkeypatch.setattr(link_pkg, "MAX_WORDS", most)
    lower = {r.address for r in REGISTERS.values() if r.width > 32}
    names = [*REGISTERS, *(field.name for window in WINDOWS.values() for field in window.fields)]
    blocks = values.read_blocks(names)
    assert max(len(block.words) for block in blocks) <= most
    for block in blocks:
        end = block.address + len(block.words)
        assert end - 1 not in lower
        for window in WINDOWS.values():
            inside = 0 <= end - window.address <= window.stride * window.entries
            assert not inside or (end - window.address) % window.stride == 0


def test_what_is_wrong_is_told_before_it_is_sent(device: Device, board: FakeBoard) -> None:
    before = board.executed.get(link_pkg.COMMAND_WRITE, 0)
    wrong: list[tuple[str, Any, str]] = [
        ("min_width", 2, "min_width: must be 3 to 255 (2)"),
        ("min_widht", 3, "min_width"),
        ("uptime", 0, "uptime: cannot be written"),
        ("motion_a", (1, 2), "motion_a: needs 9 values (2)"),
        ("motion_a", (0,) * 8 + (1 << 24,), "motion_a[8]"),
        ("table_amplitude", (0,) * 1024, "table_midpoint: is missing"),
        ("k_noise", 2.5, "k_noise: needs an integer (2.5)"),
    ]
    for name, value, says in wrong:
        with pytest.raises(InputError, match=re.escape(says)):
            device.write(name, value)
    assert board.executed.get(link_pkg.COMMAND_WRITE, 0) == before
    with pytest.raises(AttributeError):
        device.registers.k_nose = 3
    with pytest.raises(AttributeError):
        _ = device.registers.k_nose


def test_what_the_board_refuses_names_register_and_value(device: Device) -> None:
    cases = (
        (values.Block(REGISTERS["min_width"].address, [1]), "min_width = 1: BAD_VALUE"),
        (values.Block(REGISTERS["uptime"].address, [9]), "uptime = 9: READ_ONLY"),
        (values.Block(0x3000, [9]), "address 0x3000 = 9: NO_ADDRESS"),
        (values.Block(REGISTERS["k1"].address, [1 << 31]), "k1 = -2147483648: BAD_VALUE"),
        (values.Block(REGISTERS["motion_a"].address + 3, [1 << 30]), r"motion_a\[3\] = 1073741824"),
    )
    for block, says in cases:
        with pytest.raises(DeviceError, match=says):
            device.write_words(block)
    device.lock("calibration")
    with pytest.raises(DeviceError, match=r"k_noise = 7: LOCKED") as error:
        device.write("k_noise", 7)
    assert error.value.status == link_pkg.STATUS_LOCKED
    assert "\n" not in str(error.value)
    with pytest.raises(InputError, match="no lock 'door'"):
        device.lock("door")


def board_config(**more: object) -> Config:
    own = {"sensor": {"line_length": LINE_LENGTH}, "geometry": {"centre_px": 511.5}}
    return Config.model_validate(own | more)


def test_a_configuration_is_loaded_whole(device: Device, board: FakeBoard) -> None:
    config = board_config(peak={"k_noise": 3.25, "min_width": 5})
    done: list[tuple[int, int]] = []
    device.load(config, progress=lambda k, n: done.append((k, n)))
    wanted = load_settings(config, device.build)
    assert device.read_many(wanted) == wanted
    assert device.registers.k_noise == 832
    commands = board.executed[link_pkg.COMMAND_WRITE] - 1  # the last one is the commit
    words = sum(len(values.addresses(name)) for name in wanted)
    assert done[-1] == (commands, commands)
    assert commands < words / link_pkg.MAX_WORDS + 20


@EACH_SCANNER
def test_a_shipped_scanner_is_loaded_into_a_board_of_its_own(
    config: Config, board: FakeBoard
) -> None:
    """With its sensor and clock; the unit of length comes back with it."""
    sensor, clock_hz = config.sensor, round(config.clock.frequency_hz)
    board.file.inputs |= {"clock_hz": clock_hz, "line_length": sensor.line_length}
    board.file.inputs["pixel_width"] = sensor.pixel_width
    with connected(board) as device:
        device.load(config)
        wanted = load_settings(config, device.build)
        assert device.read_many(wanted) == wanted
        assert device.registers.length_unit == config.geometry.unit_mm


def test_no_configuration_while_the_mirror_moves(device: Device, board: FakeBoard) -> None:
    board.file.inputs["mirror_state"] = 3
    before = device.read("k_noise")
    with pytest.raises(LinkError, match="the mirror is in RUN"):
        device.load(board_config(peak={"k_noise": 9.0}))
    assert device.read("k_noise") == before
    device.load(board_config(peak={"k_noise": 9.0}), force=True)
    assert device.read("k_noise") == 9 * 256


def test_a_configuration_for_another_sensor_is_refused(device: Device) -> None:
    with pytest.raises(InputError, match=r"sensor\.line_length"):
        device.load(Config())


def test_waiting_for_the_mirror(quiet: Device, board: FakeBoard) -> None:
    """By a clock of the board that goes on by 50 ms a command; 300 ms are allowed."""
    seen: list[tuple[str, float]] = []

    def told(state: str, share: float) -> None:
        seen.append((state, share))
        board.file.inputs.update(mirror_state=3)

    quiet.write_many([("sweep_timeout", 10_000_000), ("settle_timeout", 10_000_000)])
    board.clocks = itertools.count(1_000, 5_000_000).__next__
    board.file.inputs["mirror_state"] = 1
    quiet.wait_for_mirror(progress=told)
    assert [state.split(",")[0] for state, _ in seen] == ["SWEEP", "RUN"]
    assert 0.0 < seen[0][1] < 1.0 and seen[1][1] == 1.0
    board.file.inputs.update(mirror_state=4, mirror_fault=1)
    with pytest.raises(LinkError, match="FAULT: sweep"):
        quiet.wait_for_mirror()
    board.file.inputs.update(mirror_state=2)
    with pytest.raises(LinkError, match=r"is in SETTLE and not in RUN after 0\.35 s$"):
        quiet.wait_for_mirror()


def test_a_start_is_seen_to_go_on(device: Device, board: FakeBoard) -> None:
    """By the drive's frequency, and by the share of the time that this sweep and its end take."""
    turn = 2**48 / CLOCK_HZ
    high, low = round(275 * turn), round(249 * turn)
    device.write_many([("sweep_word", high), ("work_word", low), ("sweep_timeout", 10**9)])
    device.write("sweep_rate", round(65536 * (high - low) / (0.3 * CLOCK_HZ)))  # 0.3 s of sweep
    told: list[tuple[str, float]] = []

    def look(text: str, share: float) -> None:
        told.append((text, share))
        if share > 0.3:
            board.file.inputs["mirror_state"] = 3

    board.file.inputs.update(mirror_state=1, mirror_word=round(262.5 * turn))
    device.wait_for_mirror(progress=look)
    shares = [share for _, share in told]
    assert told[0][0] == "SWEEP, drive 262.50 Hz"
    assert len(set(shares)) > 2 and shares == sorted(shares)
    assert 0.3 < shares[-2] < 0.9  # within a second of the board's time
    assert shares[-1] == 1.0


def test_why_it_is_dark(device: Device, board: FakeBoard) -> None:
    device.write_many([("line_enable", 0), ("laser_enable", 0)])
    board.file.inputs.update(mirror_state=0)
    assert device.darkness() == "lines stand still, the laser is off, the mirror is in OFF"
    device.write_many([("line_enable", 1), ("laser_enable", 1)])
    board.file.inputs.update(mirror_state=4, mirror_fault=3, laser_status=16)
    assert "went off" in device.darkness() and "FAULT (index)" in device.darkness()
    board.file.inputs.update(mirror_state=3, laser_status=1, laser_guard_fault=6)
    assert device.darkness() == (
        "the laser's guard permits no light, "
        "which last tripped at a pulse too long and too many pulses"
    )
    board.file.inputs.update(mirror_state=3, laser_status=7)
    assert device.darkness() == ""


def test_the_least_step_is_what_the_serial_line_carries(device: Device, board: FakeBoard) -> None:
    """Frames of 3 full points in 206 bytes, 28 compact ones in 238, 25 of space in 239."""
    assert (device.least_step(True), device.least_step(False)) == (1, 1)  # lines stand still
    board.file.inputs["mirror_word"] = round(249 / CLOCK_HZ * 2**48)
    device.write("ratio", round(37_400 / 249 * 2**32))
    for form, count, size in ((1, 3, 206), (0, 28, 238), (2, 25, 239)):
        share = 37_400 * 10 * size / count / 3e6
        assert device.least_step(form) == math.ceil(share / 0.9)
    device.write("points_batch", 1)
    assert device.least_step(True) == math.ceil(37_400 * 780 / 3e6 / 0.9)
    device.write("ratio", round(1_000_000 / 249 * 2**32))
    assert device.least_step(True) == 255


# ---- a bad line ----


@pytest.mark.parametrize("seed", range(3))
def test_a_bad_line_changes_nothing_but_the_time(tmp_path: Path, seed: int) -> None:
    with (
        FakeBoard(tmp_path / "port", seed=seed) as board,
        Device(str(board.path), timeout=4) as dev,
    ):
        board.faults.drop = board.faults.flip = 0.003
        draw = np.random.default_rng(seed)
        for _ in range(60):
            value = tuple(draw.integers(-(1 << 23), 1 << 23, 9).tolist())
            dev.write("motion_a", value)
            assert dev.read("motion_a") == value
        board.faults.drop = board.faults.flip = 0.0
        traffic = dev.traffic
        assert traffic.retries > 0
        assert traffic.bad_frames + traffic.refused > 0
        dev.ping()


def test_a_lost_reply_is_asked_for_again(device: Device, board: FakeBoard) -> None:
    board.faults.lose_replies = 2
    device.write("k_noise", 321)
    assert board.file.values["k_noise"] == [321]
    assert device.traffic.retries == 2


def test_an_event_is_not_written_again(device: Device, board: FakeBoard) -> None:
    device._transport.timeout = 0.5
    before = len(board.file.written)
    board.faults.lose_replies = 1
    with pytest.raises(NoAnswerError, match="whether the board did it is not known"):
        device.write("test_stop", 1)
    assert len(board.file.written) == before + 1
    assert device.traffic.retries == 0


def test_a_late_reply_is_not_taken_for_another(quiet: Device, board: FakeBoard) -> None:
    quiet._transport.timeout = 1.0
    board.faults.delay_s = 0.4  # longer than an attempt
    before = quiet.traffic.retries - quiet.traffic.late
    with pytest.raises(NoAnswerError, match=r"no answer to READ after 1 s and \d attempts"):
        quiet.read("k_noise")
    board.faults.delay_s = 0.0
    sent = 1 + quiet.traffic.retries - before
    assert sent > 1
    while quiet.traffic.late < sent:  # pytest's limit of time ends it if they never come
        time.sleep(0.01)
    quiet.ping()
    assert quiet.traffic.late == sent
    assert quiet.read("identity") == REGISTERS["identity"].reset[0]


def test_garbage_between_frames(device: Device, board: FakeBoard) -> None:
    draw = np.random.default_rng(SEED)
    for _ in range(20):
        board.send_raw(draw.bytes(300))
        device.ping()
    assert device.traffic.bad_frames > 0


def test_a_silent_board(tmp_path: Path) -> None:
    with FakeBoard(tmp_path / "port") as board:
        board.faults.silent = True
        with pytest.raises(NoAnswerError, match=r"at 3000000 baud within 0\.5 s"):
            Device(str(board.path), timeout=0.5)


def test_no_port_and_a_port_that_is_taken(tmp_path: Path, device: Device) -> None:
    with pytest.raises(LinkError, match="No such file"):
        Device(str(tmp_path / "none"))
    with pytest.raises(LinkError, match="another program has this port"):
        Device(device.port)


def test_another_map(tmp_path: Path) -> None:
    with FakeBoard(tmp_path / "port", map_hash=0x12345678) as board:
        with pytest.raises(LinkError, match=f"0x12345678, want {MAP_HASH:#010x}") as error:
            connected(board)
        assert "\n" not in str(error.value)


# ---- unplugged ----


def test_unplugged_and_plugged_again(board: FakeBoard) -> None:
    with connected(board) as device:
        board.unplug()
        with pytest.raises(UnpluggedError, match="the port is gone"):
            device.read("uptime")
        with pytest.raises(UnpluggedError):
            device.read("uptime")
        with pytest.raises(LinkError, match="No such file"):
            device.reconnect(0.2)
        board.reset()
        threading.Timer(0.3, board.plug).start()
        device.reconnect(3.0)
        device.write("k_noise", 77)
        assert board.file.values["k_noise"] == [77]


ERRORS = [termios.error(5, "Input/output error"), OSError(19, "No such device"), TypeError("fd")]


@pytest.mark.parametrize("error", ERRORS, ids=lambda each: type(each).__name__)
@pytest.mark.parametrize("call", ["flush", "_reconfigure_port", "write", "read", "in_waiting"])
def test_whatever_a_port_raises_it_is_gone(
    board: FakeBoard, monkeypatch: pytest.MonkeyPatch, call: str, error: Exception
) -> None:
    """``_reconfigure_port`` is what pyserial does for a new rate."""

    def fail(*_: object, **__: object) -> None:
        raise error

    with connected(board) as device:
        kind = type(device._transport._serial)
        raising = property(fail) if call == "in_waiting" else fail
        with monkeypatch.context() as patch:
            patch.setattr(kind, call, raising)
            with pytest.raises(UnpluggedError, match="the port is gone"):
                device.set_baud(1_000_000)
        with pytest.raises(UnpluggedError):
            device.ping()
        device.reconnect()
        device.ping()
        for each in ("close", "cancel_read"):
            monkeypatch.setattr(kind, each, fail)


@pytest.mark.parametrize("error", [*ERRORS, re.error("bad")], ids=lambda each: type(each).__name__)
def test_whatever_an_open_raises_is_one_line(
    board: FakeBoard, monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr("serial.serial_for_url", fail)
    with pytest.raises(LinkError, match="cannot open") as found:
        connected(board)
    assert "\n" not in str(found.value)


@pytest.mark.parametrize("reached", [True, False])
def test_unplugged_at_a_change_of_rate(board: FakeBoard, reached: bool) -> None:
    """The port goes while the last bytes at the old rate are sent, or before a break."""
    with connected(board) as device:
        (board.unplug_at_rate if reached else board.unplug)()
        change = partial(device.set_baud, 1_000_000) if reached else device._transport.send_break
        with pytest.raises(UnpluggedError, match="the port is gone"):
            change()


def test_a_rate_that_no_port_has_is_not_a_port_that_is_gone(device: Device) -> None:
    with pytest.raises(LinkError, match="no rate of") as error:
        device._transport.baud = 1 << 40
    assert not isinstance(error.value, UnpluggedError)
    device.ping()


def test_unplugged_in_a_stream_ends_it(board: FakeBoard, device: Device) -> None:
    device.write("line_enable", 1)
    stream = device.stream()
    assert stream.get(TIMEOUT_S) is not None
    board.unplug()
    with pytest.raises(UnpluggedError):
        for _ in stream:
            pass


def test_one_host_after_another_and_one_that_died(board: FakeBoard) -> None:
    for k in range(3):
        with connected(board) as device:
            device.write("line_enable", 1)
            stream = device.stream(k % 2)
            assert stream.get(TIMEOUT_S) is not None
            device.captured(link_pkg.CAPTURE_EVERY, 3).__enter__()
            device._disconnect()  # without a word to the board
        with connected(board) as device:
            time.sleep(0.1)
            unasked = device.traffic.unasked
            time.sleep(0.1)
            assert device.traffic.unasked == unasked  # nothing streams any more
            with device.stream() as stream:
                found = stream.get(TIMEOUT_S)
            assert found is not None
            assert stream.account.lost == 0


class Pulse(threading.Event):
    """What the sign of life waits on, with a time of its own, until ``end``."""

    def __init__(self, end: float) -> None:
        super().__init__()
        self.now, self.end = 0.0, end

    def monotonic(self) -> float:
        return self.now

    def wait(self, timeout: float | None = None) -> bool:
        assert timeout is not None
        self.now += timeout
        return self.now >= self.end


@pytest.mark.parametrize(("watchdog_clks", "longest"), [(15_000_000, 0.05), (0, 1 / 3)])
def test_a_sign_of_life_comes_in_time(
    quiet: Device, monkeypatch: pytest.MonkeyPatch, watchdog_clks: int, longest: float
) -> None:
    """Never a third of the watchdog without a command, and none where others go out as often."""
    quiet.write("laser_watchdog_clks", watchdog_clks)
    pulse, signs = Pulse(5.0), [0.0]
    monkeypatch.setattr(device_module, "time", pulse)
    monkeypatch.setattr(transport_module, "time", pulse)
    monkeypatch.setattr(quiet, "_closing", pulse)
    ping = quiet.ping

    def sign() -> float:
        signs.append(pulse.now)
        return ping()

    monkeypatch.setattr(quiet, "ping", sign)
    quiet.read("uptime")
    quiet._live()
    gaps = np.diff([*signs, pulse.end])
    assert gaps.max() <= longest + 1e-9
    assert gaps[:-1].min() >= 0.75 * longest - 1e-9
    assert quiet.alive_errors == 0

    wait = pulse.wait

    def busy(timeout: float | None = None) -> bool:
        quiet.read("uptime")
        return wait(timeout)

    monkeypatch.setattr(pulse, "wait", busy)
    pulse.end, count = 10.0, len(signs)
    quiet._live()
    assert len(signs) == count


def test_signs_of_life_are_sent_until_it_is_closed(board: FakeBoard) -> None:
    with connected(board) as device:
        device.write("laser_watchdog_clks", 15_000_000)  # 0.15 s
        before = board.executed[link_pkg.COMMAND_PING]
        while board.executed[link_pkg.COMMAND_PING] < before + 3:
            time.sleep(0.01)
        pulse = device._pulse
        assert pulse is not None and pulse.is_alive()
    assert not pulse.is_alive()


# ---- points ----


@pytest.mark.parametrize("form", Form)
@pytest.mark.parametrize("step", [1, 7])
def test_points_are_those_of_the_board(
    device: Device, board: FakeBoard, form: Form, step: int
) -> None:
    device.write("line_enable", 1)
    parts = []
    with device.stream(form, step) as stream:
        for part in stream:
            parts.append(part)
            if sum(map(len, parts)) >= 300:
                stream.stop()
    found = np.concatenate(parts)
    assert len(found) == stream.account.records >= 300
    assert str(stream.account).endswith(" 0 bad frames")
    assert stream.account.lost == stream.account.disordered == 0
    lines = found["line"].astype(np.int64)
    assert np.all(np.diff(lines) == step)
    want = board.made[lines % len(board.made)].copy()
    want["line"] = lines
    if form is not Form.FULL:
        want = records.space(want) if form is Form.SPACE else records.compact(want)
    for name in want.dtype.names or ():
        assert np.array_equal(found[name], want[name]), name


def test_lines_that_are_missing_are_counted(device: Device, board: FakeBoard) -> None:
    device.write("line_enable", 1)
    with device.stream() as stream:
        first = stream.get(TIMEOUT_S)
        assert first is not None
        begin = int(first["line"][-1]) + 200
        board.silent_lines = {begin, begin + 1, begin + 7}
        while stream.account.records < 600:
            stream.get(TIMEOUT_S)
    assert stream.account.missing == stream.account.lost == 3
    assert stream.account.packets_lost == stream.account.dropped == 0


def test_what_a_bad_line_loses_is_counted(device: Device, board: FakeBoard) -> None:
    device.write("line_enable", 1)
    parts = []
    with device.stream() as stream:
        while stream.account.records < 300:
            parts.append(stream.get(TIMEOUT_S))
        board.faults.flip = 0.0005
        while stream.account.records < 1500:
            parts.append(stream.get(TIMEOUT_S))
        board.faults.flip = 0.0
        end = stream.account.records + 100
        while stream.account.records < end:
            parts.append(stream.get(TIMEOUT_S))
        stream.stop()
        parts.append(stream.get(0.0))
    lines = np.concatenate([part for part in parts if part is not None])["line"].astype(np.int64)
    gaps = int((np.diff(lines) - 1).sum())
    account = stream.account
    assert account.missing == gaps > 0
    assert account.packets_lost > 0
    assert account.bad_frames >= account.packets_lost
    assert account.lost == gaps


def test_what_the_board_drops_is_counted(device: Device, board: FakeBoard) -> None:
    device.write("line_enable", 1)
    board.room = 2
    with device.stream() as stream:
        while stream.account.records < 600:
            stream.get(TIMEOUT_S)
        board.room = 10_000
        while stream.account.records < 1_000:  # the last of them drop none
            stream.get(TIMEOUT_S)
    assert stream.account.missing == stream.account.dropped > 0
    assert stream.account.packets_lost == 0


def test_a_slow_program_loses_points_and_is_told(device: Device) -> None:
    device.write("line_enable", 1)
    with device.stream(depth=60) as stream:
        while stream.account.records < 400:
            time.sleep(0.01)
        found = stream.get(0.0)
    assert found is not None
    assert len(found) <= 60
    assert stream.account.overflow >= 340
    assert stream.account.lost == stream.account.overflow


def test_one_stream_at_a_time(device: Device) -> None:
    with device.stream(), pytest.raises(LinkError, match="already being sent"):
        device.stream()
    with device.stream():
        pass
    with pytest.raises(InputError, match="step"):
        device.stream(step=0)


def test_commands_while_points_come(device: Device) -> None:
    device.write("line_enable", 1)
    with device.stream() as stream:
        for k in range(200):
            device.write("scratch", k)
            assert device.read("scratch") == k
        assert stream.account.records > 0
    assert stream.account.lost == 0


def account_of(packets: list[tuple[int, int, int, int]], step: int) -> PointStream:
    """Return a stream that has taken packets of (sequence, first, count, dropped)."""
    stream = PointStream(
        form=Form.FULL, step=step, stop=lambda: None, bad_frames=lambda: 0, check=lambda: None
    )
    stream.begin()
    for sequence, first, count, dropped in packets:
        found = np.zeros(count, records.FULL)
        found["line"] = (first + step * np.arange(count)) % (1 << 32)
        stream.take(
            Batch(sequence % 256, Form.FULL, step, first % (1 << 32), dropped % 65536, found)
        )
    return stream


@given(
    step=st.integers(1, 255),
    first=st.integers(0, (1 << 32) - 1),
    seed=st.integers(0, 1 << 30),
    lost=st.floats(0.0, 0.5),
)
@settings(deadline=None, max_examples=25)
def test_the_account_is_right_whatever_is_lost(
    step: int, first: int, seed: int, lost: float
) -> None:
    draw = np.random.default_rng(seed)
    line, dropped, sequence = first, 0, 0
    sent, kept, missing, open_gap, packets_lost = [], 0, 0, 0, 0
    for k in range(300):
        gone = int(draw.integers(0, 5)) if draw.random() < 0.1 else 0  # dropped by the board
        line, dropped = line + step * gone, dropped + gone
        open_gap += gone
        count = int(draw.integers(1, 4))
        arrives = k in (0, 299) or draw.random() >= lost
        if arrives:
            sent.append((sequence, line, count, dropped))
            missing, kept, open_gap = missing + (open_gap if kept else 0), kept + count, 0
        else:
            open_gap += count
            packets_lost += 1
        line, sequence = line + step * count, sequence + 1
    # More than 255 packets on end cannot be told from none.
    account = account_of(sent, step).account
    assert (account.records, account.missing, account.dropped) == (kept, missing, dropped)
    assert account.packets_lost == packets_lost
    assert account.restarts == account.disordered == account.overflow == 0


def test_a_record_in_the_wrong_place_is_noticed() -> None:
    stream = account_of([(0, 10, 3, 0)], 1)
    found = np.zeros(2, records.FULL)
    found["line"] = [13, 15]
    stream.take(Batch(1, True, 1, 13, 0, found))
    assert stream.account.disordered == 1
    stream.take(Batch(2, True, 1, 3, 0, found[:0]))
    assert stream.account.restarts == 1


# ---- raw lines ----


def test_raw_lines_are_those_of_the_board(device: Device, board: FakeBoard) -> None:
    device.write("line_enable", 1)
    for _ in range(3):
        got = device.capture()
        place = got.line % len(board.made)
        assert np.array_equal(got.pixels, board.pixels[place % len(board.pixels)])
        assert got.record is not None
        want = board.made[place : place + 1].copy()
        want["line"] = got.line
        assert np.array_equal(got.record, want)
    device.write("line_enable", 0)
    wanted = board._line + 200
    with device.captured(link_pkg.CAPTURE_LINE, wanted) as lines:
        device.write("line_enable", 1)
        line = lines.get(4 * TIMEOUT_S)
    assert line is not None and line.line == wanted
    assert np.array_equal(line.pixels, board.pixels[wanted % len(board.made) % len(board.pixels)])
    with device.captured(link_pkg.CAPTURE_EVERY, 10) as lines:
        found = [lines.get(TIMEOUT_S) for _ in range(5)]
    assert [each.line % 10 for each in found if each is not None] == [0] * 5


def test_a_line_that_did_not_come_whole_is_asked_for_again(
    device: Device, board: FakeBoard
) -> None:
    device.write("line_enable", 1)
    device.timeout = 0.4
    board.faults.flip = 0.0005
    for _ in range(8):
        got = device.capture(timeout=10.0)
        place = got.line % len(board.made)
        assert np.array_equal(got.pixels, board.pixels[place % len(board.pixels)])
    board.faults.flip = 0.0
    device.capture()


def test_no_line_comes(device: Device) -> None:
    with pytest.raises(NoAnswerError, match=r"no line came within 0\.3 s"):
        device.capture(timeout=0.3)
    device.write("line_enable", 1)
    device.capture()  # the one before does not wait any more


def test_points_and_lines_at_once(device: Device) -> None:
    device.write("line_enable", 1)
    with device.stream(False, 20) as stream, device.captured(link_pkg.CAPTURE_EVERY, 50) as lines:
        for _ in range(5):
            assert lines.get(TIMEOUT_S) is not None
    assert stream.account.records > 0


# ---- rate ----


def test_rates_that_cannot_be(device: Device) -> None:
    for rate in (0, -1, 100, 12_500_001, 100_000_000):
        with pytest.raises(InputError, match="baud"):
            device.set_baud(rate)
    assert device.baud == 3_000_000


def test_a_rate_that_is_heard(device: Device, board: FakeBoard) -> None:
    device.set_baud(1_000_000)
    assert device.baud == 1_000_000
    assert board.file.values["uart_step"] == [round(1e6 * 2**24 / 100e6)]
    device.ping()


def test_a_rate_that_is_not_heard_is_taken_back(
    board: FakeBoard, monkeypatch: pytest.MonkeyPatch
) -> None:
    with connected(board) as device:
        send = device._transport.send

        def deaf(data: bytes) -> None:  # the board has its default rate again, say
            if device.baud == 3_000_000:
                send(data)

        monkeypatch.setattr(device._transport, "send", deaf)
        with pytest.raises(LinkError, match="nothing is heard at 500000 baud"):
            device.set_baud(500_000)
        assert device.baud == 3_000_000
        device.ping()

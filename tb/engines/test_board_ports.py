"""The virtual board's own parts: its serial port, as a host sees it, and its sensor's lines.

They run on ``loopback``, which echoes bytes and sends a line of the sensor for each digit.
"""

import contextlib
import itertools
import os
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from harness import generator
from port_host import BAUD, Host
from run_command import ended

from vrscan.data.config import Config
from vrscan.data.errors import InputError
from vrscan.engines.board import Process, status_file
from vrscan.engines.tools import build_folder, repository_root
from vrscan.engines.verilated import build_program
from vrscan.scene import library as lines
from vrscan.scene.description import load
from vrscan.scene.sensor import bloom, expose_pixels

CLOCK_HZ = 10_000_000
EXPOSURE_CLKS, PULSE_CLKS = 300, 16
ANGLE_RAD = 0.05
SCENE = "default"
CONFIG = Config.model_validate({"line": {"pulse_us": 1.6}})  # PULSE_CLKS
PIXELS = CONFIG.sensor.line_length


def program() -> Path:
    folder = repository_root() / "tb" / "board"
    parameters = {
        "ClockHz": CLOCK_HZ,
        "Baud": BAUD,
        "LineLength": PIXELS,
        "PixelWidth": CONFIG.sensor.pixel_width,
        "ExposureClks": EXPOSURE_CLKS,
        "PulseClks": PULSE_CLKS,
        "AngleRad": ANGLE_RAD,
    }
    return build_program(folder / "loopback.sv", parameters, folder / "main.cpp")


def words(port: Path, *more: str) -> list[str]:
    made = lines.library(load(SCENE), CONFIG, build_folder() / "board")
    begin = [str(program()), "--library", str(made), "--port", str(port)]
    return [*begin, "--status", str(status_file(port)), "--clock-hz", str(CLOCK_HZ), *more]


@pytest.fixture
def board(tmp_path: Path) -> Iterator[Process]:
    port = tmp_path / "port"
    with Process(words(port), port) as running:
        yield running


def no_digits(count: int, salt: int) -> bytes:
    data = generator(salt).integers(0, 256, 2 * count).astype(np.uint8)
    return bytes(data[(data < 0x30) | (data > 0x39)][:count])


def test_every_byte_comes_back_in_order_while_the_board_sets_the_pace(board: Process) -> None:
    data = no_digits(20_000, 1)
    with Host(board.port) as host:
        before = board.clocks()
        assert host.ask(data) == data
        time.sleep(0.1)
        taken = board.clocks() - before
    status = board.status()
    assert (status.from_host, status.to_host, status.dropped) == (len(data), len(data), 0)
    assert status.baud == BAUD and status.opened == 1
    # Ten bits a byte: a host cannot be faster than its line.
    assert taken >= len(data) * 10 * CLOCK_HZ // BAUD


def test_a_host_that_writes_faster_has_to_wait(board: Process) -> None:
    """The pty fills up, and what is in it goes at the line's own rate, by the board's clocks."""
    a_byte = 10 * CLOCK_HZ // BAUD  # clocks
    with Host(board.port) as host:
        os.set_blocking(host.file, False)
        sent, begin = 0, board.status()
        with contextlib.suppress(BlockingIOError):
            while True:
                sent += os.write(host.file, bytes(1000))
                assert sent < begin.from_host + 100_000
        seen = [board.status()]  # now and then, of while there is something to take
        while seen[-1].from_host < sent:
            time.sleep(0.001)
            seen.append(board.status())
    for now in seen:
        assert now.from_host <= (now.clocks - begin.clocks) / a_byte + 1, (begin, now)
    busy = [now for now in seen if 0 < now.from_host < sent]
    for first, last in itertools.pairwise(busy):
        taken = last.from_host - first.from_host
        assert abs(taken - (last.clocks - first.clocks) / a_byte) <= 2, (first, last)
    print(f"{sent} bytes, {len({now.clocks for now in busy})} looks at them")


@pytest.mark.parametrize("off", [-0.02, 0.02])
def test_any_rate_of_the_host_is_taken(board: Process, off: float) -> None:
    data = no_digits(500, 2)
    with Host(board.port, round((1 + off) * BAUD)) as host:
        assert host.ask(data) == data
        assert board.status().baud == round((1 + off) * BAUD)


def test_another_rate_than_the_boards_is_not_understood_until_it_is_the_same(
    board: Process,
) -> None:
    data = no_digits(200, 3)
    with Host(board.port, BAUD // 2) as host:
        assert host.ask(data, seconds=1.0) != data
        host.rate(BAUD)
        host.read(1 << 20, seconds=0.5)
        assert host.ask(data) == data


def test_a_new_rate_waits_for_the_bytes_that_the_adapter_has(tmp_path: Path) -> None:
    port, data = tmp_path / "port", no_digits(24, 4)
    # So slow that there is time to change it: ten bits are 10 ms.
    slow = words(port, "--clock-hz", "10000", "--real-time")
    with Process(slow, port) as board, Host(port, 1000) as host:
        os.write(host.file, data)
        while board.status().from_host < 2:
            time.sleep(0.01)
        host.rate(2000)
        while (status := board.status()).baud == 1000:
            assert board.running
            time.sleep(0.01)
        assert status.from_host == len(data)
        # The last echo is still on its way when the rate changes.
        assert host.read(len(data) - 2) == data[:-2]


def test_a_zero_at_a_tenth_of_the_rate_is_a_break(board: Process) -> None:
    with Host(board.port) as host:
        assert host.ask(b"x") == b"x"
        host.rate(BAUD // 10)
        os.write(host.file, b"\0")
        while board.status().from_host < 2:  # until it is on the line
            time.sleep(0.01)
        host.rate(BAUD)
        assert host.ask(b"yz") == b"Bz"


def test_who_opens_the_port_again_finds_nothing_of_before(board: Process) -> None:
    with Host(board.port) as host:
        for _ in range(10):  # more than the pty's first buffer holds
            os.write(host.file, b"5")
            board.wait(CLOCK_HZ // 20)
    time.sleep(0.2)
    status = board.status()
    assert status.to_host + status.dropped == 20 * PIXELS and status.to_host > 10_000
    with Host(board.port) as host:
        assert host.read(1, seconds=0.3) == b""
        assert host.ask(b"again") == b"again"
    assert board.status().opened == 2


def test_what_comes_while_nobody_listens_is_lost(board: Process) -> None:
    with Host(board.port) as host:
        os.write(host.file, b"5")
        assert len(host.read(100)) == 100
    board.wait(CLOCK_HZ // 10)
    status = board.status()
    assert not status.open and status.unheard > 0
    assert status.unheard + status.to_host + status.dropped == 2 * PIXELS
    with Host(board.port) as host:
        assert host.ask(b"again") == b"again"


def test_bytes_that_the_host_does_not_read_are_dropped_and_counted(board: Process) -> None:
    with Host(board.port) as host:
        for _ in range(40):
            os.write(host.file, b"5")
            board.wait(CLOCK_HZ // 20)
        status = board.status()
        assert status.dropped > 0
        assert status.to_host + status.dropped == 40 * 2 * PIXELS
        kept = host.read(status.to_host)
        assert len(kept) == status.to_host
        assert host.ask(b"again") == b"again"


def expected(digits: bytes) -> np.ndarray:
    """Return the lines that the board's sensor makes, by the simulator's own functions."""
    made = lines.renderer(load(SCENE), CONFIG)
    turned = lines.angles(CONFIG)
    shutter = np.float32(EXPOSURE_CLKS / CLOCK_HZ / made.light.exposure_s)
    found = []
    for number, digit in enumerate(digits):
        value = digit - ord("0")
        place = ((value - 4.5) * ANGLE_RAD - turned[0]) / (turned[1] - turned[0])
        row = int(place)
        charge = made.charge(lines.at_angles(turned[row : row + 2], CONFIG.mirror))
        low, high = charge.laser_e
        level = np.float32((value * PULSE_CLKS // 8) / PULSE_CLKS)
        laser = level * (low + np.float32(place - row) * (high - low))
        mean = bloom((shutter * charge.other_e + laser)[None], made.light.scene.sensor)
        noise = lines.words(made.light.scene.seed, number, PIXELS)[None]
        offset = shutter * charge.other_offset_e + charge.offset_e
        found.append(expose_pixels(noise, mean, made.readout, offset)[0])
    return np.array(found)


def test_lines_are_those_of_the_simulator_bit_for_bit(board: Process) -> None:
    digits = b"3456789320"
    with Host(board.port) as host:
        got = []
        for digit in digits:
            os.write(host.file, bytes([digit]))
            got.append(np.frombuffer(host.read(2 * PIXELS), "<u2"))
    want = expected(digits)
    top = (1 << CONFIG.sensor.pixel_width) - 1
    assert (want.max(axis=1) > 300).sum() >= 6 and (want == top).any()
    for k in range(len(digits)):
        differs = np.flatnonzero(got[k] != want[k])
        assert len(differs) == 0, (k, differs[:5], got[k][differs[:5]], want[k][differs[:5]])
    assert board.status().lines == len(digits)


def test_an_exposure_during_the_readout_is_lost_and_counted(board: Process) -> None:
    with Host(board.port) as host:
        os.write(host.file, b"5......5")  # 700 clocks apart
        assert len(host.read(2 * PIXELS)) == 2 * PIXELS
    board.wait(CLOCK_HZ // 10)
    assert (board.status().lines, board.status().lines_lost) == (1, 1)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_it_cleanly(board: Process, number: int) -> None:
    assert board.port.is_symlink()
    board.signal(number)
    assert board.stop() == 0
    assert not board.port.is_symlink()
    assert "M clocks/s, real time /" in board.log()


def test_a_port_has_one_board(board: Process) -> None:
    second = subprocess.run(words(board.port), capture_output=True, text=True, check=False)
    assert second.returncode == 2
    assert "another board has this port" in second.stderr
    assert board.running and board.port.is_symlink()


def test_it_stops_after_the_simulated_time(tmp_path: Path) -> None:
    port = tmp_path / "port"
    with Process(words(port, "--seconds", "0.0123457"), port) as running:
        while running.running:
            time.sleep(0.01)
        assert running.stop() == 0
        assert running.clocks() == round(0.0123457 * CLOCK_HZ)


def test_in_real_time_it_is_no_faster(tmp_path: Path) -> None:
    port = tmp_path / "port"
    begin = time.monotonic()
    with Process(words(port, "--seconds", "0.5", "--real-time"), port) as running:
        while running.running:
            time.sleep(0.01)
    assert time.monotonic() - begin >= 0.5


def test_a_library_that_is_none_is_refused(tmp_path: Path) -> None:
    broken = tmp_path / "library.bin"
    broken.write_bytes(b"angles 3\n".ljust(4096, b"\0"))
    port = tmp_path / "port"
    given = words(port)
    given[given.index("--library") + 1] = str(broken)
    with pytest.raises(InputError, match=r"library\.bin: no "), Process(given, port):
        pass


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (["nosuch"], "nosuch: no such scene"),
        (["--seconds", "-1"], "--seconds: must be"),
        (["--clock-hz", "nan"], "--clock-hz: must be"),
    ],
)
def test_bad_input_is_one_line(
    given: list[str],
    said: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert ended(monkeypatch, "board", *given) == 2
    told = capsys.readouterr().err
    assert said in told and told.count("\n") == 1

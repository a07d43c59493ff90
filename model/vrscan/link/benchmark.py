"""Measurement of a link's speed: round trips of commands, registers, points."""

import time
from collections.abc import Callable, Sequence

import numpy as np

from vrscan.data import link_pkg
from vrscan.data.records import Form
from vrscan.link import selftest
from vrscan.link.device import BITS_A_BYTE, Device
from vrscan.link.link_report import Rate, Trips
from vrscan.registers.register_map import REGISTERS, WINDOWS
from vrscan.registers.values import Block, integer

Progress = Callable[[int, int, str], None]


def round_trips(device: Device, count: int, progress: Progress) -> list[Trips]:
    """Return the times of pings, and of the shortest and longest reads and writes.

    Args:
        device: The board. Its registers keep their values.
        count: Number of round trips of each kind.
        progress: Called with the number of steps done, the number of all steps, and their name.
    """
    most = link_pkg.MAX_WORDS
    table = next(iter(WINDOWS.values())).address
    scratch = Block(REGISTERS["scratch"].address, [integer(device.read("scratch"))])
    kinds: list[tuple[str, int, Callable[[], object]]] = [
        ("ping", 0, lambda: device.ping(b"")),
        ("ping of 250 bytes", 0, lambda: device.ping(bytes(250))),
        ("read of 1 word", 1, lambda: device.read_words(0, 1)),
        (f"read of {most} words", most, lambda: device.read_words(table, most)),
        ("write of 1 word", 1, lambda: device.write_words(scratch)),
    ]
    found = []
    for what, words, act in kinds:
        seconds = []
        clocks = device.uptime()
        for k in range(count):
            start = time.perf_counter()
            act()
            seconds.append(time.perf_counter() - start)
            progress(k + 1, count, what)
        clocks = device.uptime() - clocks
        # Reading the board's clocks takes about one more.
        board_s = clocks * count / (count + 1) / device.build.clock_hz
        found.append(Trips(what, np.array(seconds), board_s, words))
    return found


def streams(device: Device, bauds: Sequence[int], seconds: float, progress: Progress) -> list[Rate]:
    """Return the number of points that come at each rate, for test lines without a gap.

    Args:
        device: The board. Its lines have to stand still; all changed registers are restored.
        bauds: Rates to try.
        seconds: Duration of each stream, by this machine's clock.
        progress: Called with the number of steps done, the number of all steps, and their name.
    """
    settings = selftest.runs(device.build.line_length)["moving peak"]
    present = device.baud
    found = []
    with selftest.arranged(device):
        selftest.arrange(device, settings, lines=0)
        try:
            for k, baud in enumerate(bauds):
                if baud != device.baud:
                    device.set_baud(baud)
                for j, form in enumerate(Form):
                    text = f"{baud} baud, {form.name.lower()}"
                    progress(len(Form) * k + j, len(Form) * len(bauds), text)
                    found.append(_stream(device, form, seconds))
        finally:
            if device.baud != present:
                device.set_baud(present)
    return found


def _stream(device: Device, form: Form, seconds: float) -> Rate:
    """Return the number of points that come at the present rate."""
    come = 0
    with device.stream(form) as points:
        device.write("test_start", 1)
        try:
            points.get(device.timeout)  # waits until the stream runs
            clocks, start = device.uptime(), time.perf_counter()
            bytes_in = device.traffic.bytes_in
            while time.perf_counter() - start < seconds:
                part = points.get(0.05)
                come += 0 if part is None else len(part)
            bytes_in = device.traffic.bytes_in - bytes_in
            clocks, spent = device.uptime() - clocks, time.perf_counter() - start
        finally:
            device.write("test_stop", 1)
    board_s = clocks / device.build.clock_hz
    line_s = bytes_in * BITS_A_BYTE / device.baud
    return Rate(device.baud, form, come, spent, board_s, line_s / board_s if board_s else 0.0)

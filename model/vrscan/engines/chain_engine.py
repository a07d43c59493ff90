"""The Verilated ``vrscan_chain`` as an engine: built once for each state of the sources."""

import ctypes
from collections.abc import Callable
from pathlib import Path

import numpy as np

from vrscan.data import pkg
from vrscan.data.arrays import Ints, Pixels
from vrscan.data.contract import checked_words
from vrscan.data.points import Points
from vrscan.engines import verilated
from vrscan.engines.tools import hardware_root, rtl_module
from vrscan.fixed.vrscan_chain import MAX_WINDOW, latency, min_period
from vrscan.registers.chain_registers import Registers

# Configuration ports, in the order in which the engine takes them, with the fields of Registers.
CONFIGURATION = (
    "period_n", "window_two_pass", "noise_row", "k_noise", "k_height", "snr_min", "min_width",
    "max_width", "kappa", "c_obj_gain", "c_sfm_gain", "centre", "k1", "k2", "even",
    "n0", "n1", "d0", "d1", "e0", "e1",
)  # fmt: skip
# Result ports, in the order in which the engine gives them: the fields of Points.
RESULTS = (
    "line", "flags", "left", "right", "width", "maximum", "row_mean", "row_variance", "background",
    "noise", "snr", "position", "sigma", "angle", "x", "z", "sigma_z", "c_obj", "c_sfm", "measured",
)  # fmt: skip
_CHUNK = 128  # lines between two calls of ``progress``


def _position_bits(line_length: int) -> int:
    return (line_length - 1).bit_length() + 1


def _configuration_widths(line_length: int) -> dict[str, int]:
    """Return the bits of the configuration ports that can be negative."""
    geometry = dict.fromkeys(("n0", "n1", "d0", "d1", "e0", "e1"), pkg.GEOMETRY_WIDTH)
    return geometry | {
        "centre": _position_bits(line_length) + pkg.OFFSET_FRACTION,
        "k1": pkg.DISTORTION_WIDTH,
        "k2": pkg.DISTORTION_WIDTH,
    }


def _result_widths(line_length: int) -> dict[str, int]:
    """Return the bits of the signed result ports."""
    return {
        "position": _position_bits(line_length) + pkg.POSITION_FRACTION,
        "angle": pkg.ANGLE_WIDTH,
        "x": pkg.LENGTH_WIDTH,
        "z": pkg.LENGTH_WIDTH,
    }


def build(line_length: int, pixel_width: int, max_window: int) -> Path:
    """Return the shared object of an elaboration; it is built if the sources have changed.

    Raises:
        InputError: if a tool is missing or fails.
    """
    parameters = {"LineLength": line_length, "PixelWidth": pixel_width, "MaxWindow": max_window}
    ports = (
        "#define CONFIGURATION(X) " + " ".join(f"X({name})" for name in CONFIGURATION) + "\n"
        "#define RESULTS(X) " + " ".join(f"X({name})" for name in RESULTS) + "\n"
    )
    harness = hardware_root() / "tb" / "engine" / "engine.cpp"
    return verilated.build(
        "chain", harness, ports, [verilated.Design(rtl_module("vrscan_chain"), parameters)]
    )


def _signed(values: Ints, width: int) -> Ints:
    sign = 1 << (width - 1)
    return ((values & (2 * sign - 1)) ^ sign) - sign


def _run(
    lines: Pixels,
    angle: Ints,
    power: Ints,
    registers: Registers,
    progress: Callable[[int], None] | None,
    mirror_flags: Ints | int,
    max_window: int,
) -> tuple[Points, Ints]:
    """Return the points, and the clocks from each line's last pixel to its point."""
    length = registers.line_length
    lines, angle, power, raised = checked_words(
        lines, angle, power, mirror_flags, line_length=length, pixel_width=registers.pixel_width
    )
    library = ctypes.CDLL(str(build(length, registers.pixel_width, max_window)))
    library.engine_create.restype = ctypes.c_void_p
    library.engine_run.restype = ctypes.c_int64
    widths = _configuration_widths(length)
    words = [int(getattr(registers, name)) for name in CONFIGURATION]
    words = [w & ((1 << widths.get(n, 64)) - 1) for n, w in zip(CONFIGURATION, words, strict=True)]
    pixels = np.ascontiguousarray(lines, np.uint16)
    turns = (np.asarray(angle, np.int64) & ((1 << pkg.ANGLE_WIDTH) - 1)).astype(np.uint32)
    powers = np.ascontiguousarray(power, np.uint16)
    raised_bytes = np.ascontiguousarray(raised, np.uint8)
    results = np.zeros((len(lines), len(RESULTS) + 1), np.int64)
    longest = latency(
        max_window,
        measured=True,
        line_length=length,
        pixel_width=registers.pixel_width,
        max_window=max_window,
        first_width=max_window if registers.window_two_pass else None,
    )

    # Lines follow each other as closely as the chain takes them.
    two_pass = registers.window_two_pass
    gap = max(0, min_period(length, max_window, two_pass=two_pass) - length)

    def address(array: np.ndarray[tuple[int, ...], np.dtype[np.generic]]) -> ctypes.c_void_p:
        return ctypes.c_void_p(array.ctypes.data)

    handle = ctypes.c_void_p(library.engine_create((ctypes.c_uint64 * len(words))(*words)))
    received = 0
    try:
        for start in range(0, len(lines), _CHUNK):
            part = slice(start, min(start + _CHUNK, len(lines)))
            room = results[received:]
            received += library.engine_run(
                handle,
                address(pixels[part]),
                address(turns[part]),
                address(powers[part]),
                address(raised_bytes[part]),
                ctypes.c_int64(part.stop - part.start),
                ctypes.c_int64(length),
                ctypes.c_int64(gap),
                ctypes.c_int64(longest + 1 if part.stop == len(lines) else 0),
                address(room),
                ctypes.c_int64(len(room)),
            )
            if progress is not None:
                progress(part.stop)
    finally:
        library.engine_destroy(handle)
    if received != len(lines) or not np.array_equal(results[:, 0], np.arange(len(lines))):
        raise RuntimeError(f"rtl engine: {received} points for {len(lines)} lines")
    signed = _result_widths(length)
    columns = {
        name: _signed(results[:, k], signed[name]) if name in signed else results[:, k].copy()
        for k, name in enumerate(RESULTS)
    }
    measured = columns.pop("measured").astype(np.bool_)
    points = Points(**columns, measured=measured, pixel_width=registers.pixel_width)
    return points, results[:, -1] - (np.arange(len(lines)) * (length + gap) + length - 1)


def run_rtl(
    lines: Pixels,
    angle: Ints,
    power: Ints,
    registers: Registers,
    progress: Callable[[int], None] | None = None,
    *,
    mirror_flags: Ints | int = 0,
    max_window: int = MAX_WINDOW,
) -> Points:
    """Return the point of every line from the RTL.

    Lines follow without a gap, or with the shortest gap that their length needs.

    Args:
        lines: Pixels, uint16 [n, registers.line_length].
        angle: Scan angles, fractions of a turn as 24-bit signed integers, [n].
        power: Laser powers, u16, [n].
        registers: The configuration; ``pixel_width`` and ``line_length`` are elaborated.
        progress: Called with the number of lines sent so far.
        mirror_flags: Flags of the mirror from bit 0, NOT_RUNNING, upwards; 0..7, [n] or one for
            all.
        max_window: ``MaxWindow`` of the elaboration.

    Returns:
        n points, numbered from 0.

    Raises:
        InputError: if the engine cannot be built.
        ValueError: a ``LinesError``, if ``vrscan.data.contract.checked_words`` refuses an argument.
        RuntimeError: if the RTL does not answer every line, in order.
    """
    return _run(lines, angle, power, registers, progress, mirror_flags, max_window)[0]


def latencies(
    lines: Pixels,
    angle: Ints,
    power: Ints,
    registers: Registers,
    *,
    max_window: int = MAX_WINDOW,
) -> Ints:
    """Return the clocks from each line's last pixel to its point, int64 [n]; see ``run_rtl``."""
    return _run(lines, angle, power, registers, None, 0, max_window)[1]

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
from vrscan.registers.map_table import MapTable
from vrscan.registers.structs import POINT, Words, package_struct, register_struct

# What the engine gives of a point: the fields of Points.
RESULTS = (
    "line", "flags", "left", "right", "width", "maximum", "row_mean", "row_variance", "background",
    "noise", "snr", "position", "sigma", "doubt", "angle", "x", "z", "sigma_z", "c_obj", "c_sfm",
    "free_from", "free_to", "measured",
)  # fmt: skip
_LINE, _POINT = package_struct("line_t"), package_struct("point_t")
_PEAK, _GEOMETRY = register_struct("peak_t"), register_struct("geometry_t")
_MAP, _MAP_TABLE = register_struct("map_t"), register_struct("map_table_t")
_FREE, _FREE_TABLE = register_struct("free_t"), register_struct("free_table_t")
_CHUNK = 128  # lines between two calls of ``progress``


def build(line_length: int, pixel_width: int, max_window: int) -> Path:
    """Return the shared object of an elaboration; it is built if the sources have changed.

    Raises:
        InputError: if a tool is missing or fails.
    """
    parameters = {"LineLength": line_length, "PixelWidth": pixel_width, "MaxWindow": max_window}
    ports = "".join(
        f"#define {name}_WORDS {struct.words}\n"
        for name, struct in zip(
            ("LINE", "POINT", "PEAK", "GEOMETRY"),
            (_LINE, _POINT, _PEAK, _GEOMETRY),
            strict=True,
        )
    )
    harness = hardware_root() / "tb" / "engine" / "engine.cpp"
    return verilated.build(
        "chain", harness, ports, [verilated.Design(rtl_module("vrscan_chain"), parameters)]
    )


def _run(
    lines: Pixels,
    angle: Ints,
    power: Ints,
    registers: Registers,
    progress: Callable[[int], None] | None,
    mirror_flags: Ints | int,
    max_window: int,
    maps: MapTable | None = None,
    lens: Ints | None = None,
) -> tuple[Points, Ints]:
    """Return the points, and the clocks from each line's last pixel to its point."""
    length = registers.line_length
    lines, angle, power, raised = checked_words(
        lines, angle, power, mirror_flags, line_length=length, pixel_width=registers.pixel_width
    )
    library = ctypes.CDLL(str(build(length, registers.pixel_width, max_window)))
    library.engine_create.restype = ctypes.c_void_p
    library.engine_run.restype = ctypes.c_int64
    configuration = [
        word for struct in (_PEAK, _GEOMETRY, _FREE) for word in struct.as_words(registers)
    ]
    entries = np.arange(len(registers.free_table_from))
    table = _FREE_TABLE.pack_rows(
        {
            "free_table_write": np.ones(len(entries), np.int64),
            "free_table_index": entries,
            "free_table_from": np.array(registers.free_table_from),
            "free_table_to": np.array(registers.free_table_to),
        }
    )
    configuration += _map_words(maps, follow=lens is not None)
    nodes = _map_rows(maps)
    pixels = np.ascontiguousarray(lines, np.uint16)
    own = {"angle": angle, "power": power, "mirror_flags": raised}
    belongs = _LINE.pack_rows(own if lens is None else own | {"lens": lens})
    clocks = np.zeros(len(lines), np.int64)
    results = np.zeros((len(lines), _POINT.words), np.uint32)
    longest = latency(
        max_window,
        measured=True,
        line_length=length,
        pixel_width=registers.pixel_width,
        max_window=max_window,
        first_width=max_window if registers.window_two_pass else None,
        fit=registers.window_fit,
        mapped=maps is not None,
    )
    if registers.window_fit:  # the last point waits for a line that does not come
        longest += pkg.NEIGHBOUR_CLKS

    # Lines follow each other as closely as the chain takes them.
    two_pass, fit = registers.window_two_pass, registers.window_fit
    gap = max(0, min_period(length, max_window, two_pass=two_pass, fit=fit) - length)

    def address(array: np.ndarray[tuple[int, ...], np.dtype[np.generic]]) -> ctypes.c_void_p:
        return ctypes.c_void_p(array.ctypes.data)

    handle = ctypes.c_void_p(
        library.engine_create(
            (ctypes.c_uint32 * len(configuration))(*configuration),
            address(table),
            ctypes.c_int64(len(table)),
            address(nodes),
            ctypes.c_int64(len(nodes)),
        )
    )
    received = 0
    try:
        for start in range(0, len(lines), _CHUNK):
            part = slice(start, min(start + _CHUNK, len(lines)))
            room, times = results[received:], clocks[received:]
            received += library.engine_run(
                handle,
                address(pixels[part]),
                address(belongs[part]),
                ctypes.c_int64(part.stop - part.start),
                ctypes.c_int64(length),
                ctypes.c_int64(gap),
                ctypes.c_int64(longest + 1 if part.stop == len(lines) else 0),
                address(room),
                address(times),
                ctypes.c_int64(len(room)),
            )
            if progress is not None:
                progress(part.stop)
    finally:
        library.engine_destroy(handle)
    columns = {name: _POINT.column(results, POINT.get(name, name)) for name in RESULTS}
    if received != len(lines) or not np.array_equal(columns["line"], np.arange(len(lines))):
        raise RuntimeError(f"rtl engine: {received} points for {len(lines)} lines")
    measured = columns.pop("measured").astype(np.bool_)
    points = Points(
        **columns,
        measured=measured,
        pixel_width=registers.pixel_width,
        unit_mm=registers.length_unit,
    )
    return points, clocks - (np.arange(len(lines)) * (length + gap) + length - 1)


def _map_words(maps: MapTable | None, *, follow: bool) -> list[int]:
    """Return the settings of the maps, which may follow the lens's position of each line."""
    if maps is None:
        return [0] * _MAP.words
    bits = _MAP.pack(
        {
            "map_enable": 1,
            "map_count": len(maps.nodes),
            "map_begin": maps.map_begin,
            "map_shift": maps.map_shift,
            "map_follow": int(follow),
            "map_lens": maps.lens,
        }
    )
    return [bits & (1 << 32) - 1, bits >> 32]


def _map_rows(maps: MapTable | None) -> Words:
    """Return what stands on the port of the nodes in each clock, one a clock."""
    if maps is None:
        return np.zeros((0, _MAP_TABLE.words), np.uint32)
    words = maps.words
    return _MAP_TABLE.pack_rows(
        {
            "map_table_write": np.ones(len(words), np.int64),
            "map_table_index": np.arange(len(words)),
            "map_table_node": words,
        }
    )


def run_rtl(
    lines: Pixels,
    angle: Ints,
    power: Ints,
    registers: Registers,
    progress: Callable[[int], None] | None = None,
    *,
    mirror_flags: Ints | int = 0,
    max_window: int = MAX_WINDOW,
    maps: MapTable | None = None,
    lens: Ints | None = None,
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
        maps: Correction maps; None corrects nothing.
        lens: Position of the lens in each line, steps, u16 [n]; None is that of the maps.

    Returns:
        n points, numbered from 0.

    Raises:
        InputError: if the engine cannot be built.
        ValueError: a ``LinesError``, if ``vrscan.data.contract.checked_words`` refuses an argument.
        RuntimeError: if the RTL does not answer every line, in order.
    """
    return _run(lines, angle, power, registers, progress, mirror_flags, max_window, maps, lens)[0]


def latencies(lines: Pixels, angle: Ints, power: Ints, registers: Registers) -> Ints:
    """Return the clocks from each line's last pixel to its point, int64 [n]; see ``run_rtl``."""
    return _run(lines, angle, power, registers, None, 0, MAX_WINDOW)[1]

"""docs/link.md: every number and example in it against what is built."""

import binascii
import re

import numpy as np
import pytest
from bus_registers import FIRST, BusRegisters

from vrscan.clocked import bus_arbiter, register_file
from vrscan.clocked.command_server import answer, latency
from vrscan.clocked.frame_decoder import Status as FrameStatus
from vrscan.clocked.uart_link import MOST_BEFORE_REPLY
from vrscan.data import link_pkg, pkg, records
from vrscan.engines.tools import repository_root
from vrscan.link import protocol
from vrscan.link.protocol import CaptureMode, Command, Status, command
from vrscan.registers.register_map import REGISTERS

DOCUMENT = (repository_root() / "docs/link.md").read_text()
# From the executor's own clock, through the arbiter and back.
BUS_LATENCY = register_file.LATENCY - 1 + 2 * bus_arbiter.LATENCY
BAUD = 3_000_000


def rows(heading: str) -> list[list[str]]:
    """Return the cells of the table with this heading."""
    body = DOCUMENT.split(heading + "\n", 1)[1].split("\n\n", 1)[0]
    return [[cell.strip() for cell in row.strip("|").split("|")] for row in body.splitlines()[1:]]


def test_examples() -> None:
    found = re.findall(
        r"payload  ([0-9A-F ]+)\n(?:    CRC +([0-9A-F ]+)\n)? +frame +(.+)", DOCUMENT
    )
    assert len(found) == 2
    for payload, crc, coded in found:
        assert protocol.encode_frame(bytes.fromhex(payload)) == bytes.fromhex(coded)
        assert not crc or binascii.crc_hqx(bytes.fromhex(payload), 0xFFFF) == int(
            crc.replace(" ", ""), 16
        )
    assert binascii.crc_hqx(b"123456789", 0xFFFF) == 0x29B1 and "0x29B1" in DOCUMENT
    request, reply = (bytes.fromhex(payload) for payload, _, _ in found)
    identity = REGISTERS["identity"]
    assert request == command(Command.READ, 0x2A, protocol.read(identity.address, 1))
    assert protocol.words(reply).words == (identity.reset[0],)


def test_commands() -> None:
    table = {
        int(op, 0): name.strip("`")
        for op, name, *_ in rows("| op | command | data | data of the reply |")
    }
    assert table == protocol.COMMANDS


def test_modes() -> None:
    table = {
        int(mode): re.findall(r"`(\w+)`", text)[0] for mode, text in rows("| mode | captures |")
    }
    assert table == {int(mode): mode.name for mode in CaptureMode}


def test_statuses() -> None:
    table = {
        int(code): re.findall(r"`(\w+)`", text)[0] for code, text in rows("| status | means |")
    }
    assert table == {int(status): status.name for status in Status}
    faults = re.search(
        r"wrong with it: 1 CRC, 2 cut .*, 3 longer .*, 4 without .*, 5 a byte",
        DOCUMENT.replace("\n", " "),
    )
    assert faults and [*FrameStatus] == [*range(6)]
    assert [FrameStatus(k).name for k in range(1, 6)] == [
        "CRC",
        "MALFORMED",
        "TOO_LONG",
        "TOO_SHORT",
        "FRAMING",
    ]


def fields() -> list[list[tuple[int, str, str]]]:
    """Return place, name and format of the fields of both records."""
    tables = []
    for body in DOCUMENT.split("| byte | field | |\n|---|---|---|\n")[1:]:
        lines = body.split("\n\n", 1)[0].splitlines()
        cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
        tables.append([(int(place), *name.split()) for place, name, _ in cells])
    return tables


def test_records() -> None:
    compact, full = fields()
    assert compact == [(0, "x", "s24"), (3, "z", "s24"), (6, "c_obj", "u8"), (7, "flags", "u8")]
    letters = {"i": "s", "u": "u"}
    built = records.FULL
    assert full == [
        (built.fields[name][1], name, f"{letters[built[name].kind]}{8 * built[name].itemsize}")
        for name in built.names
    ]
    assert built.itemsize == link_pkg.FULL_BYTES == 64 and link_pkg.COMPACT_BYTES == 8
    flags = re.findall(r"(\d+) ([A-Z_]{5,})", DOCUMENT.split("| flags u16 |")[1].split("\n")[0])
    more = re.findall(r"(\d+) the flag ([A-Z_]+)", DOCUMENT.split("| bits u8 |")[1].split("\n")[0])
    flags += [(records.MORE_FLAGS[int(bit)], name) for bit, name in more]
    assert {name: int(bit) for bit, name in flags} == pkg.FLAGS
    formats = (repository_root() / "docs/formats.md").read_text()
    explained = re.search(r"\n## Flags\n(.*?)\n## ", formats, re.DOTALL)
    assert explained and set(re.findall(r"`([A-Z_]+)`", explained[1])) == {*pkg.FLAGS}


@pytest.mark.parametrize(
    ("name", "operation", "data"),
    [
        ("PING", Command.PING, bytes),
        ("READ", Command.READ, lambda n: protocol.read(FIRST, n)),
        ("WRITE", Command.WRITE, lambda n: protocol.write(FIRST, range(n))),
    ],
)
def test_times(name: str, operation: int, data) -> None:
    text = next(row[1] for row in rows("| command | clocks |") if row[0].startswith(f"`{name}`"))
    base, each = (int(number) for number in re.findall(r"\d+", text))
    for count in (1, 2, 62):
        registers = BusRegisters()
        payload = command(operation, 1, data(count))
        outcome = answer(payload, registers)
        clocks = latency(payload, outcome, len(registers.accesses), BUS_LATENCY)
        assert clocks == base + each * count


def test_other_times() -> None:
    assert rows("| command | clocks |")[-1][1] == "19"
    for operation, data in (
        (Command.STREAM_START, protocol.stream_start(True, 1)),
        (Command.STREAM_STOP, b""),
        (Command.CAPTURE, protocol.capture(CaptureMode.NEXT)),
    ):
        payload = command(operation, 1, data)
        assert latency(payload, answer(payload, BusRegisters())) == 19
    assert f"at most {MOST_BEFORE_REPLY} bytes" in DOCUMENT
    assert round(MOST_BEFORE_REPLY * 10 / BAUD * 1e3, 1) == 1.7 and "1.7 ms" in DOCUMENT


def test_names_of_registers() -> None:
    for name in (
        "uart_step",
        "uart_step_now",
        "uart_fallbacks",
        "commands_lost",
        "map_hash",
        "clock_hz",
    ):
        assert f"`{name}`" in DOCUMENT and name in REGISTERS
    assert "`laser_watchdog_clks`" in DOCUMENT and "laser_watchdog_clks" in REGISTERS


def test_records_of_space() -> None:
    """The table's places are those of a record with a value of its own in each field."""
    table = DOCUMENT.split("| byte | of a point | of a line without a point |\n|---|---|---|\n")[1]
    cells = [
        [c.strip() for c in line.split("|")[1:4]] for line in table.split("\n\n")[0].split("\n")
    ]
    points = {name.split()[0]: int(place) for place, name, _ in cells if name}
    beams = {name.split()[0]: int(place) for place, _, name in cells if name and name != "the same"}
    one = np.zeros(2, records.SPACE)
    one["flags"] = 1, 0
    one["x"][0], one["z"][0], one["c_obj"][0] = 0x030201, 0x060504, 7
    one["angle"][1], one["c_sfm"][1] = 0x0201_80, 7
    one["free_from"][1], one["free_to"][1] = 0x0403, 0x0605
    one["confidence"], one["inward"] = 0x12, 1
    data = records.encode_space(one)
    assert len(data) == 2 * link_pkg.SPACE_BYTES == 18
    assert data == bytes([1, 2, 3, 4, 5, 6, 7, 1, 0x89, 1, 2, 3, 4, 5, 6, 7, 0, 0x89])
    assert np.array_equal(records.decode_space(data), one)
    assert points == {"x": 0, "z": 3, "c_obj": 6, "flags": 7, "mirror": 8}
    assert beams == {"angle": 0, "free_from": 2, "free_to": 4, "c_sfm": 6}
    frame = protocol.encode_frame(bytes(link_pkg.BATCH_HEADER_BYTES + 24 * link_pkg.SPACE_BYTES))
    longest = len(protocol.encode_frame(bytes([1]) * (len(frame) - 4)))
    assert f"{longest / 24:.1f} bytes" in DOCUMENT and "takes 9.6 bytes" in DOCUMENT
    assert f"{37_400 * longest / 24 * 10 / 4e6:.0%}".replace("%", " %") in DOCUMENT
    assert f"{round(4e6 / 76_666_667 * 2**24):,}" in DOCUMENT

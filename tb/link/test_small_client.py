"""A small host written from docs/link.md alone: it uses nothing of ``vrscan.link``.

It connects, streams twice in each format, captures lines meanwhile, and finds no gap that is none.
"""

import os
import struct
import termios
import time
from collections.abc import Iterator

import pytest
from port_host import Host
from slow_board import CONFIG, SCENE

from vrscan.engines.board import Board
from vrscan.engines.tools import repository_root

RATE = 3_000_000  # after reset
QUIET_S = 0.5  # a simulated board is slower than its page
WAIT_S = 60.0
RECORD = {0x40: 8, 0x41: 64, 0x42: 9}  # bytes of a record


def crc(data: bytes) -> int:
    """CRC-16/IBM-3740, bit by bit."""
    value = 0xFFFF
    for byte in data:
        value ^= byte << 8
        for _ in range(8):
            value = (value << 1 ^ (0x1021 if value & 0x8000 else 0)) & 0xFFFF
    return value


def framed(payload: bytes) -> bytes:
    data = payload + crc(payload).to_bytes(2, "big")
    coded = b""
    for piece in data.split(b"\0"):  # no payload here has 254 bytes without a zero
        assert len(piece) < 254
        coded += bytes([len(piece) + 1]) + piece
    return coded + b"\0"


def unframed(coded: bytes) -> bytes | None:
    """Return the payload of a frame without its 0x00, or None of a bad one."""
    data, at = b"", 0
    while at < len(coded):
        length = coded[at]
        block = coded[at + 1 : at + length]
        if len(block) != length - 1:
            return None
        at += length
        data += block + (b"\0" if length < 255 and at < len(coded) else b"")
    return data[:-2] if len(data) > 2 and crc(data) == 0 else None


class Client(Host):
    """A host that sorts what comes into replies and packets."""

    def __init__(self, board: Board) -> None:
        super().__init__(board.port, RATE)
        self.rest = b""
        self.packets: list[bytes] = []
        self.bad = 0
        self.sequence = 0
        # A break, as a port without one sends it; then discard what came.
        self.rate(RATE // 10)
        self.send(b"\0")
        termios.tcdrain(self.file)
        time.sleep(0.1)
        self.rate(RATE)
        self.listen(QUIET_S)
        self.send(b"\0")
        while self.command(0x01, b"hello", wait=2.0) != b"\0hello":
            pass
        self.packets.clear()
        self.rest, self.bad = b"", 0

    def send(self, data: bytes) -> None:
        while data:
            data = data[os.write(self.file, data) :]

    def payloads(self, wait: float) -> list[bytes]:
        """Return the payloads that come in a part of the time."""
        *frames, self.rest = (self.rest + self.read(4096, wait)).split(b"\0")
        found = [unframed(frame) for frame in frames if frame]
        self.bad += found.count(None)
        return [each for each in found if each is not None]

    def listen(self, quiet: float) -> None:
        """Take packets until nothing comes for so long."""
        end = time.monotonic() + quiet
        while time.monotonic() < end:
            found = self.payloads(0.05)
            self.packets += [each for each in found if each[0] < 0x80]
            if found:
                end = time.monotonic() + quiet

    def command(self, op: int, data: bytes = b"", wait: float = WAIT_S) -> bytes | None:
        """Return status and data of a reply; the packets on the way are kept."""
        self.sequence = (self.sequence + 1) & 0xFF
        self.send(framed(bytes([op, self.sequence]) + data))
        end, reply = time.monotonic() + wait, None
        while reply is None and time.monotonic() < end:
            for each in self.payloads(0.02):
                if each[0] < 0x80:
                    self.packets.append(each)
                elif each[:2] == bytes([0x80 + op, self.sequence]):
                    reply = each[2:]
        return reply


@pytest.fixture(scope="module")
def board(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Board]:
    port = tmp_path_factory.mktemp("client") / "port"
    with Board(SCENE, CONFIG, port=port, swinging=True) as running:
        yield running


def in_sequence(packets: list[bytes], kinds: set[int], first: int | None) -> int:
    """Check that packets of these kinds follow each other; return their number."""
    numbers = [each[1] for each in packets if each[0] in kinds]
    if first is None:
        first = numbers[0]
    assert numbers == [(first + k) & 0xFF for k in range(len(numbers))]
    return len(numbers)


def test_a_client_made_from_the_page_finds_no_false_gap(board: Board) -> None:
    with Client(board) as client:
        assert client.command(0x02, struct.pack("<HB", 0, 1)) == bytes.fromhex("000143535256")
        # A run of test lines, endless: registers of the page registers.md.
        for name, value in (("test_lines", 0), ("test_period_clks", 4000), ("test_start", 1)):
            address = registers()[name]
            reply = client.command(0x03, struct.pack("<HI", address, value))
            assert reply is not None and reply[0] == 0
        client.listen(QUIET_S)
        client.packets.clear()
        ends: list[bytes] = []
        for form in (0, 1, 2, 1, 1, 0):
            step = 3 if form == 1 else 1
            assert client.command(0x10, bytes([form, step])) == b"\0"
            assert client.command(0x12, struct.pack("<BI", 1, 0)) == b"\0"  # the next line
            board.wait(600_000)
            assert client.command(0x11) == b"\0"
            heard = len(client.packets)
            client.listen(QUIET_S)
            packets, client.packets = client.packets, []
            assert len(packets) >= heard
            kind = 0x40 + form
            assert {each[0] for each in packets} == {kind, 0x48, 0x49}
            # Points begin at 0 with each stream; the other two go on from one to the next.
            assert in_sequence(packets, {kind}, 0) > 1
            ends += [each for each in packets if each[0] in (0x48, 0x49)]
            expected = None
            for each in (packet for packet in packets if packet[0] == kind):
                _, _, count, its_step, first, dropped = struct.unpack("<4BIH", each[:10])
                assert len(each) == 10 + count * RECORD[kind] and its_step == step
                assert dropped == 0
                assert expected is None or first == expected
                expected = first + count * step
        in_sequence(ends, {0x48}, None)
        assert in_sequence(ends, {0x49}, None) == 6
        assert client.bad == 0


def registers() -> dict[str, int]:
    """Return the addresses of docs/registers.md."""
    rows = (repository_root() / "docs/registers.md").read_text().splitlines()
    cells = [[cell.strip() for cell in row.split("|")] for row in rows if row.startswith("| 0x")]
    return {row[2].strip("`"): int(row[1].split(".")[0], 16) for row in cells}

"""The host on a wire of bytes that are written out by hand from docs/link.md, CRC and COBS too."""

import os
import pty
import queue
import threading
import tty
from collections.abc import Iterator
from dataclasses import dataclass

import pytest

from vrscan.link import protocol
from vrscan.link.protocol import CaptureMode, Command
from vrscan.link.transport import NoAnswerError, Transport

TIMEOUT_S = 10.0


@dataclass(frozen=True)
class Wire:
    """A port with nothing but a file at its other end."""

    host: Transport
    file: int

    def say(self, text: str) -> None:
        """Send bytes to the host, in hexadecimal."""
        os.write(self.file, bytes.fromhex(text))

    def heard(self) -> str:
        """Return what the host sent up to a 0x00, in hexadecimal."""
        data = b""
        while not data.endswith(b"\0"):
            data += os.read(self.file, 1)
        return data.hex(" ").upper()


@pytest.fixture
def wire() -> Iterator[Wire]:
    file, end = pty.openpty()
    tty.setraw(end)
    host = Transport(os.ttyname(end), 3_000_000, TIMEOUT_S)
    yield Wire(host, file)
    host.close()
    os.close(file)
    os.close(end)


EXCHANGES = {
    # The examples of the page.
    "READ": (
        (Command.READ, 0x2A, protocol.read(0, 1)),
        "03 02 2A 01 04 01 1A 4B 00",
        "03 82 2A 08 01 43 53 52 56 D4 C0 00",
        "82 2A 00 01 43 53 52 56",
    ),
    # NO_ADDRESS: three words from 0x3001 on.
    "READ refused": (
        (Command.READ, 0x31, protocol.read(0x3001, 3)),
        "08 02 31 01 30 03 0D 14 00",
        "04 82 31 03 05 01 30 69 71 00",
        "82 31 03 00 01 30",
    ),
    "PING": (
        (Command.PING, 0x2B, b"\0\xff"),
        "03 01 2B 04 FF 9A B3 00",
        "03 81 2B 01 04 FF AE 2C 00",
        "81 2B 00 00 FF",
    ),
    # Words 0x280 and 3 to 0x0012 and 0x0013.
    "WRITE": (
        (Command.WRITE, 0x2C, protocol.write(0x12, [0x280, 3])),
        "04 03 2C 12 03 80 02 01 02 03 01 01 03 94 77 00",
        "03 83 2C 04 02 80 02 01 02 03 01 01 03 B2 AD 00",
        "83 2C 00 02 80 02 00 00 03 00 00 00",
    ),
    # READ_ONLY: no words, and the address that was refused.
    "WRITE refused": (
        (Command.WRITE, 0x2D, protocol.write(0, [1])),
        "03 03 2D 01 02 01 01 01 03 0B 03 00",
        "04 83 2D 04 01 01 03 F7 EF 00",
        "83 2D 04 00 00 00",
    ),
    # Full records of every seventh line.
    "STREAM_START": (
        (Command.STREAM_START, 0x2E, protocol.stream_start(True, 7)),
        "07 10 2E 01 07 41 76 00",
        "03 90 2E 03 91 4C 00",
        "90 2E 00",
    ),
    "STREAM_STOP": (
        (Command.STREAM_STOP, 0x2F, b""),
        "05 11 2F F8 C0 00",
        "03 91 2F 03 95 4D 00",
        "91 2F 00",
    ),
    "CAPTURE": (
        (Command.CAPTURE, 0x30, protocol.capture(CaptureMode.EVERY, 10)),
        "05 12 30 03 0A 01 01 03 0F A3 00",
        "03 92 30 03 DF 50 00",
        "92 30 00",
    ),
}


@pytest.mark.parametrize(("command", "asked", "answer", "reply"), EXCHANGES.values(), ids=EXCHANGES)
def test_a_command_and_its_reply(
    wire: Wire, command: tuple[int, int, bytes], asked: str, answer: str, reply: str
) -> None:
    operation, sequence, data = command
    wire.host._sequence = sequence - 1
    heard = []

    def board() -> None:
        heard.append(wire.heard())
        wire.say(answer)

    other = threading.Thread(target=board)
    other.start()
    found = wire.host.command(operation, data)
    other.join()
    assert heard == [asked]
    assert found.hex(" ").upper() == reply


def test_words_of_a_reply_and_a_refusal() -> None:
    assert protocol.words(bytes.fromhex(EXCHANGES["READ"][3])).words == (0x56525343,)
    assert protocol.words(bytes.fromhex(EXCHANGES["WRITE"][3])).words == (0x280, 3)
    refused = protocol.words(bytes.fromhex(EXCHANGES["WRITE refused"][3]))
    assert (refused.status.name, refused.words, refused.address) == ("READ_ONLY", (), 0)


def test_a_frame_that_the_board_found_bad_is_sent_again(wire: Wire) -> None:
    """With a 0x00 in front, and another sequence number."""
    heard = []

    def board() -> None:
        heard.append(wire.heard())
        wire.say("02 FF 05 08 01 56 EB 00")  # BAD_FRAME: CRC
        heard.extend((wire.heard(), wire.heard()))
        wire.say("03 91 2F 03 95 4D 00")

    wire.host._sequence = 0x2D
    other = threading.Thread(target=board)
    other.start()
    assert wire.host.command(Command.STREAM_STOP).hex() == "912f00"
    other.join()
    assert heard[0].startswith("05 11 2E") and heard[1:] == ["00", "05 11 2F F8 C0 00"]
    assert (wire.host.traffic.refused, wire.host.traffic.retries) == (1, 1)


def test_a_reply_with_a_wrong_crc_is_none(wire: Wire) -> None:
    wire.host._sequence = 0x2E
    wire.say("03 91 2F 03 95 4C 00")
    with pytest.raises(NoAnswerError, match="no answer to STREAM_STOP"):
        wire.host.command(Command.STREAM_STOP, wait=0.05, repeatable=False)
    assert wire.host.traffic.bad == {"crc": 1}


def come(wire: Wire, kind: int, text: str) -> bytes:
    """Return the payload of a packet that was sent to the host."""
    found: queue.Queue[bytes] = queue.Queue()
    wire.host.sinks[kind] = found.put
    wire.say(text)
    return found.get(timeout=TIMEOUT_S)


def test_compact_points(wire: Wire) -> None:
    batch = protocol.points(
        come(
            wire,
            0x40,
            "0A 40 05 02 07 F9 FF FF FF 03 01 02 10 07 FF EF FF FE 01 01 05 80 FF FF 7F 04 80"
            " 48 2A 00",
        )
    )
    assert (batch.form, batch.sequence, batch.step) == (False, 5, 7)
    assert (batch.first, batch.dropped) == (0xFFFFFFF9, 3)
    assert batch.records.tolist() == [(0x1000, -0x1001, 254, 1), (-0x7FFFFF, 0x7FFFFF, 0, 0x80)]


def test_full_points(wire: Wire) -> None:
    """A record of bytes 0x14 to 0x4F behind its line."""
    batch = protocol.points(
        come(
            wire,
            0x41,
            "09 41 06 01 01 04 03 02 01 01 43 04 03 02 01 14 15 16 17 18 19 1A 1B 1C 1D 1E 1F"
            " 20 21 22 23 24 25 26 27 28 29 2A 2B 2C 2D 2E 2F 30 31 32 33 34 35 36 37 38 39 3A"
            " 3B 3C 3D 3E 3F 40 41 42 43 44 45 46 47 48 49 4A 4B 4C 4D 4E 4F D7 CA 00",
        )
    )
    assert (batch.form, batch.sequence, batch.step) == (True, 6, 1)
    assert (batch.first, batch.dropped) == (0x01020304, 0)
    (record,) = batch.records
    assert {name: f"{record[name]:X}" for name in record.dtype.names} == {
        "line": "1020304",
        "flags": "1514",
        "left": "1716",
        "right": "1918",
        "maximum": "1B1A",
        "row_mean": "1F1E1D1C",
        "row_variance": "23222120",
        "background": "27262524",
        "noise": "2B2A2928",
        "snr": "2D2C",
        "sigma": "2F2E",
        "position": "33323130",
        "angle": "37363534",
        "x": "3B3A3938",
        "z": "3F3E3D3C",
        "sigma_z": "4140",
        "power": "4342",
        "c_obj": "44",
        "c_sfm": "45",
        "doubt": "4746",
        "confidence": "48",
        "bits": "49",
        "lost": "4B4A",
        "time": "4F4E4D4C",
    }


def test_a_raw_line(wire: Wire) -> None:
    chunk = protocol.capture_pixels(
        come(wire, 0x48, "0B 48 07 0A 02 04 03 02 01 FF 0F 04 01 B8 47 00")
    )
    assert (chunk.sequence, chunk.chunk, chunk.line) == (7, 10, 0x01020304)
    assert chunk.pixels.tolist() == [0xFFF, 0x100]
    last = protocol.capture_record(come(wire, 0x49, "04 49 08 01 07 04 03 02 01 AD 08 00"))
    assert (last.sequence, last.line, last.record) == (8, 0x01020304, None)

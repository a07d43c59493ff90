"""The host's side of the protocol: against the board's twins, the oracle, and bytes written out."""

import numpy as np
import pytest
from bus_registers import FIRST, NOTHING, BusRegisters
from frame_oracle import frame
from hypothesis import example, given
from hypothesis import strategies as st

from vrscan.clocked.command_executor import bad_frame
from vrscan.clocked.command_server import answer
from vrscan.clocked.frame_decoder import FrameDecoder
from vrscan.clocked.frame_decoder import Status as FrameStatus
from vrscan.clocked.frame_encoder import FrameEncoder
from vrscan.data import link_pkg, records
from vrscan.link import protocol
from vrscan.link.protocol import Command, FrameReader, Status

MOST = link_pkg.MAX_PAYLOAD
PAYLOADS = st.one_of(
    st.binary(min_size=1, max_size=MOST),
    st.lists(st.sampled_from(b"\0\1\xff"), min_size=1, max_size=MOST).map(bytes),
    st.integers(250, MOST).map(lambda n: b"\7" * n),
    st.integers(250, MOST - 1).map(lambda n: b"\7" * n + b"\0"),
)


def encoded(payload: bytes) -> bytes:
    """Return what the board's encoder makes of a payload."""
    twin = FrameEncoder()
    out = bytearray()
    left = list(payload)
    while not out or out[-1] != 0:
        taken = bool(left) and twin.ready
        byte = left[0] if left else 0
        twin.step(bool(left), byte, len(left) == 1, True)
        if taken:
            left.pop(0)
        if twin.valid:
            out.append(twin.data)
    return bytes(out)


def verdicts(stream: bytes) -> list[tuple[FrameStatus, bytes]]:
    """Return what the board's decoder makes of a stream: the status of each frame, its payload."""
    twin = FrameDecoder(MOST)
    out, found = bytearray(), []
    for byte in stream:
        data, status = twin.take(byte)
        if data is not None:
            out.append(data)
        if status is not None:
            found.append((status, bytes(out)))
            out.clear()
    return found


@given(PAYLOADS)
@example(b"\7" * 252)
@example(b"\7" * 254)
@example(b"\7" * 254 + b"\0")
def test_frames_are_the_boards(payload: bytes) -> None:
    coded = protocol.encode_frame(payload)
    assert coded == frame(payload) == encoded(payload)
    assert protocol.decode_frame(coded[:-1]) == (FrameStatus.OK, payload)


FRAMES = PAYLOADS.map(protocol.encode_frame)


def with_byte(parts: tuple[bytes, int, int]) -> bytes:
    """Return a frame with one byte changed, anywhere."""
    whole, place, byte = parts
    return whole[:place] + bytes([byte]) + whole[place + 1 :]


STREAMS = st.lists(
    st.one_of(
        FRAMES,
        FRAMES.map(lambda whole: whole[:-2]),
        st.tuples(FRAMES, st.integers(0, 300), st.integers(0, 255)).map(with_byte),
        st.binary(max_size=30),
        st.integers(200, 700).map(lambda n: frame(b"\5\0" * n)),
    ),
    max_size=6,
).map(lambda pieces: b"".join(pieces) + b"\0")


@given(STREAMS, st.integers(1, 700))
def test_a_reader_judges_as_the_boards_decoder(stream: bytes, size: int) -> None:
    """Any bytes, in pieces of any size."""
    reader = FrameReader()
    got = []
    for k in range(0, len(stream), size):
        got += reader.feed(stream[k : k + size])
    want = verdicts(stream)
    assert got == [payload for status, payload in want if status == FrameStatus.OK]
    assert reader.good == len(got)
    assert reader.bad.total() == len(want) - len(got)
    names = [status.name.lower() for status, _ in want if status != FrameStatus.OK]
    # Of a frame that is cut and too long, the reader has not kept the end.
    for name in ("crc", "too_short"):
        assert reader.bad[name] == names.count(name)
    assert reader.bad["malformed"] <= names.count("malformed")


def test_a_reader_keeps_little_of_what_never_ends() -> None:
    reader = FrameReader()
    for _ in range(1000):
        assert reader.feed(b"\5" * 1000) == []
    assert len(reader._open) < 300
    assert reader.feed(b"\0" + protocol.encode_frame(b"x")) == [b"x"]
    assert reader.bad == {"too_long": 1}
    reader.feed(b"\3ab")
    reader.reset()
    assert reader.feed(protocol.encode_frame(b"y")) == [b"y"] and reader.bad.total() == 1


@pytest.mark.parametrize("payload", [b"", bytes(MOST + 1)])
def test_no_frame_of_a_payload_of_a_wrong_length(payload: bytes) -> None:
    with pytest.raises(ValueError, match="a payload has"):
        protocol.encode_frame(payload)


def asked(operation: int, data: bytes = b"", sequence: int = 5) -> bytes:
    """Return the board's reply to a command."""
    return answer(protocol.command(operation, sequence, data), BusRegisters()).reply


def test_words_there_and_back() -> None:
    values = (1, 0, 0xFFFF_FFFF, 0x0102_0304)
    found = protocol.words(asked(Command.WRITE, protocol.write(FIRST, values)))
    assert (found.status, found.words, found.address) == (Status.OK, values, None)
    assert protocol.words(asked(Command.READ, protocol.read(FIRST, 3))).words == (0, 0, 0)
    refused = protocol.words(asked(Command.READ, protocol.read(NOTHING - 1, 3)))
    assert (refused.status, refused.words) == (Status.NO_ADDRESS, ())
    assert refused.address == NOTHING - 1
    short = protocol.words(asked(Command.READ, b"\0"))
    assert (short.status, short.words, short.address) == (Status.BAD_LENGTH, (), None)


def test_other_replies() -> None:
    pinged = protocol.reply(asked(Command.PING, b"abc", 9))
    assert pinged == protocol.Reply(Command.PING, 9, Status.OK, b"abc")
    started = asked(Command.STREAM_START, protocol.stream_start(True, 255))
    assert protocol.reply(started).status == Status.OK
    for mode in protocol.CaptureMode:
        data = protocol.capture(mode, 1)
        assert protocol.reply(asked(Command.CAPTURE, data)).status == Status.OK
    bad = protocol.reply(bad_frame(FrameStatus.CRC))
    none = link_pkg.COMMAND_NONE
    assert bad == protocol.Reply(none, 0, Status.BAD_FRAME, bytes([FrameStatus.CRC]))
    assert bad_frame(FrameStatus.CRC)[0] == protocol.BAD_FRAME


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (lambda: protocol.read(0, 0), "words, not 0"),
        (lambda: protocol.read(0, 63), "words, not 63"),
        (lambda: protocol.read(1 << 16, 1), "no address 0x10000"),
        (lambda: protocol.read(-1, 1), "no address -0x1"),
        (lambda: protocol.write(0, []), "words, not 0"),
        (lambda: protocol.write(0, [0] * 63), "words, not 63"),
        (lambda: protocol.stream_start(False, 0), "not every 0th"),
        (lambda: protocol.stream_start(False, 256), "not every 256th"),
        (lambda: protocol.capture(4), "4 is not a valid CaptureMode"),
        (lambda: protocol.capture(3, 0), "EVERY does not take 0"),
        (lambda: protocol.capture(2, 1 << 32), "LINE does not take 4294967296"),
    ],
)
def test_commands_that_cannot_be(made, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        made()


@pytest.mark.parametrize(
    ("parse", "payload", "words"),
    [
        (protocol.reply, b"\x81\1", "no reply"),
        (protocol.reply, b"\x01\1\0", "no reply"),
        (protocol.reply, b"\x81\1\x0f", "15 is not a valid Status"),
        (protocol.words, b"\x82\1\0", "READ or a WRITE"),
        (protocol.words, b"\x82\1\0\2aaaa", "READ or a WRITE"),
        (protocol.words, b"\x82\1\3\1aa", "READ or a WRITE"),
        (protocol.points, b"\x40\0\1\1aaaabb" + bytes(7), "7 bytes of them"),
        (protocol.points, b"\x41\0\1\1aaaabb" + bytes(8), "8 bytes of them"),
        (protocol.points, b"\x42\0\1\1aaaabb" + bytes(8), "8 bytes of them"),
        (protocol.points, b"\x43\0\0\1aaaabb", "no packet"),
        (protocol.points, b"\x40\0\0\1aaaab", "no packet"),
        (protocol.capture_pixels, b"\x48\0\0\2aaaa" + bytes(3), "2 pixels in 3"),
        (protocol.capture_pixels, b"\x49\0\0\0aaaa", "no pixels"),
        (protocol.capture_pixels, b"\x48\0\0\0aaa", "no pixels"),
        (protocol.capture_record, b"\x49\0\1\0aaaa" + bytes(64), "record.*not whole"),
        (protocol.capture_record, b"\x49\0\0\0aaaa" + bytes(63), "record.*not whole"),
        (protocol.capture_record, b"\x49\0\2\0aaaa", "record.*not whole"),
        (protocol.capture_record, b"\x48\0\1\0aaaa", "no end"),
    ],
)
def test_payloads_that_are_none(parse, payload: bytes, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        parse(payload)


def test_points() -> None:
    found = np.zeros(3, records.FULL)
    found["line"] = [7, 9, 11]
    found["x"] = [-1, 2, -3]
    data = b"\x41\x63\3\2" + (7).to_bytes(4, "little") + b"\x34\x12" + records.encode_full(found)
    batch = protocol.points(data)
    assert (batch.sequence, batch.form, batch.step) == (0x63, 1, 2)
    assert (batch.first, batch.dropped) == (7, 0x1234)
    np.testing.assert_array_equal(batch.records, found)

    small = np.zeros(2, records.COMPACT)
    small["z"] = [-(1 << 23), (1 << 23) - 1]
    small["flags"] = [1, 128]
    head = b"\x40\0\2\1" + (0xFFFF_FFFF).to_bytes(4, "little") + b"\0\0"
    batch = protocol.points(head + records.encode_compact(small))
    assert (batch.form, batch.first) == (False, 0xFFFF_FFFF)
    np.testing.assert_array_equal(batch.records, small)
    assert len(protocol.points(b"\x40\0\0\1" + bytes(6)).records) == 0
    assert len(head) == link_pkg.BATCH_HEADER_BYTES


def test_captures() -> None:
    chunk = protocol.capture_pixels(b"\x48\7\x14\2\4\3\2\1\xff\x0f\0\1")
    assert (chunk.sequence, chunk.chunk, chunk.line) == (7, 20, 0x01020304)
    np.testing.assert_array_equal(chunk.pixels, [0xFFF, 0x100])
    record = np.zeros(1, records.FULL)
    record["angle"] = -5
    end = protocol.capture_record(b"\x49\x08\0\0\4\3\2\1" + records.encode_full(record))
    assert (end.sequence, end.line) == (8, 0x01020304)
    assert end.record is not None and end.record["angle"] == -5
    assert protocol.capture_record(b"\x49\x09\1\0\4\3\2\1").record is None

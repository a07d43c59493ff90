"""frame_decoder: every clock of the RTL against the model, every verdict against plain Python."""

from binascii import crc_hqx
from collections.abc import Iterable, Iterator

import cocotb
import numpy as np
import pytest
from cobs import cobs
from frame_oracle import (
    checked,
    frame,
    is_good,
    random_bytes,
    random_payload,
    uncobs,
    with_crc_byte,
)
from harness import (
    TwinBench,
    as_integer,
    each,
    generator,
    in_volume,
    parameters,
    simulate,
)

from vrscan.clocked.frame_decoder import LATENCY, FrameDecoder, Status

ELABORATIONS = [{"MaxPayload": 1024}, {"MaxPayload": 1}, {"MaxPayload": 300}]
INPUTS = ("valid", "data", "error")
Result = tuple[Status, bytes]
NO_ERROR = frozenset[int]()


def results_of(stream: bytes, most: int, errors: Iterable[int] = NO_ERROR) -> list[Result]:
    """Return status and bytes put out of every frame, from the definitions.

    Args:
        stream: The bytes received, ended by a zero.
        most: The longest payload.
        errors: Places in the stream that had no stop bit.
    """
    results = []
    begin = 0
    errors = set(errors)
    for end in [k for k, byte in enumerate(stream) if byte == 0]:
        coded = stream[begin:end]
        if coded:
            whole = uncobs(coded)
            # The missing bytes, so that what was decoded before them is known.
            data = whole
            ones = b""
            while data is None:
                ones += b"\1"
                data = uncobs(coded + ones)
            data = data[: len(data) - len(ones)]
            if not errors.isdisjoint(range(begin, end + 1)):
                status = Status.FRAMING
            elif whole is None:
                status = Status.MALFORMED
            elif len(data) > most + 2:
                status = Status.TOO_LONG
            elif len(data) < 3:
                status = Status.TOO_SHORT
            elif is_good(coded) is None:
                status = Status.CRC
            else:
                status = Status.OK
            results.append((status, data[:-2][:most]))
        begin = end + 1
    return results


def taken_by(twin: FrameDecoder, stream: bytes) -> Iterator[Result]:
    """Run a stream through the model without the clocks."""
    out = bytearray()
    for byte in stream:
        data, status = twin.take(byte)
        if data is not None:
            out.append(data)
        if status is not None:
            yield status, bytes(out)
            out.clear()


class Bench(TwinBench):
    """Sends bytes and keeps the frames that come out."""

    def __init__(self, dut) -> None:
        super().__init__(dut, INPUTS)
        self.draw = generator(1)

    def check(self) -> None:
        dut, twin = self.dut, self.twin
        names = ("valid", "done", *(("data",) * twin.valid), *(("status",) * twin.done))
        got = tuple(as_integer(getattr(dut, f"{name}_o")) for name in names)
        want = tuple(int(getattr(twin, name)) for name in names)
        assert got == want, f"clock {self.clock}, {self.inputs}: {names} {got}, want {want}"
        if twin.valid:
            self.out.append(twin.data)
            self.valid_clocks.append(self.clock)
        if twin.done:
            self.results.append((twin.status, bytes(self.out)))
            self.done_clocks.append(self.clock)
            self.out.clear()

    async def start(self, **inputs: int) -> None:
        self.out = bytearray()
        self.results: list[Result] = []
        self.valid_clocks: list[int] = []
        self.done_clocks: list[int] = []
        await self.reset_to(
            FrameDecoder(parameters()["MaxPayload"]),
            **{"valid": 0, "data": 0, "error": 0} | inputs,
        )
        self.check()

    async def send(
        self, stream: bytes, errors: Iterable[int] = NO_ERROR, valid: float = 1, after: int = 4
    ) -> None:
        """Send bytes, those of ``errors`` without a stop bit, other values on the ports between."""
        errors = set(errors)
        for k, byte in enumerate(stream):
            while self.draw.random() >= valid:
                await self.clocks(valid=0, data=int(self.draw.integers(256)), error=k % 2)
            await self.clocks(valid=1, data=byte, error=int(k in errors))
        await self.clocks(after, valid=0, data=0, error=1)

    async def expect(
        self, stream: bytes, errors: Iterable[int] = NO_ERROR, valid: float = 1
    ) -> list[Status]:
        """Send bytes, compare all frames with the definitions, and return what they were."""
        self.results.clear()
        await self.send(stream, errors, valid)
        assert self.results == results_of(stream, parameters()["MaxPayload"], errors)
        return [status for status, _ in self.results]


def spoilt(draw: np.random.Generator, good: bytes, kind: str) -> tuple[bytes, set[int]]:
    """Return a frame with a fault of this kind, and where its stop bits are missing."""
    at = int(draw.integers(len(good) - 1))
    if kind == "flip":
        changed = bytes([good[at] ^ (1 << int(draw.integers(8)))])
        return good[:at] + changed + good[at + 1 :], set()
    if kind == "cut":
        return good[:at] + b"\0", set()
    if kind == "lost":
        return good[:at] + good[at + 1 :], set()
    if kind == "twice":
        return good[:at] + good[at : at + 1] + good[at:], set()
    if kind == "framing":
        return good, {at}
    if kind == "framing_zero":
        return good[:at] + b"\0" + good[at + 1 :], {at}
    if kind == "framing_end":
        return good, {len(good) - 1}
    if kind == "random":
        return random_bytes(draw, at + 1, 0.02) + b"\0", set()
    return bytes(int(draw.integers(1, 5))), set()  # silence


KINDS = (
    "flip",
    "cut",
    "lost",
    "twice",
    "framing",
    "framing_zero",
    "framing_end",
    "random",
    "silence",
)


@cocotb.test()
async def good_and_bad_frames_with_gaps(dut) -> None:
    """Frames of every kind and every fault; behind each the next good one is accepted."""
    bench = await Bench.started(dut)
    most = parameters()["MaxPayload"]
    seen = set()
    for valid in (1, 0.7, 0.1):
        for kind in KINDS:
            for _ in range(6 if valid > 0.5 else 2):
                payload = random_payload(bench.draw, most)
                bad, errors = spoilt(bench.draw, frame(random_payload(bench.draw, most)), kind)
                seen.update(await bench.expect(bad + frame(payload), errors, valid))
                assert bench.results[-1] == (Status.OK, payload)
    assert seen >= {Status.OK, Status.CRC, Status.MALFORMED, Status.FRAMING}


@cocotb.test()
async def frames_back_to_back(dut) -> None:
    """A byte in every clock, good frames of every length at the edges of a block."""
    bench = await Bench.started(dut)
    most = parameters()["MaxPayload"]
    draw = bench.draw
    counts = [n for n in [*range(1, 6), *range(250, 258), *range(506, 512), most] if n <= most]
    payloads = []
    for count in counts:
        payloads += [random_bytes(draw, count, zeros) for zeros in (0, 0.1, 1)]
        payloads.append(random_bytes(draw, count - 1, 0) + b"\0")
        payloads += [with_crc_byte(0, place, count, draw) for place in (0, 1)]
    await bench.expect(b"".join(frame(payload) for payload in payloads))
    assert bench.results == [(Status.OK, payload) for payload in payloads]


@cocotb.test()
async def random_bytes_only(dut) -> None:
    """No order at all, with errors."""
    bench = await Bench.started(dut)
    for zeros in (0.004, 0.05, 0.3):
        stream = random_bytes(bench.draw, 6000, zeros) + b"\0"
        errors = np.flatnonzero(bench.draw.random(len(stream)) < zeros / 10).tolist()
        await bench.expect(stream, errors)
    for small in (3, 5):  # short blocks: most are whole
        stream = bytes(bench.draw.integers(0, small, 6000).tolist()) + b"\0"
        await bench.expect(stream)


@cocotb.test()
async def every_status_and_its_limits(dut) -> None:
    """The shortest and the longest, a byte less and a byte more; of several faults the first."""
    bench = await Bench.started(dut)
    most = parameters()["MaxPayload"]
    draw = bench.draw
    short = [
        b"\1\0",
        b"\2\5\0",
        b"\1\1\0",
        b"\3\5\5\0",
        b"\1\1\1\0",
        cobs.encode(checked(b"")) + b"\0",
    ]
    for bad in short:
        assert await bench.expect(bad + frame(b"\7")) == [Status.TOO_SHORT, Status.OK]
    for count, status in ((most, Status.OK), (most + 1, Status.TOO_LONG)):
        for zeros in (0, 0.1):
            payload = random_bytes(draw, count, zeros)
            assert await bench.expect(frame(payload) + frame(b"\7")) == [status, Status.OK]
            assert bench.results[0][1] == payload[:most]
    for count in (most + 2, most + 300, 4 * most + 2000):
        payload = random_bytes(draw, count, 0.02)
        assert await bench.expect(frame(payload) + frame(b"\7")) == [Status.TOO_LONG, Status.OK]
        assert await bench.expect(frame(payload)[:-1] + b"\5\0") == [Status.MALFORMED]
    wrong = cobs.encode(b"\5" + checked(b"\5")[:0:-1]) + b"\0"
    assert await bench.expect(wrong) == [Status.CRC]
    # Errors that leave a single bit of the CRC.
    ones = [e for e in range(1 << 16) if crc_hqx(e.to_bytes(2, "big"), 0).bit_count() == 1]
    assert len(ones) == 16
    for error in ones:
        data = int.from_bytes(checked(b"\5"), "big") ^ error
        assert await bench.expect(cobs.encode(data.to_bytes(3, "big")) + b"\0") == [Status.CRC]
    assert await bench.expect(wrong, {1}) == [Status.FRAMING]
    assert await bench.expect(b"\xff\1\0", {0}) == [Status.FRAMING]
    assert await bench.expect(b"\xff\1\0") == [Status.MALFORMED]
    assert await bench.expect(b"\xff\0") == [Status.MALFORMED]
    # Both ways to end in a full block: with an empty block behind it, and without.
    if most >= 252:
        payload = random_bytes(draw, 252, 0)
        while 0 in checked(payload):
            payload = random_bytes(draw, 252, 0)
        assert len(frame(payload)) == 256
        for end in (b"\0", b"\1\0"):
            await bench.expect(frame(payload)[:-1] + end)
            assert bench.results == [(Status.OK, payload)]


@cocotb.test()
async def silence_is_no_frame(dut) -> None:
    """Zeros between frames, with a stop bit or not, and bytes that are not valid."""
    bench = await Bench.started(dut)
    stream = bytes(5) + frame(b"\1") + bytes(300) + frame(b"\2") + bytes(3)
    ends = set(range(4)) | set(range(20, 40))
    await bench.expect(stream, ends)
    assert [status for status, _ in bench.results] == [Status.OK] * 2


@cocotb.test()
async def every_cut_and_every_flip_of_a_frame(dut) -> None:
    """Of a short one, in the RTL; its end may be lost too, and then the next one goes with it."""
    bench = await Bench.started(dut)
    most = parameters()["MaxPayload"]
    payload = b"\x31\0\x41\x59"[:most]
    good = frame(payload)
    for length in range(1, len(good)):
        statuses = await bench.expect(good[:length] + b"\0" + good)
        assert statuses == [statuses[0], Status.OK] and (
            statuses[0] != Status.OK or length == len(good) - 1
        )
        statuses = await bench.expect(good[:length] + good + good)
        assert statuses[-1] == Status.OK and len(statuses) == 2
    for bit in range(8 * len(good)):
        flipped = bytearray(good)
        flipped[bit // 8] ^= 1 << bit % 8
        await bench.expect(bytes(flipped) + good + good)
        lost = bit // 8 == len(good) - 1
        assert [r for r in bench.results if r[0] == Status.OK] == [(Status.OK, payload)] * (
            2 - lost
        )


@cocotb.test()
async def latency(dut) -> None:
    """A byte goes out when two more are decoded, the verdict LATENCY after the 0x00."""
    bench = await Bench.started(dut)
    count = min(parameters()["MaxPayload"], 9)
    payload = b"\0" * (count - 1) + b"\7"
    good = frame(payload)
    assert 0 not in checked(payload)[-3:]
    await bench.send(good)
    # Bytes are decoded from the second of the frame on: its first is the code.
    assert bench.valid_clocks == [LATENCY + 3 + k for k in range(count)]
    assert bench.done_clocks == [len(good) - 1 + LATENCY]


@cocotb.test()
async def reset_at_every_age(dut) -> None:
    """A reset in mid-frame, with valid high: nothing of before comes out, the next is right."""
    bench = await Bench.started(dut)
    most = parameters()["MaxPayload"]
    long = frame(random_bytes(bench.draw, min(most, 260), 0)) * 2
    mixed = frame(random_bytes(bench.draw, min(most, 9), 0.4)) * 2 + b"\5\5\0"
    after = random_bytes(bench.draw, min(most, 5), 0.2)
    for stream, ages in ((mixed, range(1, 31)), (long, range(1, 280, 9))):
        for age in ages:
            for data in (0, 1, 77):
                await bench.start()
                await bench.send(stream[:age], {age - 2} if data == 1 else (), after=0)
                await bench.start(valid=1, data=data, error=int(data == 1))
                await bench.send(bytes(age % 2) + frame(after))
                assert bench.results == [(Status.OK, after)]
                assert not bench.out


@pytest.mark.parametrize("elaboration", each(ELABORATIONS), ids=str)
def test_frame_decoder_rtl_equals_model(elaboration: dict[str, int]) -> None:
    simulate("frame_decoder", __file__, elaboration)


def frames_of_all_kinds() -> list[bytes]:
    draw = generator(2)
    return [
        *(random_bytes(draw, count, 0) for count in (1, 30, 251, 252, 253, 300)),
        *(random_bytes(draw, count, 0.1) for count in (2, 40, 200)),
        random_bytes(draw, 100, 0.5),
        bytes(50),
    ]


def test_frame_decoder_model_refuses_a_frame_cut_at_every_length() -> None:
    after = b"\x13\0\x37"
    cuts = accepted = 0
    for payload in [*frames_of_all_kinds(), random_bytes(generator(3), 1024, 0.01)]:
        good = frame(payload)
        for length in range(len(good) - 1):
            # Its end is there, or is lost too: then the next frame is lost with it.
            for end, lost in ((b"\0", 0), (b"", 1)):
                stream = good[:length] + end + frame(after) * 2
                got = list(taken_by(FrameDecoder(), stream))
                if length:
                    assert len(got) == 3 - lost
                    assert got[1:] == [(Status.OK, after)] * (2 - lost)
                    accepted += got[0][0] == Status.OK
                    cuts += 1
                else:
                    assert got == [(Status.OK, after)] * 2
    print(f"\ncut frames: {accepted} of {cuts} accepted, predicted {cuts / 2**16:.2f}")
    assert accepted <= 3 + 3 * cuts / 2**16


def test_frame_decoder_model_refuses_every_flip_of_one_bit() -> None:
    after = b"\x13\0\x37"
    flips = accepted = 0
    for payload in frames_of_all_kinds():
        good = frame(payload)
        twin = FrameDecoder()
        for bit in range(8 * len(good)):
            flipped = bytearray(good)
            flipped[bit // 8] ^= 1 << bit % 8
            stream = bytes(flipped) + frame(after) * 2
            got = list(taken_by(twin, stream))
            # A flip of the 0x00 joins two frames.
            lost = bit // 8 == len(good) - 1
            assert got[lost - 2 :] == [(Status.OK, after)] * (2 - lost)
            bad = got[: lost - 2]
            assert bad
            accepted += sum(status == Status.OK for status, _ in bad)
            flips += 1
    print(
        f"\nflipped frames: {accepted} of {flips} accepted, predicted {flips / 2**16:.2f} at most"
    )
    assert accepted <= 3 + 3 * flips / 2**16


@pytest.mark.parametrize("count", [100_000, in_volume(2_000_000)])
@pytest.mark.parametrize("zeros", [0.0, 0.1, 0.4])
def test_frame_decoder_model_takes_random_bytes(zeros: float, count: int) -> None:
    draw = generator(4)
    after = b"\x13\0\x37"
    stream = draw.integers(0, 256, count).astype(np.uint8)
    # With many zeros there are many short frames; small codes make them whole.
    stream[draw.random(len(stream)) < zeros] = 0
    small = draw.random(len(stream)) < 2 * zeros
    stream[small] %= 8
    data = stream.tobytes() + b"\0"
    twin = FrameDecoder()
    got = list(taken_by(twin, data))
    assert got == results_of(data, 1024)
    right = [is_good(coded) for coded in data.split(b"\0") if coded]
    payloads = [payload for payload in right if payload is not None and len(payload) <= 1024]
    assert [payload for status, payload in got if status == Status.OK] == payloads
    judged = sum(status in (Status.OK, Status.CRC) for status, _ in got)
    counts = {status.name: sum(s == status for s, _ in got) for status in Status}
    print(f"\n{counts}: accepted {len(payloads)}, predicted {judged / 2**16:.2f}")
    assert len(payloads) <= 3 + 3 * judged / 2**16
    assert list(taken_by(twin, frame(after))) == [(Status.OK, after)]


@pytest.mark.soak
def test_frame_decoder_model_accepts_a_random_crc_once_in_65536() -> None:
    draw = generator(5)
    count = 300_000
    frames = [cobs.encode(random_bytes(draw, 5, 0.004)) + b"\0" for _ in range(count)]
    got = [status for status, _ in taken_by(FrameDecoder(), b"".join(frames))]
    assert len(got) == count and set(got) == {Status.OK, Status.CRC}
    accepted, predicted = got.count(Status.OK), count / 2**16
    print(f"\nrandom CRCs: {accepted} of {count} accepted, predicted {predicted:.2f}")
    assert accepted == sum(is_good(one[:-1]) is not None for one in frames)
    assert abs(accepted - predicted) < 4 * predicted**0.5


@pytest.mark.parametrize("most", [0, 65536])
def test_frame_decoder_model_rejects_what_does_not_fit(most: int) -> None:
    with pytest.raises(ValueError, match="frame_decoder: "):
        FrameDecoder(most)

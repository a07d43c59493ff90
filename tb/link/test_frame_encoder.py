"""frame_encoder: every clock of the RTL against the model, every frame against plain Python."""

import binascii

import cocotb
import numpy as np
from cobs import cobs
from frame_oracle import checked, frame, random_bytes, random_payload, uncobs, with_crc_byte
from harness import (
    TwinBench,
    as_integer,
    generator,
    simulate,
)

from vrscan.clocked.frame_encoder import (
    BLOCK_BUBBLE,
    CRC_INIT,
    FRAME_BUBBLE,
    LATENCY,
    ZERO_LATENCY,
    FrameEncoder,
    crc_next,
)

INPUTS = ("valid", "data", "last", "ready")
MOST = 1024  # bytes of a payload


class Bench(TwinBench):
    """Sends payloads, keeps the bytes that come out, and the clocks in which things happen."""

    def __init__(self, dut) -> None:
        super().__init__(dut, INPUTS)
        self.draw = generator(1)

    def check(self) -> None:
        dut, twin = self.dut, self.twin
        for name in ("ready", "valid"):
            got, want = as_integer(getattr(dut, f"{name}_o")), int(getattr(twin, name))
            assert got == want, f"clock {self.clock}, {self.inputs}: {name} {got}, want {want}"
        if twin.valid:
            got = int(dut.data_o.value)
            assert got == twin.data, f"clock {self.clock}: data {got:02x}, want {twin.data:02x}"

    async def start(self, **inputs: int) -> None:
        await self.reset_to(
            FrameEncoder(),
            **{"valid": 0, "data": 0, "last": 0, "ready": 0} | inputs,
        )
        self.check()
        self.out = bytearray()
        self.taken: list[int] = []  # clocks
        self.given: list[int] = []

    async def clock_(self, valid: bool, data: int, last: bool, ready: bool) -> bool:
        """Go on by a clock; return whether the byte was taken."""
        taken = bool(valid and self.twin.ready)
        if taken:
            self.taken.append(self.clock)
        if ready and self.twin.valid:
            self.out.append(self.twin.data)
            self.given.append(self.clock)
        await self.clocks(valid=int(valid), data=data, last=int(last), ready=int(ready))
        return taken

    async def send(self, *payloads: bytes, valid: float = 1, ready: float = 1) -> None:
        """Send payloads, both sides ready with these probabilities, and wait for their end."""
        ends = self.out.count(0) + len(payloads)
        for payload in payloads:
            for k, byte in enumerate(payload):
                taken = False
                while not taken:
                    offered = self.draw.random() < valid
                    data = byte if offered else int(self.draw.integers(256))
                    last = k == len(payload) - 1 if offered else bool(self.draw.integers(2))
                    taken = await self.clock_(offered, data, last, self.draw.random() < ready)
        await self.finish(ends, ready)

    async def finish(self, ends: int, ready: float = 1) -> None:
        """Wait until so many frames have ended, and some clocks more."""
        left = 4000
        while self.out.count(0) < ends:
            await self.clock_(False, int(self.draw.integers(256)), True, self.draw.random() < ready)
            left -= 1
            assert left, f"{self.out.count(0)} frames of {ends}"
        for _ in range(8):
            await self.clock_(False, 0, True, True)


@cocotb.test()
async def random_payloads_with_gaps(dut) -> None:
    """Payloads of every kind, both sides fast and slow: what comes out is what Python makes."""
    bench = await Bench.started(dut)
    most = MOST
    for valid, ready in ((1, 1), (0.5, 1), (1, 0.5), (0.9, 0.9), (1, 0.1), (0.05, 1)):
        await bench.start()
        count = 12 if min(valid, ready) > 0.2 else 4
        payloads = [random_payload(bench.draw, most) for _ in range(count)]
        await bench.send(*payloads, valid=valid, ready=ready)
        assert bytes(bench.out) == b"".join(frame(payload) for payload in payloads)


@cocotb.test()
async def blocks_end_where_the_payload_or_its_crc_does(dut) -> None:
    """Every length around one and two full blocks, a zero behind it or not, zeros in the CRC."""
    bench = await Bench.started(dut)
    most = MOST
    draw = bench.draw
    payloads = []
    for count in [*range(1, 5), *range(250, 258), *range(504, 512)]:
        if count > most:
            continue
        payloads.append(random_bytes(draw, count, 0))
        payloads.append(random_bytes(draw, count - 1, 0) + b"\0")
        payloads.append(b"\0" + random_bytes(draw, count - 1, 0))
        payloads += [with_crc_byte(0, place, count, draw) for place in (0, 1)]
    for ready in (1, 0.6):
        await bench.start()
        await bench.send(*payloads, ready=ready)
        assert bytes(bench.out) == b"".join(frame(payload) for payload in payloads)


@cocotb.test()
async def the_output_stalls(dut) -> None:
    """The ring fills at any phase of a frame, holds its byte and loses none."""
    bench = await Bench.started(dut)
    most = MOST
    payloads = [random_payload(bench.draw, most) for _ in range(6)]
    payloads += [bytes(min(300, most)), b"\1"]
    for before in range(0, 400, 13):
        await bench.start()
        queue = [(b, k == len(p) - 1) for p in payloads for k, b in enumerate(p)]
        clock = 0
        while queue:
            stalled = before <= clock < before + 600
            if await bench.clock_(True, *queue[0], not stalled):
                queue.pop(0)
            if clock == before + 599:
                assert bench.twin.valid
            clock += 1
        await bench.finish(len(payloads))
        assert bytes(bench.out) == b"".join(frame(payload) for payload in payloads)


@cocotb.test()
async def full_rate_but_for_the_bubbles(dut) -> None:
    """The clocks without ready_o: none within a block, and as many at its end as are stated."""
    bench = await Bench.started(dut)
    most = MOST
    draw = bench.draw
    worst = 0
    for count in (1, 100, 252, 253, 254, 255, 1000):
        if count > most:
            continue
        for zeros in (0, 0.1, 1):
            await bench.start()
            await bench.clock_(False, 0, False, True)  # the first clock after a reset
            payload = random_bytes(draw, count, zeros)
            await bench.send(payload, payload)
            gaps = np.diff(bench.taken) - 1
            runs = [len(piece) // 254 for piece in payload.split(b"\0")]
            within = int(gaps[: count - 1].sum())
            assert within <= BLOCK_BUBBLE * sum(runs)
            worst = max(worst, int(gaps[: count - 1].max(initial=0)))
            full = max(len(piece) for piece in checked(payload).split(b"\0")) >= 254
            most_between = FRAME_BUBBLE + (BLOCK_BUBBLE if full else 0)
            assert FRAME_BUBBLE <= gaps[count - 1] <= most_between
    assert worst == (BLOCK_BUBBLE if most > 254 else 0)
    # The ring stays nearly full behind a full block; the zeros after it wait no more for that.
    run = random_bytes(draw, 254, 0)
    for payload in (run + bytes(700), bytes(300) + run + bytes(100) + run):
        if len(payload) <= most:
            await bench.start()
            await bench.send(payload)
            assert (np.diff(bench.taken) - 1).sum() <= BLOCK_BUBBLE * payload.count(run)
    # Frame after frame: the output is never idle but while a block comes in.
    await bench.start()
    await bench.clock_(False, 0, False, True)
    payloads = [bytes([k + 1]) for k in range(100)]
    await bench.send(*payloads)
    assert np.diff(bench.taken).tolist() == [1 + FRAME_BUBBLE] * 99
    assert np.diff(bench.given).tolist() == [1] * (len(bench.given) - 1)


@cocotb.test()
async def latency(dut) -> None:
    """From last_i, and from a zero, to the code; then a byte a clock."""
    bench = await Bench.started(dut)
    count = min(MOST, 20)
    for payload, latency in ((b"\7" * count, LATENCY), (b"\0" * count, ZERO_LATENCY)):
        await bench.start()
        await bench.send(payload)
        reference = bench.taken[-1] if latency == LATENCY else bench.taken[0]
        assert bench.given[0] == reference + latency
        steps = np.diff(bench.given).tolist()
        if latency == ZERO_LATENCY:  # the CRC's block is not full before the zeros are out
            steps = steps[: count - 1]
        assert steps == [1] * len(steps)


@cocotb.test()
async def reset_at_every_age(dut) -> None:
    """A reset in mid-stream, with valid high: nothing of before comes out, the next is right."""
    bench = await Bench.started(dut)
    most = MOST
    first = random_bytes(bench.draw, min(most, 12), 0.2)
    long = random_bytes(bench.draw, min(most, 254), 0)
    after = random_bytes(bench.draw, min(most, 5), 0.2)
    for payload, ages in ((first, range(1, 30)), (long, range(250, 275))):
        queue = [(b, k == len(payload) - 1) for _ in range(3) for k, b in enumerate(payload)] * 20
        for age in ages:
            for ready in (True, False):
                await bench.start()
                left = list(queue)
                for _ in range(age):
                    if await bench.clock_(True, *left[0], ready):
                        left.pop(0)
                await bench.start(valid=1, data=9, last=int(age % 2), ready=int(ready))
                for _ in range(4):
                    await bench.clock_(False, 9, True, True)
                assert not bench.out
                await bench.send(after)
                assert bytes(bench.out) == frame(after)


def test_frame_encoder_rtl_equals_model() -> None:
    simulate("frame_encoder", __file__)


def test_frame_encoder_model_crc_is_the_standard_one() -> None:
    draw = generator(2)
    for text in (b"", b"123456789", random_bytes(draw, 1000, 0.1)):
        crc = CRC_INIT
        for byte in text:
            crc = crc_next(crc, byte)
        assert crc == binascii.crc_hqx(text, 0xFFFF)
        assert text != b"123456789" or crc == 0x29B1  # the check value of its catalogue entry


def test_frame_oracle_knows_its_examples() -> None:
    run = bytes(range(1, 256))
    for data, coded in (
        (b"\0", b"\1\1"),
        (b"\0\0", b"\1\1\1"),
        (b"\x11\x22\0\x33", b"\3\x11\x22\2\x33"),
        (run[:254], b"\xff" + run[:254]),
        (b"\0" + run[:254], b"\1\xff" + run[:254]),
        (run, b"\xff" + run[:254] + b"\2\xff"),
        (run[:254] + b"\0", b"\xff" + run[:254] + b"\1\1"),
    ):
        assert cobs.encode(data) == coded
        assert uncobs(coded) == data

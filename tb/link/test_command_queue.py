"""command_queue: every clock of the RTL against the model, with an executor of any speed."""

import cocotb
from harness import Ports, TwinBench, as_integer, generator, parameters, simulate

from vrscan.clocked.command_queue import (
    BAD_FRAME_PLACES,
    FRAME_COUNTERS,
    LATENCY,
    PLACES,
    CommandQueue,
    Frame,
)
from vrscan.clocked.frame_decoder import Status

QUIET = {
    "valid": 0,
    "data": 0,
    "done": 0,
    "status": 0,
    "halt": 0,
    "take": 0,
    "release": 0,
    "index": 0,
}
COUNTERS = (*FRAME_COUNTERS.values(), "commands_lost")


class Bench(TwinBench):
    """Gives frames, and takes and releases them."""

    strobes = ("valid", "done", "halt", "take", "release")

    def __init__(self, dut) -> None:
        super().__init__(dut, QUIET)
        self.draw = generator(1)
        outputs = ["waits", "status", "length", "byte", *COUNTERS]
        self.outputs = Ports(dut, [f"{name}_o" for name in outputs])

    async def start(self, **inputs: int) -> None:
        """Reset for a clock."""
        self.executed = False
        self.shown: Frame | None = None  # the frame that the memories showed last
        await self.reset_to(CommandQueue(parameters()["CountWidth"]), **(QUIET | inputs))
        self.give(**dict.fromkeys(self.strobes, 0))
        self.check()

    def check(self) -> None:
        """Compare what is defined: a frame is there two clocks after its end."""
        twin = self.twin
        waits, status, length, byte, *counters = self.outputs.read()
        assert waits == twin.waits, f"clock {self.clock}, {self.inputs}: waits {waits}"
        assert counters == list(twin.counters.values()), f"{self.clock}: {COUNTERS} {counters}"
        frame, index = self.shown, self.inputs["index"]
        if frame is not None:
            assert (status, length) == (frame.status, len(frame.payload)), self.clock
            if index < length:
                assert byte == frame.payload[index], (self.clock, index)
        self.shown = twin.frame if twin.waits or self.executed else None

    async def clocks(self, count: int = 1, **inputs: int) -> None:
        for _ in range(count):
            self.give(**inputs)
            now = dict(self.inputs)
            del now["index"]
            await self.dut.clk_i.falling_edge
            self.twin.step(**now)
            self.clock += 1
            self.executed = (self.executed or now["take"]) and not now["release"]
            self.check()
            self.give(**dict.fromkeys(self.strobes, 0))

    async def frame(self, payload: bytes, status: int = 0) -> None:
        """Give a frame, a byte a clock."""
        for byte in payload:
            await self.clocks(valid=1, data=byte)
        await self.clocks(done=1, status=status)

    async def take(self, busy: int = 0) -> Frame:
        """Begin a frame, read it whole, release it, and return it."""
        await self.clocks(take=1)
        await self.clocks(busy + 1)
        status, length = (as_integer(getattr(self.dut, f"{n}_o")) for n in ("status", "length"))
        payload = bytearray()
        for index in range(length):
            await self.clocks(index=index)
            payload.append(as_integer(self.dut.byte_o))
        await self.clocks(release=1)
        return Frame(Status(status), bytes(payload))


@cocotb.test()
async def frames_come_out_as_they_came(dut) -> None:
    """Of every length and status, in their order; the first one waits after its latency."""
    bench = await Bench.started(dut)
    kept = []
    for k, length in enumerate((0, 1, 2, 5, 255, 256, 7, 3, 100)):
        frame = Frame(Status(k % 6), bytes(bench.draw.integers(0, 256, length, dtype="uint8")))
        await bench.frame(frame.payload, frame.status)
        assert LATENCY == 1 and bench.twin.waits
        kept.append(frame)
        if len(kept) == 3:
            assert [await bench.take(busy) for busy in (0, 1, 9)] == kept
            assert not bench.twin.waits
            kept.clear()


@cocotb.test()
async def a_command_more_is_lost_and_counted(dut) -> None:
    """Seven are kept, with or without one that is executed; what comes then is no harm."""
    bench = await Bench.started(dut)
    for executed in (False, True):
        await bench.start()
        for k in range(PLACES + 4):
            await bench.frame(bytes([k, 2 * k]))
            if executed and k == 0:
                await bench.clocks(take=1)
        assert bench.twin.counters["commands_lost"] == 4
        if executed:
            await bench.clocks(release=1)
        got = [await bench.take() for _ in range(PLACES - executed)]
        assert [frame.payload[0] for frame in got] == list(range(int(executed), PLACES))
        assert not bench.twin.waits
        await bench.frame(b"77")
        assert (await bench.take()).payload == b"77"
        assert bench.twin.counters["frames_good"] == min(PLACES + 5, 15)


@cocotb.test()
async def bad_frames_take_no_place_of_a_command(dut) -> None:
    """Any number of them: three commands still have their places."""
    bench = await Bench.started(dut)
    for k in range(10):
        await bench.frame(bytes(k % 5), 1 + k % 5)
    for k in range(PLACES - BAD_FRAME_PLACES + 1):
        await bench.frame(bytes([k]))
    got = [await bench.take() for _ in range(PLACES)]
    assert [int(frame.status) for frame in got] == [1, 2, 3, 4, 0, 0, 0]
    assert not bench.twin.waits
    assert bench.twin.counters["commands_lost"] == 1


@cocotb.test()
async def a_halt_drops_what_waits(dut) -> None:
    """But not what is executed, nor a frame that ends in its clock."""
    bench = await Bench.started(dut)
    for executed, released, ends in (
        (0, 0, 0), (0, 0, 1), (1, 0, 0), (1, 0, 1), (1, 1, 0), (1, 1, 1)
    ):  # fmt: skip
        await bench.start()
        for k in range(4):
            await bench.frame(bytes([k]))
        await bench.clocks(take=executed)
        await bench.clocks(valid=1, data=9)
        await bench.clocks(halt=1, done=ends, release=released)
        assert bench.twin.waits == bool(ends)
        # While one is executed, the places behind a halt are fewer, and none is written over.
        held = executed and not released
        room = PLACES - 4 * held
        for k in range(10, 20):
            await bench.frame(bytes([k]))
        if held:
            assert bench.twin.frame.payload == bytes([0])
            await bench.clocks(release=1)
        got = [await bench.take() for _ in range(room)]
        assert not bench.twin.waits
        # The byte of the frame that had begun is of the one that ended with the halt or behind it.
        first = [bytes([9])] if ends else [bytes([9, 10])]
        rest = [bytes([k]) for k in range(10 if ends else 11, 20)]
        assert [frame.payload for frame in got] == (first + rest)[:room]
        assert bench.twin.counters["commands_lost"] == 10 + ends - room


@cocotb.test()
async def counters_stop_at_their_largest(dut) -> None:
    """Frames that end in every clock."""
    bench = await Bench.started(dut)
    top = (1 << parameters()["CountWidth"]) - 1
    for status, counter in FRAME_COUNTERS.items():
        await bench.start()
        for _ in range(top + PLACES + 3):
            await bench.clocks(done=1, status=int(status))
        counted = {counter} | ({"commands_lost"} if status == Status.OK else set())
        assert bench.twin.counters == {name: top * (name in counted) for name in COUNTERS}


@cocotb.test()
async def anything_at_any_time(dut) -> None:
    """Bytes, ends, halts, and an executor of any speed, with resets: as the model."""
    bench = await Bench.started(dut)
    draw = bench.draw
    for _ in range(6000):
        chance = draw.random(6)
        done = chance[0] < 0.15
        halt = chance[1] < 0.01
        take = bench.twin.waits and not bench.executed and not halt and chance[2] < 0.3
        await bench.clocks(
            valid=not done and chance[3] < 0.7,
            data=int(draw.integers(256)),
            done=done,
            status=int(draw.choice([0, 0, 0, 1, 5])),
            halt=halt,
            take=take,
            release=bench.executed and chance[4] < 0.1,
            index=int(draw.integers(8)),
        )
        if chance[5] < 0.002:
            await bench.start(valid=1, done=int(draw.integers(2)))


def test_command_queue_rtl_equals_model() -> None:
    simulate("command_queue", __file__, {"CountWidth": 4})

"""m3_motor: every clock of the RTL against the model, with a stage whose replies are any bytes."""

from operator import attrgetter

import cocotb
from harness import EACH_VOLUME, Ports, TwinBench, generator, rounds, simulate

from vrscan.clocked.i2c_master import Status
from vrscan.clocked.m3_motor import BAD_REPLY, BEYOND, LIMIT, MOST_BYTES, MOTOR_ERROR, M3Motor

CALM = {
    "valid": 0, "read": 0, "target": 0, "byte_valid": 0, "byte": 0, "reply_valid": 0,
    "reply_status": 0,
}  # fmt: skip
OUTPUTS = ("busy", "valid", "command_valid", "motor_status", "last", "command_read", "byte")
OUTPUTS_OF = attrgetter(*OUTPUTS)
RESULTS = ("status", "position")
WITH_POSITION = (Status.OK, MOTOR_ERROR, LIMIT)
# Sent and received as the guide's examples have them, and what comes of it.
ON_TARGET, MOVING = 1 << 18, 1 << 19
FORWARD, REVERSE = 1 << 9, 1 << 10
STATUSES = (
    (0x300000 | ON_TARGET, Status.OK),
    (0x300004 | MOVING, Status.OK),
    (0x300000 | ON_TARGET | FORWARD, Status.OK),  # a target that is the limit
    (0x300004 | MOVING | REVERSE, Status.OK),  # away from it
    (0x300000 | FORWARD, LIMIT),
    (0x300000 | REVERSE, LIMIT),
    (0x300000 | 1 << 3, MOTOR_ERROR),
    (0x300000 | ON_TARGET | 1 << 16, MOTOR_ERROR),
    (0x300000 | FORWARD | 1 << 23, MOTOR_ERROR),
    (0, Status.OK),
    (0xFFFFFF & ~(1 << 3 | 1 << 16 | 1 << 23), Status.OK),  # all that says nothing, on target
)
POSITIONS = ((0, 0), (6000, 6000), (0xFFFF, 0xFFFF), (1 << 16, 0xFFFF), ((1 << 31) - 1, 0xFFFF),
             (-1, 0), (-2000, 0), (-(1 << 31), 0))  # fmt: skip


def reply(status: int, position: int, error: int = 0) -> bytes:
    """Return the reply to <10>."""
    mask = (1 << 32) - 1
    return b"<10 %06X %08X %08X>\r" % (status, position & mask, error & mask)


class Bench(TwinBench):
    """Translator and twin, compared every clock, and a master that takes and gives bytes."""

    strobes = ("valid", "byte_valid", "reply_valid")

    def __init__(self, dut, salt: int) -> None:
        super().__init__(dut, CALM)
        self.draw = generator(salt)
        self.outputs = Ports(dut, [f"{name}_o" for name in OUTPUTS])
        self.results = Ports(dut, [f"{name}_o" for name in RESULTS])

    async def start(self, **inputs: int) -> None:
        """Reset both."""
        await self.reset_to(M3Motor(), **CALM | inputs)
        self.give(**CALM)
        self.check()

    def check(self) -> None:
        twin, got, want = self.twin, self.outputs.read(), OUTPUTS_OF(self.twin)
        # What is sent is defined while it is sent, and whether it ends and is read during it.
        defined = len(OUTPUTS) if twin.byte is not None else -1 if twin.busy else -3
        got, want = got[:defined], want[:defined]
        assert got == want, f"clock {self.clock}: {OUTPUTS} {got}, want {want}, {self.inputs}"
        if twin.valid:
            status, position = self.results.read()
            assert status == twin.status, f"clock {self.clock}: {status}, want {twin.status}"
            if twin._read and status in WITH_POSITION:
                assert position == twin.position

    async def hear(self, most: int = 99) -> bytes:
        """Take the bytes of a command up to its last one, or some of them."""
        assert self.twin.command_valid and not self.twin.command_read
        heard = b""
        while not heard or (not self.twin.last and len(heard) < most):
            await self.clocks(2 + int(self.draw.integers(4)))
            heard += bytes([self.twin.byte])
            await self.clocks(byte_valid=1)
            await self.clocks()
        return heard

    async def say(self, text: bytes) -> int:
        """Give the bytes of a reply up to the last one that is asked for; behind it comes 0xFF."""
        assert self.twin.command_valid and self.twin.command_read
        for count in range(1, 100):
            await self.clocks(int(self.draw.integers(1, 5)))
            byte = text[count - 1] if count <= len(text) else 0xFF
            await self.clocks(byte_valid=1, byte=byte)
            self.give(byte=int(self.draw.integers(256)))
            await self.clocks()
            if self.twin.last:
                return count
        raise AssertionError("no end")

    async def end(self, status: Status = Status.OK) -> None:
        """End a stream, after which comes either the next one or the result."""
        await self.clocks(2)
        assert self.twin.busy and not self.twin.valid
        await self.clocks(reply_valid=1, reply_status=int(status))

    async def do(self, text: bytes, *, read: int, target: int = 0) -> tuple[int, bytes]:
        """Do a command that gets this reply; return its outcome and what was sent."""
        await self.clocks(valid=1, read=read, target=target)
        self.give(read=1 - read, target=target ^ 0xFFFF)
        heard = await self.hear()
        await self.end()
        await self.say(text)
        await self.end()
        assert self.twin.valid and not self.twin.busy
        return self.twin.status, heard


@cocotb.test()
async def targets_as_the_guide_writes_them(dut) -> None:
    """Its own example, the ends of the range, and each digit everywhere."""
    bench = await Bench.started(dut, 1)
    assert await bench.do(b"<08>\r", read=0, target=6000) == (Status.OK, b"<08 00001770>\r")
    for target in (0, 0xFFFF, 0x0123, 0x4567, 0x89AB, 0xCDEF, 0xFEDC, 0x2010):
        heard = (await bench.do(b"<08>\r", read=0, target=target))[1]
        assert heard[:4] + heard[12:] == b"<08 >\r"
        assert (int(heard[4:12], 16), heard) == (target, heard.upper())
    for text in (
        b"<24>\r",
        b"<23>\r",
        b"<08 00001770>\r",
        b"<10>\r",
        b"<08 \r",
        b"\r",
        b"",
        b"<08>",
    ):
        assert (await bench.do(text, read=0, target=7))[0] == BAD_REPLY, text
    assert bench.twin.motor_status == 0


@cocotb.test()
async def positions_and_states(dut) -> None:
    """What a stage says of itself; positions that have not 16 bits have a value and a flag."""
    bench = await Bench.started(dut, 2)
    for status, want in STATUSES:
        got, heard = await bench.do(reply(status, 6000, -3), read=1)
        assert (got, heard) == (want, b"<10>\r"), hex(status)
        assert (bench.twin.position, bench.twin.motor_status) == (6000, status)
    for status in (ON_TARGET, MOVING, 0):
        for position, want in POSITIONS:
            beyond = position != want
            got, _ = await bench.do(reply(status, position), read=1)
            assert got == (LIMIT if beyond and not status & ON_TARGET else Status.OK)
            assert bench.twin.position == want
            assert bench.twin.motor_status == status | beyond << BEYOND


@cocotb.test()
async def replies_that_are_none(dut) -> None:
    """Each byte wrong in many ways, cut, and never ending: told, and the last state is kept."""
    bench = await Bench.started(dut, 3)
    good = reply(0x34ABC5 & ~(1 << 16), 0x1E0F, 0x7F9A6)
    assert (await bench.do(good, read=1))[0] == Status.OK
    digits = b"0123456789ABCDEF"
    for place in range(MOST_BYTES):
        flipped = good[place] ^ 1 << int(bench.draw.integers(8))
        for byte in {flipped, *b"/:@G`g\x00\r"} - {good[place]}:
            if place > 3 and good[place] in digits and byte in digits:
                continue  # another number
            text = good[:place] + bytes([byte]) + good[place + 1 :]
            assert (await bench.do(text, read=1))[0] == BAD_REPLY, text
            assert bench.twin.motor_status & ~(1 << BEYOND) == 0x34ABC5 & ~(1 << 16)
    for length in range(MOST_BYTES):
        for tail in (b"", b"\r", b">\r"):
            if good[:length] + tail != good:
                assert (await bench.do(good[:length] + tail, read=1))[0] == BAD_REPLY
    assert (await bench.do(good + b"0", read=1))[0] == Status.OK, "it ends with its own end"
    # Nothing but what may follow, without an end.
    await bench.clocks(valid=1, read=1)
    await bench.hear()
    await bench.end()
    assert await bench.say(good[:-1] + b"0" * 99) == MOST_BYTES
    await bench.end()
    assert bench.twin.status == BAD_REPLY


@cocotb.test()
async def streams_that_fail(dut) -> None:
    """In both streams, anywhere: the master's status, and the next command is whole."""
    bench = await Bench.started(dut, 4)
    for status in Status:
        for read in (0, 1):
            for count in (1, 3):
                await bench.clocks(valid=1, read=read, target=0x1234)
                await bench.hear(count if status else 99)
                await bench.end(status)
                if not status:
                    await bench.say(reply(0, 5) if read else b"<08>\r")
                    await bench.end()
                assert (bench.twin.valid, bench.twin.status) == (True, status)
                await bench.clocks(valid=1, read=read, target=0x1234)
                await bench.hear()
                await bench.end()
                await bench.clocks(2)
                for byte in (reply(0, 5) if read else b"<08>\r")[:count]:
                    await bench.clocks(2, byte_valid=1, byte=byte)
                await bench.end(status or Status.ARBITRATION)
                assert bench.twin.status == (status or Status.ARBITRATION)
    assert await bench.do(b"<08>\r", read=0, target=1) == (Status.OK, b"<08 00000001>\r")


@cocotb.test()
async def reset_mid_stream(dut) -> None:
    """At every byte of a command and its reply: nothing is left."""
    bench = await Bench.started(dut, 5)
    for count in range(1, 5 + MOST_BYTES):
        await bench.do(reply(ON_TARGET, 77), read=1)
        await bench.clocks(valid=1, read=1)
        await bench.hear(min(count, 5))
        if count > 5:
            await bench.end()
            await bench.clocks(2)
            for byte in reply(ON_TARGET, 66)[: count - 5]:
                await bench.clocks(2, byte_valid=1, byte=byte)
        await bench.start(valid=1, byte_valid=1, reply_valid=1)
        assert not any((bench.twin.busy, bench.twin.motor_status))
        await bench.clocks(3)
        assert (await bench.do(b"<08>\r", read=0, target=1))[1] == b"<08 00000001>\r"


@cocotb.test()
async def anything_as_a_reply(dut) -> None:
    """Random replies, most of them nearly right: as the twin, which reads them by a pattern."""
    bench = await Bench.started(dut, 6)
    draw = bench.draw
    seen: set[int] = set()
    for _ in range(rounds(150, 5000)):
        read = int(draw.random() < 0.8)
        size = int(draw.choice([4, 16, 17, 32]))
        status = int(draw.integers(1 << 24)) & int(draw.integers(1 << 24))
        text = bytearray(reply(status, int(draw.integers(1 << size))))
        if not read:
            text = bytearray(b"<08>\r")
        if draw.random() < 0.3:
            place = int(draw.integers(len(text)))
            text[place] = int(draw.choice([*b"0F9A<> \r", int(draw.integers(256))]))
        seen.add((await bench.do(bytes(text), read=read, target=int(draw.integers(1 << 16))))[0])
        await bench.clocks(int(draw.integers(3)))
    assert seen == {Status.OK, BAD_REPLY, MOTOR_ERROR, LIMIT}, seen


@EACH_VOLUME
def test_m3_motor_rtl_equals_model(volume: str) -> None:
    simulate("m3_motor", __file__, volume=volume)

"""i2c_master: every clock of the RTL against the model, and the bus as a plain decoder reads it."""

from collections.abc import Iterator
from operator import attrgetter

import cocotb
import numpy as np
import pytest
from harness import (
    EACH_VOLUME,
    FallingEdge,
    Ports,
    UnitBench,
    generator,
    parameters,
    rounds,
    simulate,
)

from vrscan.clocked.i2c_master import (
    MIN_QUARTER,
    RECOVERY_CLOCKS,
    SEEN_LATENCY,
    I2cMaster,
    Status,
    command_clocks,
    most_clocks,
    stream_clocks,
)

ELABORATIONS = [{"TimeoutWidth": 24, "CountWidth": 16}, {"TimeoutWidth": 9, "CountWidth": 2}]
ADDRESS = 0x2A
PATIENCE = 300  # clocks
NONE = 15  # no byte is not acknowledged
COMMAND = {"read": 1, "address": 7, "register": 8, "bytes": 2, "data": 32}  # widths
STREAM = {"stream": 0, "byte": 0, "last": 0}
MOST = 32  # bytes of a stream without order
OTHERS = ("other_scl_low", "other_sda_low", "flip_scl", "flip_sda")
CALM = {
    "device_rst": 0,
    "valid": 0,
    "quarter": MIN_QUARTER,
    "timeout": PATIENCE,
    "device_address": ADDRESS,
    "nack_address": 0,
    "nack_byte": NONE,
    "stretch_clks": 0,
    "stretch_bits": 0,
    "hold_scl": 0,
    "hold_sda": 0,
    **dict.fromkeys(COMMAND, 0),
    **STREAM,
    **dict.fromkeys(OTHERS, 0),
}


class Decoder:
    """Reads the bus by the book, and how long the levels last.

    Attributes:
        seen: "S" for a start, "P" for a stop, a (byte, acknowledged) pair for nine bits.
        shortest_low, shortest_high: Of SCL, within a transaction.
        shortest_edge: From SCL's rise to a start or stop, and from a start to SCL's fall.
        rises: Of SCL.
        scl: Its level.
    """

    def __init__(self) -> None:
        self.seen: list[str | tuple[int, bool]] = []
        self.clear()
        self.scl = self._sda = True
        self._bits: list[bool] | None = None
        self._since_scl = self._since_start = 1 << 20

    def clear(self) -> None:
        """Forget what was seen."""
        self.seen = []
        self.shortest_low = self.shortest_high = self.shortest_edge = 1 << 20
        self.rises = 0

    def step(self, scl: bool, sda: bool) -> None:
        """Take a clock's levels."""
        if scl and self.scl and sda != self._sda:
            self.seen.append("P" if sda else "S")
            self._bits = None if sda else []
            self.shortest_edge = min(self.shortest_edge, self._since_scl)
            self._since_start = 0
        if scl and not self.scl:
            self.rises += 1
            self.shortest_low = min(self.shortest_low, self._since_scl)
            if self._bits is not None:
                self._bits.append(sda)
        if not scl and self.scl:
            self.shortest_edge = min(self.shortest_edge, self._since_start)
            if self._bits:
                self.shortest_high = min(self.shortest_high, self._since_scl)
            if self._bits is not None and len(self._bits) == 9:
                byte = int("".join(str(int(b)) for b in self._bits[:8]), 2)
                self.seen.append((byte, not self._bits[8]))
                self._bits = []
        self._since_scl = 1 if scl != self.scl else self._since_scl + 1
        self._since_start += 1
        self.scl, self._sda = scl, sda


def book(
    *, read: int, address: int, register: int, bytes: int, data: int
) -> list[str | tuple[int, bool]]:
    """Return what the bus shows of a command that goes well, ``data`` what it writes or reads."""
    payload = [(b, True) for b in data.to_bytes(4, "big")[3 - bytes :]]
    if not read:
        return ["S", (address << 1, True), (register, True), *payload, "P"]
    payload[-1] = (payload[-1][0], False)
    head = ["S", (address << 1, True), (register, True), "S", (address << 1 | 1, True)]
    return [*head, *payload, "P"]


OUTPUTS = (
    "ready", "valid", "scl_low", "sda_low", "recovery_count", "byte_valid", "status", "data",
)  # fmt: skip
OUTPUTS_OF = attrgetter(*OUTPUTS)
WITH_VALID = 2  # the last ones


class Bench(UnitBench):
    """Master, device and twin on one bus, compared every clock."""

    def __init__(self, dut, salt: int) -> None:
        self.dut = dut
        self.draw = generator(salt)
        self.inputs: dict[str, int | None] = {}
        self.decoder = Decoder()
        self.seen: dict[str, int] = {}
        self.outputs = Ports(dut, [f"{name}_o" for name in OUTPUTS])
        self.device = Ports(dut, ["device_scl_low_o", "device_sda_low_o"])
        self.byte = Ports(dut, ["byte_o"])
        self.given = {"read": 0}  # the command that runs

    def give(self, **inputs: int) -> None:
        """Change inputs."""
        for name, value in inputs.items():
            if self.inputs.get(name) != value:
                getattr(self.dut, f"{name}_i").value = value
                self.inputs[name] = value

    async def start(self, **inputs: int) -> None:
        """Reset master and device, and wait until the bus is seen."""
        self.give(**CALM)
        await self.restart(device=True)
        self.give(**inputs)
        await self.clocks(8)
        self.decoder.clear()

    async def restart(self, *, device: bool = False, **inputs: int) -> None:
        """Reset the master, or both, for a clock."""
        self.give(device_rst=int(device), **inputs)
        self.dut.rst_i.value = 1
        await FallingEdge(self.dut.clk_i)
        self.dut.rst_i.value = 0
        self.twin = I2cMaster(parameters()["CountWidth"])
        self.give(device_rst=0)
        self.clock = 0
        self.check()

    def check(self) -> None:
        """Compare all that is defined, and look at the device's pulls."""
        got, want = self.outputs.read(), OUTPUTS_OF(self.twin)
        if not self.twin.valid:
            got, want = got[:-WITH_VALID], want[:-WITH_VALID]
        assert got == want, f"clock {self.clock}: {OUTPUTS} {got}, want {want}, {self.inputs}"
        if self.twin.byte_valid and self.given["read"]:
            assert self.byte.read() == (self.twin.byte,), f"clock {self.clock}"
        self.pulls = self.device.read()

    async def clocks(self, count: int = 1, **inputs: int) -> None:
        """Go on by some clocks with these inputs."""
        self.give(**inputs)
        now = self.inputs
        for _ in range(count):
            scl = not (self.twin.scl_low or self.pulls[0] or now["other_scl_low"])
            sda = not (self.twin.sda_low or self.pulls[1] or now["other_sda_low"])
            await FallingEdge(self.dut.clk_i)
            self.twin.step(
                valid=bool(now["valid"]),
                read=bool(now["read"]),
                address=now["address"],
                register=now["register"],
                bytes=now["bytes"],
                data=now["data"],
                scl=scl != bool(now["flip_scl"]),
                sda=sda != bool(now["flip_sda"]),
                quarter=now["quarter"],
                timeout=now["timeout"],
                stream=bool(now["stream"]),
                byte=now["byte"],
                last=bool(now["last"]),
            )
            self.decoder.step(scl, sda)
            self.clock += 1
            self.check()

    def any_command(self, **fixed: int) -> dict[str, int]:
        """Return a random command, the data of a read any too."""
        drawn = {name: int(self.draw.integers(1 << width)) for name, width in COMMAND.items()}
        return {**drawn, "address": ADDRESS, **fixed}

    async def take(self, **command: int) -> None:
        """Give a command to the ready master, and noise on the command's inputs after it."""
        assert self.twin.ready
        self.bound = most_clocks(
            quarter=max(self.inputs["quarter"], MIN_QUARTER),
            timeout=self.inputs["timeout"],
            count=MOST + 1 if command.get("stream") else 6,
        )
        self.since = self.taken = 0
        self.given = {"stream": 0} | command
        await self.clocks(valid=1, **self.given)
        self.give(valid=0, **self.any_command(), stream=int(self.draw.integers(2)))

    async def clock_of_command(self, **inputs: int) -> bool:
        """Go on by a clock, and return whether the reply has come."""
        await self.clocks(**inputs)
        self.since += 1
        self.taken += self.twin.byte_valid
        assert self.since <= self.bound, f"no reply in {self.bound} clocks"
        if self.twin.valid:
            assert not (self.twin.scl_low or self.twin.sda_low)
            name = self.twin.status.name
            self.seen[name] = self.seen.get(name, 0) + 1
        return self.twin.valid

    async def reply(self) -> tuple[Status, int]:
        """Return status and data of the command that runs."""
        while not await self.clock_of_command():
            pass
        return self.twin.status, self.twin.data

    async def do(self, **command: int) -> tuple[Status, int]:
        """Do a command."""
        await self.take(**command)
        return await self.reply()

    async def stream(self, data: bytes = b"", count: int = 0) -> tuple[Status, bytes]:
        """Write a stream of bytes, or read one; what follows a byte comes as late as it may."""
        count = count or len(data)
        found = b""
        self.give(byte=data[0] if data else 0)
        await self.take(read=int(not data), address=ADDRESS, stream=1)
        done = False
        while not done:
            byte = self.twin.byte_valid
            if byte and not data:
                found += bytes([self.twin.byte])
            done = await self.clock_of_command()
            if byte:
                last = self.taken == count
                self.give(last=int(last), byte=0 if last or not data else data[self.taken])
        assert self.taken <= count
        self.give(**STREAM)
        return self.twin.status, found

    async def read(self, register: int, count: int) -> int:
        """Return what a read that has to go well gives."""
        status, data = await self.do(
            read=1, address=ADDRESS, register=register, bytes=count - 1, data=0
        )
        assert status is Status.OK, status.name
        return data


WRITE_ALL = {"read": 0, "address": ADDRESS, "register": 0x5A, "bytes": 3, "data": 0x81C3_00FE}


@cocotb.test()
async def the_bus_shows_what_was_asked_for(dut) -> None:
    """Random commands, some back to back, against a dictionary; levels and latencies."""
    bench = await Bench.started(dut, 1)
    memory = dict.fromkeys(range(256), 0)
    for k in range(rounds(30, 300)):
        quarter = int(bench.draw.choice([0, 3, 4, 5, 7, 11]))
        stretch = int(bench.draw.choice([0, 0, 1, 8, 40, 200]))
        bench.give(quarter=quarter, stretch_clks=stretch, stretch_bits=int(bench.draw.integers(2)))
        quarter = max(quarter, MIN_QUARTER)
        command = bench.any_command()
        count = command["bytes"] + 1
        if not command["read"] and command["register"] < 4:
            command["register"] = 4  # the motor's own are for another test
        if not command["read"] and command["register"] > 252:
            command["register"] = 252
        places = [(command["register"] + j) % 256 for j in range(count)]
        want = int.from_bytes([memory[p] for p in places], "big")
        bench.decoder.clear()
        status, data = await bench.do(**command)
        assert status is Status.OK, (k, status.name)
        if command["read"]:
            assert data == want, (k, hex(data), hex(want))
            command["data"] = data
        else:
            assert data == 0
            command["data"] &= (1 << 8 * count) - 1
            for place, byte in zip(places, command["data"].to_bytes(count, "big"), strict=True):
                memory[place] = byte
        assert bench.decoder.seen == book(**command), (k, bench.decoder.seen)
        assert bench.decoder.shortest_low >= 2 * quarter
        assert bench.decoder.shortest_high == 2 * quarter + SEEN_LATENCY + 1
        assert bench.decoder.shortest_edge >= 2 * quarter
        if not stretch:
            assert bench.decoder.shortest_low == 2 * quarter
            assert bench.since == command_clocks(
                read=bool(command["read"]), count=count, quarter=quarter
            )
        if k % 3 == 0:
            await bench.clocks(int(bench.draw.integers(1, 50)))
    assert bench.twin.recovery_count == 0


@cocotb.test()
async def streams_of_any_length(dut) -> None:
    """Bytes up to the last one, as the device has them; no register, no second start."""
    bench = await Bench.started(dut, 11)
    for count, quarter, stretch in ((1, 4, 0), (2, 5, 0), (3, 4, 40), (7, 4, 0), (40, 4, 0)):
        bench.give(quarter=quarter, stretch_clks=stretch)
        bench.decoder.clear()
        data = bytes([0x40, *bench.draw.integers(256, size=count - 1).tolist()])
        assert await bench.stream(data) == (Status.OK, b"")
        assert (bench.twin.data, bench.taken) == (0, count)
        payload = [(byte, True) for byte in data]
        assert bench.decoder.seen == ["S", (ADDRESS << 1, True), *payload, "P"]
        if not stretch:
            assert bench.since == stream_clocks(count=count, quarter=quarter)
        await bench.stream(b"\x40")
        bench.decoder.clear()
        found = await bench.stream(count=count)
        assert found[0] is Status.OK
        assert found[1][: count - 1] == data[1:]
        payload = [(byte, k < count - 1) for k, byte in enumerate(found[1])]
        assert bench.decoder.seen == ["S", (ADDRESS << 1 | 1, True), *payload, "P"]
        if not stretch:
            assert bench.since == stream_clocks(count=count, quarter=quarter)
        assert await bench.read(0x40, 1) == (data[1] if count > 1 else found[1][0])
    # A byte that is not acknowledged is the last one, and so is the address.
    bench.give(stretch_clks=0)
    for byte in range(4):
        bench.give(nack_byte=byte)
        bench.decoder.clear()
        assert await bench.stream(bytes(5)) == (Status.NACK_DATA, b"")
        assert bench.decoder.seen[-2:] == [(0, False), "P"]
        assert (bench.taken, len(bench.decoder.seen)) == (byte + 1, byte + 4)
    bench.give(nack_byte=NONE, nack_address=1)
    for data in (b"ab", b""):
        bench.decoder.clear()
        assert await bench.stream(data, 2) == (Status.NACK_ADDRESS, b"")
        assert bench.decoder.seen == ["S", (ADDRESS << 1 | (not data), False), "P"]


@cocotb.test()
async def a_motor_goes_to_its_target(dut) -> None:
    """The position is read while the motor moves, both bytes of one moment."""
    bench = await Bench.started(dut, 2)
    target = 0x0123
    assert (await bench.do(read=0, address=ADDRESS, register=0, bytes=1, data=target))[0] == 0
    before = -1
    while before != target:
        position = await bench.read(2, 2)
        assert before < position <= target
        before = position
    assert int(dut.position_o.value) == target


@cocotb.test()
async def bytes_that_are_not_acknowledged(dut) -> None:
    """The address, the register, and each data byte: the status, a stop, nothing after it."""
    bench = await Bench.started(dut, 3)
    for read in (0, 1):
        command = WRITE_ALL | {"read": read}
        bench.decoder.clear()
        status, data = await bench.do(**command | {"address": ADDRESS ^ 1})
        assert (status, data) == (Status.NACK_ADDRESS, 0)
        assert bench.decoder.seen == ["S", ((ADDRESS ^ 1) << 1, False), "P"]
        for byte in range(1 if read else 5):
            bench.decoder.clear()
            bench.give(nack_byte=byte)
            status, data = await bench.do(**command)
            bench.give(nack_byte=NONE)
            assert (status, data) == (Status.NACK_DATA, 0)
            good = book(**WRITE_ALL)
            assert bench.decoder.seen == [*good[: byte + 2], (good[byte + 2][0], False), "P"]
    # It is gone when it is to be read.
    bench.decoder.clear()
    await bench.take(**WRITE_ALL | {"read": 1})
    while bench.decoder.seen.count("S") < 2:
        await bench.clock_of_command()
    bench.give(nack_address=1)
    assert await bench.reply() == (Status.NACK_ADDRESS, 0)
    assert bench.decoder.seen[-2:] == [(ADDRESS << 1 | 1, False), "P"]
    bench.give(nack_address=0)
    assert await bench.read(0x5A, 4) == 0x81C3_0000, "the bytes that were acknowledged"


@cocotb.test()
async def stretching_up_to_the_limit(dut) -> None:
    """The longest that is waited for, and a clock more; the next command finds a free bus."""
    bench = await Bench.started(dut, 4, timeout=60)
    # Two quarters are low anyway; the device pulls a clock after SCL's fall.
    most = 2 * MIN_QUARTER - 1 + 60 - SEEN_LATENCY
    for bits in (0, 1):
        for stretch, status in ((most, Status.OK), (most + 1, Status.STRETCH_TIMEOUT)):
            for read in (0, 1):
                await bench.start(stretch_clks=stretch, stretch_bits=bits, timeout=60)
                assert (await bench.do(**WRITE_ALL | {"read": read}))[0] is status
                bench.give(stretch_clks=0)
                assert await bench.read(0, 1) == 0
                assert bench.twin.recovery_count <= 1


@cocotb.test()
async def a_device_that_holds_the_bus(dut) -> None:
    """SCL low is BUS_STUCK at once, SDA low after nine clocks; released, the next one works."""
    bench = await Bench.started(dut, 5, timeout=60)
    counts = (1 << parameters()["CountWidth"]) - 1
    for line, rises in (("hold_scl", 0), ("hold_sda", RECOVERY_CLOCKS)):
        await bench.start(timeout=60)
        await bench.clocks(20, **{line: 1})
        for again in range(5):
            bench.decoder.clear()
            assert (await bench.do(**WRITE_ALL))[0] is Status.BUS_STUCK
            assert bench.decoder.rises == rises, (line, bench.decoder.rises)
            assert bench.twin.recovery_count == (min(again + 1, counts) if rises else 0)
        await bench.clocks(20, **{line: 0})
        assert (await bench.do(**WRITE_ALL))[0] is Status.OK
        assert await bench.read(0x5A, 4) == WRITE_ALL["data"]
    # SDA is let go after every number of clocks of the recovery.
    for count in range(1, RECOVERY_CLOCKS + 1):
        await bench.start(timeout=60)
        await bench.clocks(20, hold_sda=1)
        bench.decoder.clear()
        await bench.take(**WRITE_ALL)
        while not bench.twin.valid:
            await bench.clock_of_command(hold_sda=int(bench.decoder.rises < count))
        assert bench.twin.status is Status.OK, count
        assert bench.twin.recovery_count == 1
        assert bench.decoder.rises == count + 1 + 54 + 1, "the clocks, a stop, the write"
    # SDA is high in every other clock, and low again in the stop after it.
    for first, rises in ((1, RECOVERY_CLOCKS + 1), (2, RECOVERY_CLOCKS)):
        await bench.start(timeout=60)
        await bench.clocks(20, other_sda_low=1)
        bench.decoder.clear()
        await bench.take(**WRITE_ALL)
        low = 1
        while not await bench.clock_of_command(other_sda_low=low):
            if not bench.decoder.scl:
                low = bench.decoder.rises % 2 ^ first % 2 ^ 1
        assert bench.twin.status is Status.BUS_STUCK
        assert bench.decoder.rises == rises
        await bench.clocks(20, other_sda_low=0)
    # SCL goes down, and SDA again, while it recovers.
    for line in ("hold_scl", "hold_sda"):
        for count in range(1, 60, 3):
            await bench.start(timeout=60)
            await bench.clocks(20, hold_sda=1)
            await bench.take(**WRITE_ALL)
            while not bench.twin.recovery_count:
                await bench.clock_of_command()
            bench.give(hold_sda=0)
            for _ in range(count):
                await bench.clock_of_command()
            bench.give(**{line: 1})
            assert (await bench.reply())[0] in (
                Status.BUS_STUCK,
                Status.STRETCH_TIMEOUT,
                Status.ARBITRATION,
            )
    assert bench.seen["BUS_STUCK"] > 20


@cocotb.test()
async def reset_mid_stream(dut) -> None:
    """The master stops anywhere; the device goes on from there, and the next command works.

    Every so many clocks of a write and a read, other ones in the other elaboration.
    """
    bench = await Bench.started(dut, 6, timeout=40)
    worst = 0
    recovered = 0
    seen = 0
    for read, most in ((0, command_clocks(read=False, count=1, quarter=4)), (1, 0)):
        most = most or command_clocks(read=True, count=1, quarter=4)
        for age in range(1 + parameters()["CountWidth"] % 5, most, rounds(15, 1)):
            await bench.start(timeout=40)
            await bench.take(read=read, address=ADDRESS, register=0x40, bytes=0, data=0x55)
            await bench.clocks(age)
            await bench.restart(valid=1)
            await bench.clocks(valid=0)
            status, _ = await bench.do(read=0, address=ADDRESS, register=0x50, bytes=0, data=0xA5)
            assert status is Status.OK, (read, age, status.name)
            worst = max(worst, bench.since)
            recovered += bench.twin.recovery_count
            seen += 1
    print(f"reset: {seen} ages, {recovered} recoveries, the next command at most {worst} clocks")
    assert recovered > rounds(1, 25)


@cocotb.test()
async def another_master(dut) -> None:
    """SDA low where a 1 was sent, SCL shortened, SCL in the way of a start or stop, a busy bus."""
    bench = await Bench.started(dut, 7)
    lost = 0
    total = command_clocks(read=True, count=1, quarter=4)
    for begin_clock in range(12, total, 11):
        await bench.start()
        await bench.take(read=1, address=ADDRESS, register=0xF7, bytes=0, data=0)
        for clock in range(begin_clock + 40):
            pulls = int(clock >= begin_clock)
            if await bench.clock_of_command(other_sda_low=pulls):
                break
        bench.give(other_sda_low=0)
        if not bench.twin.valid:
            await bench.reply()
        lost += bench.twin.status is Status.ARBITRATION
        await bench.clocks(20)
    assert lost > 15, lost
    # Another one's shorter high time is kept to, and the bits are right; not in a start or stop.
    for shorter, read in ((8, 0), (8, 1), (12, 0), (16, 0), (16, 1), (20, 0)):
        await bench.start(quarter=9)
        await bench.do(**WRITE_ALL)
        await bench.clocks(60)
        bench.decoder.clear()
        await bench.take(**WRITE_ALL | {"read": read})
        edges = (19, 65) if read else (55,)
        high = pulls = 0
        # SDA goes on with SCL's fall, the soonest that it may. The device goes on a clock later: of
        # two bits that differ that is a pulse, of two equal ones the wrong level.
        while not await bench.clock_of_command(other_scl_low=pulls, flip_sda=pulls):
            within = "S" in bench.decoder.seen and bench.decoder.rises not in edges
            high = high + 1 if bench.decoder.scl and within else 0
            pulls = int(not bench.twin.scl_low and (pulls or high == shorter))
        assert bench.twin.status is Status.OK, (shorter, read)
        assert bench.twin.data == (WRITE_ALL["data"] if read else 0)
        assert bench.decoder.seen == book(**WRITE_ALL | {"read": read})
        assert bench.decoder.shortest_high == shorter
        assert bench.decoder.shortest_low >= 2 * 9
    # SCL falls in the high time of the second start, and of the stop.
    for place in ("second start", "stop"):
        await bench.start(quarter=9)
        await bench.take(**WRITE_ALL | {"read": int(place != "stop"), "bytes": 0})
        rises = 19 if place != "stop" else 28
        while bench.decoder.rises < rises:
            await bench.clock_of_command()
        for _ in range(8):
            await bench.clock_of_command()
        bench.give(other_scl_low=1)
        assert (await bench.reply())[0] is Status.ARBITRATION, place
        await bench.clocks(20, other_scl_low=0)
    # Traffic without end, and SCL alone.
    await bench.start(timeout=90)
    await bench.take(**WRITE_ALL)
    while not bench.twin.valid:
        await bench.clock_of_command(other_scl_low=int(bench.clock // 8 % 2))
    assert bench.twin.status is Status.ARBITRATION
    assert bench.since < 90 + 16 + 8
    await bench.clocks(20, other_scl_low=0)
    # A bus that becomes free in time.
    await bench.clocks(20, other_sda_low=1)
    await bench.take(**WRITE_ALL)
    for clock in range(60):
        await bench.clock_of_command(other_sda_low=int(clock < 50))
    assert (await bench.reply())[0] is Status.OK
    assert bench.twin.recovery_count == 0


@cocotb.test()
async def two_masters_at_once(dut) -> None:
    """The twin as a second master: one gets through, and the other knows that it has not."""
    bench = await Bench.started(dut, 10)
    second = I2cMaster()
    results: list[Status] = []
    shared = {"read": False, "address": ADDRESS, "register": 0x60, "bytes": 3}
    won = [0, 0]

    def clock(**inputs: int) -> None:
        bench.give(other_scl_low=int(second.scl_low), other_sda_low=int(second.sda_low))
        give = {"valid": False, **shared, "data": 0, "quarter": 5, "timeout": 400}
        give["scl"] = not (bench.twin.scl_low or bench.pulls[0] or second.scl_low)
        give["sda"] = not (bench.twin.sda_low or bench.pulls[1] or second.sda_low)
        second.step(**give | inputs)
        if second.valid:
            results.append(second.status)

    for _ in range(16):
        data = [int(bench.draw.integers(1 << 32))] * 2
        data[1] ^= 1 << int(bench.draw.integers(32))
        results.clear()
        await bench.start(quarter=int(bench.draw.integers(4, 8)))
        for _ in range(20):
            clock()
            await bench.clocks()
        clock(valid=True, data=data[1])
        await bench.take(**shared, data=data[0])
        status = None
        while status is None or not results:
            clock()
            await bench.clocks()
            status = bench.twin.status if bench.twin.valid else status
        both = sorted([status, results[0]])
        assert both == [Status.OK, Status.ARBITRATION], both
        winner = int(results[0] is Status.OK)
        won[winner] += 1
        for _ in range(60):
            clock()
            await bench.clocks()
        assert await bench.read(0x60, 4) == data[winner]
    print(f"two masters: {won} won")
    assert min(won) > 1


@cocotb.test()
async def short_pulses_are_not_seen(dut) -> None:
    """Pulses of one and two clocks on both pins change no bit and no status."""
    bench = await Bench.started(dut, 8, quarter=10)
    for _ in range(6):
        data = int(bench.draw.integers(1 << 32))
        for read in (0, 1):
            await bench.take(read=read, address=ADDRESS, register=0x77, bytes=3, data=data)
            flips = short_pulses(bench.draw), short_pulses(bench.draw)
            while not await bench.clock_of_command(
                flip_scl=next(flips[0]), flip_sda=next(flips[1])
            ):
                pass
            assert bench.twin.status is Status.OK
        assert bench.twin.data == data
        bench.give(flip_scl=0, flip_sda=0)
    # Three clocks are a level: SDA high for three clocks of a bus that is low.
    await bench.start()
    for width in (2, 3):
        await bench.clocks(20, other_scl_low=1)
        await bench.take(**WRITE_ALL | {"bytes": 0})
        await bench.clocks(10)
        await bench.clocks(width, flip_scl=1)
        await bench.clocks(10, flip_scl=0)
        assert (await bench.reply())[0] is (Status.BUS_STUCK if width == 2 else Status.ARBITRATION)
        await bench.clocks(20, other_scl_low=0)


def short_pulses(draw: np.random.Generator) -> Iterator[int]:
    """Yield levels with pulses of one or two clocks, five or more apart."""
    while True:
        yield from [0] * int(draw.integers(5, 40))
        yield from [1] * int(draw.integers(1, 3))


@cocotb.test()
async def a_bus_without_any_order(dut) -> None:
    """Random pulls, pins, faults, commands and resets: as the twin, and always a reply in time."""
    bench = await Bench.started(dut, 9)
    draw = bench.draw
    for k in range(rounds(250, 2000)):
        if k % 10 == 0:
            await bench.restart(device=bool(k % 20), valid=int(draw.integers(2)))
            bench.give(valid=0)
        if not bench.twin.ready:
            bench.since, bench.bound = 0, 100_000
            await bench.reply()
        bench.give(
            quarter=int(draw.integers(4, 9)),
            timeout=int(draw.choice([0, 3, 20, 60, 300])),
            nack_byte=int(draw.integers(16)),
            stretch_clks=int(draw.choice([0, 0, 0, 10, 70])),
            stretch_bits=int(draw.integers(2)),
        )
        stream = int(draw.random() < 0.3)
        await bench.take(**bench.any_command(bytes=int(draw.integers(2)), stream=stream))
        rate = float(draw.choice([0, 0.0003, 0.002, 0.01, 0.06]))
        names = ["hold_scl", "hold_sda", *OTHERS]
        left = dict.fromkeys(names, 0)
        while True:
            for name, chance in zip(names, draw.random(6), strict=True):
                left[name] = max(left[name] - 1, 0)
                if chance < rate:
                    left[name] = int(draw.choice([1, 2, 3, 5, 30, 150]))
            if bench.twin.byte_valid:
                last = int(bench.taken >= MOST - 1 or draw.random() < 0.3)
                bench.give(byte=int(draw.integers(256)), last=last)
            if await bench.clock_of_command(**{name: int(n > 0) for name, n in left.items()}):
                break
        bench.give(**dict.fromkeys(names, 0))
    print(f"disorder: {bench.seen}")
    assert len(bench.seen) == len(Status), bench.seen


@EACH_VOLUME
@pytest.mark.parametrize("given", ELABORATIONS, ids=str)
def test_i2c_master_rtl_equals_model(given: dict[str, int], volume: str) -> None:
    simulate("i2c_bus", __file__, given, volume=volume)

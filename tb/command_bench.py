"""What the tests of commands share: payloads, and a bench that answers accesses."""

import abc

import numpy as np
from bus_registers import COUNT, FIRST, KEY, NOTHING, READ_ONLY, BusRegisters
from harness import Ports, TwinBench, as_integer, generator

from vrscan.clocked.command_executor import Answer

# The protocol in plain numbers.
PING, READ, WRITE, START, STOP, CAPTURE = 0x01, 0x02, 0x03, 0x10, 0x11, 0x12
OK, UNKNOWN, LENGTH, NO_ADDRESS, RO, LOCK, VALUE, BUSY, FRAME = range(9)
OPS = (PING, READ, WRITE, START, STOP, CAPTURE)

QUIET = {
    "halt": 0,
    "ready": 1,
    "bus_done": 0,
    "bus_status": 0,
    "bus_data": 0,
    "capture_busy": 0,
}
STROBES = ("stream_start", "stream_stop", "capture_start")


def u16(value: int) -> bytes:
    return value.to_bytes(2, "little")


def u32(*values: int) -> bytes:
    return b"".join(value.to_bytes(4, "little") for value in values)


def read(sequence: int, address: int, count: int) -> bytes:
    return bytes([READ, sequence]) + u16(address) + bytes([count])


def write(sequence: int, address: int, *words: int) -> bytes:
    return bytes([WRITE, sequence]) + u16(address) + u32(*words)


def random_payload(draw: np.random.Generator) -> bytes:
    """Return a command of any kind, right or wrong."""
    kind, sequence = draw.random(), int(draw.integers(256))
    address = int(draw.choice([FIRST, FIRST + COUNT - 2, READ_ONLY - 1, KEY, NOTHING, 0xFFFF]))
    if kind < 0.3:
        words = [int(v) for v in draw.integers(0, 150, int(draw.integers(1, 8)))]
        return write(sequence, address, *words)
    if kind < 0.6:
        return read(sequence, address, int(draw.integers(8)))
    if kind < 0.8:
        return bytes([int(draw.choice(OPS)), *draw.integers(0, 5, int(draw.integers(8)))])
    return bytes(draw.integers(0, 256, int(draw.integers(1, 40))).tolist())


class CommandBench(TwinBench):
    """Answers accesses, and keeps replies and strobes; a test's own class gives the commands."""

    strobes = ("halt", "bus_done")
    outputs = ("valid", "busy", "alive", "bus_valid", *STROBES)

    def __init__(self, dut, inputs: dict[str, int]) -> None:
        self.quiet = QUIET | inputs
        super().__init__(dut, self.quiet)
        self.draw = generator(1)
        self.ports = Ports(dut, [f"{name}_o" for name in self.outputs])

    async def begin(self, twin, **inputs: int) -> None:
        """Reset for a clock; the registers are new ones, too."""
        self.registers = BusRegisters()
        self.bus_latency = 3
        self.due: int | None = None
        self.answer = Answer(0, 0)
        self.reply = bytearray()
        self.replies: list[bytes] = []
        self.reply_clocks: list[int] = []  # of the first bytes
        self.events: list[tuple] = []
        self.alive = 0
        await self.reset_to(twin, **(self.quiet | inputs))
        self.check()
        self.give(**dict.fromkeys(self.strobes, 0))

    def want(self) -> list[int]:
        """Return the values of ``outputs``."""
        twin = self.twin
        want = [twin.valid, twin.busy, twin.alive, twin.bus is not None]
        return want + [name in twin.strobes for name in STROBES]

    def counters(self) -> dict[str, int]:
        """Return the counters."""
        return vars(self.twin.counters)

    def check(self) -> None:
        twin = self.twin
        got, want = self.ports.read(), tuple(self.want())
        assert got == want, f"clock {self.clock}, {self.inputs}: {self.outputs} {got}, want {want}"
        beside: dict[str, int] = {}
        if twin.valid:
            beside |= {"data": twin.data, "last": twin.last}
        if twin.bus:
            access, address, data = twin.bus
            beside |= {"bus_access": access, "bus_address": address}
            if access:
                beside["bus_data"] = data
        if twin.strobes or self.clock % 16 == 0:
            beside |= twin.strobe_values | self.counters()
        for name, value in beside.items():
            shown = as_integer(getattr(self.dut, f"{name}_o"))
            assert shown == value, f"clock {self.clock}, {self.inputs}: {name} {shown}, not {value}"
        self.alive += twin.alive
        for strobe in STROBES:
            if strobe in twin.strobes:
                self.events.append((strobe, dict(twin.strobe_values)))

    async def clocks(self, count: int = 1, **inputs: int) -> None:
        """Go on, with an answer to each access after its time, and with what is sent kept."""
        for _ in range(count):
            answered = self.due == 0
            bus = {"bus_done": answered}
            if answered:
                bus |= {"bus_status": self.answer.status, "bus_data": self.answer.data}
            elif self.draw.random() < 0.1:
                bus |= {"bus_status": int(self.draw.integers(9)), "bus_data": 0x5A5A_5A5A}
            had = self.twin.valid
            if had and inputs.get("ready", self.inputs["ready"]):
                self.reply.append(self.twin.data)
                if self.twin.last:
                    self.replies.append(bytes(self.reply))
                    self.reply.clear()
            await self.clock_with(**(bus | inputs))
            if self.twin.valid and not had and not self.reply:
                self.reply_clocks.append(self.clock)
            self.due = self.due - 1 if self.due else None
            if self.twin.bus:
                self.answer = self.registers(self.twin.bus)
                self.due = self.bus_latency

    async def clock_with(self, **inputs: int) -> None:
        """Go on by one clock with these inputs."""
        await TwinBench.clocks(self, 1, **inputs)

    async def rest(self) -> None:
        """Go on until nothing is left to do."""
        for _ in range(200_000):
            await self.clocks()
            if not self.twin.busy and not self.twin.valid:
                break
        else:
            raise AssertionError("it is busy for ever")
        await self.clocks(16 - self.clock % 16)

    @abc.abstractmethod
    async def payload(self, payload: bytes, status: int = 0) -> None:
        """Give a payload, and how its frame ended."""

    async def asked(self, payload: bytes, status: int = 0) -> bytes:
        """Return the one reply to a payload."""
        self.replies.clear()
        self.events.clear()
        self.alive = 0
        await self.payload(payload, status)
        await self.rest()
        assert len(self.replies) == 1, self.replies
        return self.replies[0]

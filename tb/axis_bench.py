"""What the tests of AXI4-Streams share: a twin in every clock, and a sink that is another's."""

from dataclasses import dataclass
from random import Random

import numpy as np
from cocotb.task import resume
from cocotbext.axi import AxiLiteBus, AxiLiteMaster, AxiStreamBus, AxiStreamSink
from harness import FallingEdge, Ports, TwinBench

from vrscan.clocked.axil_registers import OKAY
from vrscan.link.axi import AxiDevice, BusError

NAMES = ("valid", "data", "last", "user")


class AxisBench(TwinBench):
    """Drives a module with an AXI4-Stream, and compares the stream with the twin's."""

    prefix = "m_axis"

    def __init__(self, dut, inputs) -> None:
        super().__init__(dut, [*inputs, "ready"])
        self.outputs = Ports(dut, [f"{self.prefix}_t{name}" for name in NAMES])
        self.packets: list[tuple[tuple[int, ...], int]] = []
        self.words: list[int] = []

    @property
    def stream(self):
        """The twin of the stream, or the twin's part that is one."""
        return getattr(self.twin, "stream", self.twin)

    def give(self, **inputs: int) -> None:
        ready = inputs.pop("ready", self.inputs["ready"])
        if ready != self.inputs["ready"]:
            getattr(self.dut, f"{self.prefix}_tready").value = ready
            self.inputs["ready"] = ready
        super().give(**inputs)

    def check(self) -> None:
        got, stream = self.outputs.read(), self.stream
        want = tuple(int(getattr(stream, name)) for name in NAMES)
        if not stream.valid:
            got, want = got[:1], want[:1]
        assert got == want, f"clock {self.clock}, {self.inputs}: {NAMES} {got}, want {want}"

    async def tick(self, **inputs: int) -> None:
        """Go on by a clock, and keep what the reader takes in it."""
        self.give(**inputs)
        if self.stream.valid and self.inputs["ready"]:
            self.words.append(self.stream.data)
            if self.stream.last:
                self.packets.append((tuple(self.words), self.stream.user))
                self.words.clear()
        await self.clocks()


class BridgedWords:
    """The registers as memory for ``AxiDevice``, in whose thread the simulation goes on."""

    def __init__(self, dut, reset: str = "rst_i") -> None:
        bus = AxiLiteBus.from_prefix(dut, "s_axil")
        master = AxiLiteMaster(bus, dut.clk_i, getattr(dut, reset))

        async def read(address: int) -> int:
            answer = await master.read(4 * address, 4)
            if int(answer.resp) != OKAY:
                raise BusError
            return int.from_bytes(answer.data, "little")

        async def write(address: int, word: int) -> None:
            answer = await master.write(4 * address, word.to_bytes(4, "little"))
            if int(answer.resp) != OKAY:
                raise BusError

        self.read, self.write = resume(read), resume(write)


def connected(words: BridgedWords) -> AxiDevice:
    """Return the device, behind the commit that a reset makes."""
    device = AxiDevice(words)
    while device.read("commit_waiting"):
        pass
    return device


@dataclass(frozen=True)
class Packet:
    """A packet as a sink has received it."""

    data: bytes
    user: int


async def send_lines(dut, lines: np.ndarray, gap: int) -> None:
    """Give a module's pins the pixels of lines, a pixel a clock, and so many clocks behind each."""
    for line in lines:
        for k, pixel in enumerate(line):
            dut.line_start_i.value, dut.line_end_i.value = int(k == 0), int(k == len(line) - 1)
            dut.pixel_valid_i.value, dut.pixel_i.value = 1, int(pixel)
            await FallingEdge(dut.clk_i)
        dut.line_end_i.value = dut.pixel_valid_i.value = 0
        for _ in range(gap):
            await FallingEdge(dut.clk_i)


def sink_of(dut, prefix: str, *, seed: int, pauses: float, reset: str = "rst_i") -> AxiStreamSink:
    """Return a sink on a stream, which pauses at random for a share of the clocks."""
    draw = Random(seed)
    bus = AxiStreamBus.from_prefix(dut, prefix)
    sink = AxiStreamSink(bus, dut.clk_i, getattr(dut, reset), byte_lanes=len(bus.tdata) // 8)
    sink.set_pause_generator(iter(lambda: draw.random() < pauses, None))
    return sink


def received(sink: AxiStreamSink) -> list[Packet]:
    """Return the packets that have come, of which each word has the same user bits."""
    packets = []
    while not sink.empty():
        frame = sink.recv_nowait()
        users = frame.tuser if isinstance(frame.tuser, list) else [frame.tuser]
        assert len(set(users)) == 1, f"user bits change within a packet: {users}"
        packets.append(Packet(bytes(frame.tdata), int(users[0])))
    return packets

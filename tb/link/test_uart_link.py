"""uart_link: every clock of the RTL against the model, with a host at the other end of the line."""

from collections import deque

import cocotb
import pytest
from bus_registers import FIRST, BusRegisters
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, Timer
from frame_oracle import random_bytes
from harness import (
    CLOCK_NS,
    EACH_VOLUME,
    Ports,
    TwinBench,
    as_integer,
    each,
    generator,
    parameters,
    port,
    rounds,
    simulate,
)

from vrscan.clocked.command_server import Answer, answer
from vrscan.clocked.frame_decoder import Status as FrameStatus
from vrscan.clocked.uart_link import (
    COUNT_MAX,
    MOST_BEFORE_REPLY,
    STREAM_BYTES,
    UartLink,
    default_step,
    latency,
)
from vrscan.clocked.uart_rx import UartRx
from vrscan.clocked.uart_tx import UartTx
from vrscan.data import link_pkg
from vrscan.link.protocol import (
    BAD_FRAME,
    CaptureMode,
    Command,
    FrameReader,
    capture,
    command,
    encode_frame,
    read,
    stream_start,
    write,
)
from vrscan.registers.register_map import REGISTERS

ELABORATIONS = [
    {"ClockHz": 8_000_000, "Baud": 1_000_000, "TrialClks": 8_000, "Streams": 2},
    {"ClockHz": 27_000_000, "Baud": 3_000_000, "TrialClks": 9_000, "Streams": 1},
]
ONE = 1 << 24
UART_STEP = 0x1F0  # where this test has the register
BUS_LATENCY = 9

QUIET = {
    "rx": 1,
    "packet_valid": 0,
    "packet_data": 0,
    "packet_last": 0,
    "bus_done": 0,
    "bus_status": 0,
    "bus_data": 0,
    "capture_busy": 0,
    "uart_step": 0,
    "uart_step_strobe": 0,
}
STROBES = ("stream_start", "stream_stop", "capture_start")
COUNTS = {
    "uart_framing": "framing",
    "uart_breaks": "breaks",
    "uart_glitches": "glitches",
    "uart_fallbacks": "fallbacks",
}


class Bench(TwinBench):
    """A host, the registers and sources of packets around the link."""

    strobes = ("bus_done", "uart_step_strobe")

    def __init__(self, dut) -> None:
        super().__init__(dut, QUIET)
        self.draw = generator(1)
        given = parameters()
        self.streams = given["Streams"]
        self.trial = given["TrialClks"]
        self.default = default_step(given["ClockHz"], given["Baud"])
        self.dut_names = ["tx", "packet_ready", "bus_valid", "alive", "uart_step_now", *STROBES]
        self.outputs = Ports(dut, [f"{name}_o" for name in self.dut_names])

    async def start(self, **inputs: int) -> None:
        """Reset for a clock; the host and all around are new ones, too."""
        given = parameters()
        self.registers = BusRegisters()
        self.registers.words[UART_STEP] = 0
        self.due: int | None = None
        self.answer = Answer(0, 0)
        self.written = False
        self.waiting: list[deque[bytes]] = [deque() for _ in range(self.streams)]
        self.place = [0] * self.streams
        self.events: list[str] = []
        self.alive = 0

        self.host_step = self.default
        self.host_tx = UartTx()
        self.host_rx = UartRx()
        self.to_send: deque[int] = deque()
        self.breaking = False
        self.level: int | None = None  # put on the line instead
        self.bytes = bytearray()  # what the host received
        self.reader = FrameReader()
        self.payloads: list[bytes] = []
        self.tx_falls: list[int] = []
        self.rx_falls: list[int] = []
        twin = UartLink(given["ClockHz"], given["Baud"], given["TrialClks"], self.streams)
        await self.reset_to(twin, **(QUIET | inputs))
        self.give(bus_done=0, uart_step_strobe=0)
        self.check()

    def check(self) -> None:
        twin, dut, server = self.twin, self.dut, self.twin.server
        names = self.dut_names
        want = [twin.tx, twin.packet_ready(), server.bus is not None, server.alive, twin.step_now]
        want += [name in server.strobes for name in STROBES]
        got = list(self.outputs.read())
        if server.bus:
            names = [*names, "bus_access", "bus_address"]
            want += server.bus[:2]
        if server.strobes:
            names = [*names, *server.strobe_values]
            want += server.strobe_values.values()
        if self.clock % 128 == 0:
            names = [*names, *COUNTS, *vars(server.counters)]
            want += [getattr(twin, name) for name in COUNTS.values()]
            want += vars(server.counters).values()
        got += [as_integer(port(dut, f"{name}_o")) for name in names[len(got) :]]
        assert got == [int(value) for value in want], (
            f"clock {self.clock}, {self.inputs}: {names} {got}, want {want}"
        )
        self.events += sorted(server.strobes)
        self.alive += server.alive

    def _packets(self) -> dict[str, int]:
        """Return what the sources of packets have on their ports."""
        valid = data = last = 0
        for k, waiting in enumerate(self.waiting):
            if waiting:
                valid |= 1 << k
                last |= (self.place[k] == len(waiting[0]) - 1) << k
                data |= waiting[0][self.place[k]] << 8 * k
        return {"packet_valid": valid, "packet_data": data, "packet_last": last}

    async def clocks(self, count: int = 1, **inputs: int) -> None:
        """Go on by some clocks, with all that is around the link."""
        for _ in range(count):
            bus = {"bus_done": self.due == 0, "uart_step_strobe": self.written}
            if self.due == 0:
                bus |= {"bus_status": self.answer.status, "bus_data": self.answer.data}
            bus["uart_step"] = self.registers.words[UART_STEP]
            rx = self.host_tx.tx if self.level is None else bool(self.level)
            if self.inputs["rx"] and not rx:
                self.rx_falls.append(self.clock + 1)  # sampled then
            packets = self._packets()
            taken = packets["packet_valid"] & self.twin.packet_ready()
            had = self.twin.tx
            await super().clocks(1, rx=rx, **packets, **bus, **inputs)

            if had and not self.twin.tx:
                self.tx_falls.append(self.clock)
            for k, waiting in enumerate(self.waiting):
                if taken >> k & 1:
                    self.place[k] += 1
                    if self.place[k] == len(waiting[0]):
                        waiting.popleft()
                        self.place[k] = 0
            self.written = False
            self.due = self.due - 1 if self.due else None
            if self.twin.server.bus:
                access = self.twin.server.bus
                self.answer = self.registers(access)
                self.due = BUS_LATENCY
                self.written = access[:2] == (link_pkg.ACCESS_WRITE, UART_STEP)
            self._host()

    def _host(self) -> None:
        """Let the host do a clock."""
        self.host_rx.step(rx=self.twin.tx, step=self.host_step)
        if self.host_rx.valid:
            byte = bytes([self.host_rx.data])
            self.bytes += byte
            self.payloads += self.reader.feed(byte)
        byte = self.to_send[0] if self.to_send else 0
        if self.to_send and self.host_tx.ready:
            self.to_send.popleft()
            self.host_tx.step(valid=True, data=byte, step=self.host_step, break_=self.breaking)
        else:
            self.host_tx.step(valid=False, data=0, step=self.host_step, break_=self.breaking)

    def bits(self, count: float) -> int:
        """Return the clocks of so many bits at the host's rate."""
        return int(count * ONE / self.host_step) + 1

    async def send(self, data: bytes) -> None:
        """Send bytes and wait until the last one is out."""
        self.to_send.extend(data)
        while self.to_send or self.host_tx.busy:
            await self.clocks()

    async def until_quiet(self, bits: int = 25) -> None:
        """Go on until the line from the board has rested for so long."""
        rest = 0
        while rest < self.bits(bits):
            await self.clocks()
            rest = rest + 1 if self.twin.tx else 0

    async def asked(self, payload: bytes) -> bytes:
        """Send a command with a 0x00 in front, and return its reply."""
        self.payloads.clear()
        await self.send(b"\0" + encode_frame(payload))
        for _ in range(self.bits(6000)):
            await self.clocks()
            found = [p for p in self.payloads if p[0] == payload[0] | link_pkg.REPLY_BIT]
            if found:
                return found[0]
        raise AssertionError(f"no reply to {payload.hex()}, but {self.payloads}")

    async def pinged(self, sequence: int) -> None:
        """Assert that a PING is answered."""
        assert await self.asked(command(Command.PING, sequence)) == bytes([0x81, sequence, 0])

    async def wait_for_step(self, step: int, most: int = 1000) -> None:
        """Wait until the rate is another one."""
        for _ in range(most):
            if self.twin.step_now == step:
                return
            await self.clocks()
        raise AssertionError(f"the rate is {self.twin.step_now}, not {step}")

    async def change_rate(self, step: int) -> None:
        """Ask for a rate, and take it when the reply is there."""
        reply = await self.asked(command(Command.WRITE, 1, write(UART_STEP, [step])))
        assert reply == bytes([0x83, 1, 0, 1]) + step.to_bytes(4, "little")
        self.host_step = step
        await self.wait_for_step(step)

    def packet(self, kind: int, length: int = STREAM_BYTES) -> bytes:
        """Return a packet of a stream that tells its kind."""
        return bytes([kind]) + random_bytes(self.draw, length - 1, 0.02)


@cocotb.test()
async def commands_and_replies(dut) -> None:
    """Over the line, with their latencies; a 0x00 in front of the very first frame."""
    bench = await Bench.started(dut)
    assert bench.twin.step_now == bench.default
    await bench.clocks(bench.bits(3))
    want = b"\0"
    for number, (operation, data) in enumerate(
        [
            (Command.PING, b""),
            (Command.PING, b"\1" * 20),
            (Command.WRITE, write(FIRST, [0x0403_0201])),
            (Command.READ, read(FIRST, 2)),
            (Command.READ, read(0xFFFF, 1)),
            (Command.STREAM_START, stream_start(True, 9)),
            (Command.CAPTURE, capture(CaptureMode.LINE, 77)),
            (Command.STREAM_STOP, b""),
            (Command.STREAM_STOP, b"?"),
            (99, b""),
        ],
        1,
    ):
        payload = command(operation, number, data)
        coded = encode_frame(payload)
        outcome = answer(payload, BusRegisters())
        if operation == Command.READ and outcome.status == 0:
            outcome = answer(payload, lambda access: Answer(0, 0x0403_0201 * (access[1] == FIRST)))
        accesses = {Command.WRITE: 2, Command.READ: 1 + outcome.status % 3 % 2}.get(operation, 0)
        if operation == Command.READ:
            accesses = 1 if outcome.status else 2
        # The 0x00 stands apart, so that its start bit is known.
        await bench.send(coded[:-1])
        await bench.clocks(bench.bits(2))
        bench.rx_falls.clear()
        bench.tx_falls.clear()
        await bench.send(coded[-1:])
        await bench.until_quiet(40)
        clocks = latency(bench.default, payload, outcome, accesses, BUS_LATENCY)
        assert bench.tx_falls[0] - bench.rx_falls[0] == clocks, payload.hex()
        assert bench.payloads[-1] == outcome.reply
        want += encode_frame(outcome.reply)
        assert bench.bytes == want
    assert bench.events == ["stream_start", "capture_start", "stream_stop"]
    assert bench.alive == 8 and bench.reader.bad.total() == 0
    counters = bench.twin.server.counters
    assert counters.frames_good == 10 and counters.commands_bad == 2


@cocotb.test()
async def commands_back_to_back_on_a_full_line(dut) -> None:
    """As many as wait, without a gap, while every stream has packets: all come, and come whole."""
    bench = await Bench.started(dut)
    sent = [bench.packet(0x40 + k, 60) for k in range(bench.streams) for _ in range(6)]
    for packet in sent:
        bench.waiting[packet[0] - 0x40].append(packet)
    await bench.clocks(200)
    commands = [command(Command.PING, k, bytes([k])) for k in range(8)]
    await bench.send(b"\0" + b"".join(encode_frame(payload) for payload in commands))
    await bench.until_quiet()
    replies = [p for p in bench.payloads if p[0] == 0x81]
    assert replies == [bytes([0x81, k, 0, k]) for k in range(8)]
    for k in range(bench.streams):
        mine = [p for p in bench.payloads if p[0] == 0x40 + k]
        assert mine == [p for p in sent if p[0] == 0x40 + k]
    assert bench.reader.bad.total() == 0
    assert bench.twin.server.counters.commands_lost == 0


@cocotb.test()
async def a_reply_waits_for_one_packet_and_the_encoder(dut) -> None:
    """Streams that fill the line for ever, a command at any moment."""
    bench = await Bench.started(dut)
    most = 0
    bound = MOST_BEFORE_REPLY + len(encode_frame(bytes([0x81, 0, 0])))
    for k in range(bench.streams):
        count = rounds(12, 60) // bench.streams
        bench.waiting[k].extend(bench.packet(0x40 + k) for _ in range(count))
    await bench.clocks(bench.bits(2500))
    for number in range(rounds(2, 12)):
        await bench.send(encode_frame(command(Command.PING, number)))
        at = len(bench.bytes)
        asked = bench.clock
        while not any(p[:2] == bytes([0x81, number]) for p in bench.payloads):
            await bench.clocks()
        most = max(most, len(bench.bytes) - at)
        assert len(bench.bytes) - at <= bound
        assert bench.clock - asked <= bench.bits(10 * bound)
        await bench.clocks(int(bench.draw.integers(bench.bits(1500))))
    assert any(bench.waiting)
    print(f"bytes until a reply's last one, on a full line: {most} measured / {bound} bound")


@cocotb.test()
async def noise_on_the_line(dut) -> None:
    """Levels without order, and then a command: it is answered, nothing else was done."""
    bench = await Bench.started(dut)
    for number in range(12):
        bit = ONE / bench.default
        for length in bench.draw.exponential(bit * (0.3 if number % 2 else 2), 50):
            bench.level = int(not bench.inputs["rx"])
            await bench.clocks(1 + int(length))
        bench.level = 1
        await bench.clocks(bench.bits(12))
        bench.level = None
        await bench.pinged(number)
        assert bench.twin.step_now == bench.default
    counters = bench.twin.server.counters
    assert counters.frames_good == 12 and counters.commands_bad == 0
    assert bench.twin.framing > 5 and bench.twin.glitches > 5
    bad = [p for p in bench.payloads if p[0] == BAD_FRAME]
    assert all(len(p) == 4 for p in bad)
    assert set(bench.events) <= {"stream_stop", "capture_start"}


@cocotb.test()
async def frames_cut_at_every_length(dut) -> None:
    """The rest is told to be bad, and the next command is answered."""
    bench = await Bench.started(dut)
    whole = encode_frame(command(Command.WRITE, 9, write(FIRST, [1])))
    for cut in range(1, len(whole) - 1, 2):
        bench.payloads.clear()
        await bench.send(whole[:cut])
        await bench.send(b"\0" + encode_frame(command(Command.PING, cut)))
        await bench.until_quiet()
        assert [p[:2] for p in bench.payloads] == [b"\xff\0", bytes([0x81, cut])]
    assert bench.registers.words[FIRST] == 0 and not bench.registers.accesses


@cocotb.test()
async def a_break_stops_all(dut) -> None:
    """Streams, capture, a rate that is wanted or tried; the frame that it broke is bad."""
    bench = await Bench.started(dut)
    other = bench.default * 3 // 4
    await bench.change_rate(other)
    await bench.pinged(1)
    await bench.send(encode_frame(command(Command.PING, 2))[:-2])
    bench.payloads.clear()
    bench.events.clear()
    bench.breaking = True
    await bench.clocks(bench.bits(10.5))
    assert bench.twin.step_now == bench.default and bench.twin.breaks == 1
    assert bench.events == ["capture_start", "stream_stop"]
    assert bench.twin.server.strobe_values["capture_mode"] == CaptureMode.STOP
    await bench.clocks(bench.bits(30))
    assert bench.twin.breaks == 1
    bench.breaking = False
    bench.host_step = bench.default
    bench.host_rx = UartRx()
    await bench.until_quiet()
    await bench.pinged(3)
    assert bench.twin.server.counters.frames_framing == 1

    # While a change waits for the line, which a stream fills.
    bench.waiting[0].append(bench.packet(0x40))
    await bench.clocks(50)
    await bench.send(encode_frame(command(Command.WRITE, 1, write(UART_STEP, [other]))))
    await bench.clocks(bench.bits(100))
    assert bench.twin.step_now == bench.default
    bench.breaking = True
    await bench.clocks(bench.bits(15))
    bench.breaking = False
    await bench.until_quiet()
    await bench.clocks(bench.trial)
    assert bench.twin.step_now == bench.default and bench.twin.breaks == 2
    await bench.pinged(4)

    # In the trial: it does not come to an end later, either.
    await bench.change_rate(other)
    bench.breaking = True
    await bench.clocks(bench.bits(15))
    bench.breaking = False
    assert bench.twin.step_now == bench.default
    await bench.clocks(bench.trial + 100)
    assert bench.twin.fallbacks == 0


@cocotb.test()
async def the_rate_changes_when_all_is_out(dut) -> None:
    """Not before the reply's last bit; streams wait for it, and go on at the new rate."""
    bench = await Bench.started(dut)
    for step in (bench.default // 2, bench.default * 9 // 10, bench.default):
        for k in range(bench.streams):
            bench.waiting[k].extend(bench.packet(0x40 + k, 50) for _ in range(12))
        await bench.clocks(300)
        before = bench.twin.step_now
        await bench.send(b"\0" + encode_frame(command(Command.WRITE, 7, write(UART_STEP, [step]))))
        while bench.twin.step_now == before:
            await bench.clocks()
        # The reply is what came last, whole, and nothing of another frame behind it.
        assert bench.payloads[-1] == bytes([0x83, 7, 0, 1]) + step.to_bytes(4, "little")
        assert any(bench.waiting)
        assert bench.twin.tx and bench.reader.bad.total() == 0
        bench.host_step = step
        at = len(bench.bytes)
        for waiting in bench.waiting:
            while len(waiting) > 2:
                waiting.pop()
        # Nobody has been heard at that rate yet.
        await bench.clocks(bench.trial // 2)
        assert len(bench.bytes) == at and any(bench.waiting)
        await bench.pinged(9)
        # With a 0x00 in front.
        assert bench.bytes[at] == 0
        await bench.until_quiet()
        assert not any(bench.waiting) and bench.reader.bad.total() == 0
        # A good frame: it holds for good.
        await bench.clocks(bench.trial + 10)
        assert bench.twin.step_now == step
    assert bench.twin.fallbacks == 0


@cocotb.test()
async def a_rate_without_a_good_frame_is_given_up(dut) -> None:
    """After TrialClks, to the clock; bad frames do not help; the same rate can be tried anew."""
    bench = await Bench.started(dut)
    other = bench.default * 2 // 3
    for number in range(3):
        await bench.change_rate(other)
        at = bench.clock
        if number == 1:
            await bench.send(b"\0" + encode_frame(b"\1\1")[:-2] + b"\0")
            assert bench.twin.server.counters.frames_good == number + 1
        await bench.wait_for_step(bench.default, bench.trial + 1)
        # The change was seen in the clock that it came.
        assert bench.clock - at == bench.trial
        assert bench.twin.fallbacks == number + 1
        bench.host_step = bench.default
        await bench.until_quiet()
    # The last moment is good enough.
    await bench.change_rate(other)
    at = bench.clock
    coded = encode_frame(command(Command.PING, 8))
    await bench.send(b"\0" + coded[:-1])
    good = 10 + bench.twin.server.counters.frames_good
    while bench.clock - at < bench.trial - bench.bits(12):
        await bench.clocks()
    await bench.send(b"\0")
    await bench.until_quiet()
    assert bench.twin.server.counters.frames_good == good - 9
    await bench.clocks(bench.trial)
    assert bench.twin.step_now == other and bench.twin.fallbacks == 3
    # One rate after another, without going back.
    await bench.change_rate(bench.default // 3)
    await bench.pinged(1)
    await bench.change_rate(other)
    await bench.pinged(2)


@cocotb.test()
async def faults_of_bytes_are_counted(dut) -> None:
    """A byte without a stop bit spoils its frame; a 0x00 goes in front of the next frame out."""
    bench = await Bench.started(dut)
    await bench.pinged(1)
    coded = encode_frame(command(Command.PING, 2))
    await bench.send(coded[:2])
    bits = [0, *(coded[2] >> k & 1 for k in range(8)), 0, 1]
    for k, bit in enumerate(bits):
        bench.level = bit
        ends = int((k + 1) * ONE / bench.default) - int(k * ONE / bench.default)
        await bench.clocks(ends)
    bench.level = None
    at = len(bench.bytes)
    await bench.send(coded[3:])
    await bench.until_quiet()
    assert bench.payloads[-1] == bytes([BAD_FRAME, 0, 8, FrameStatus.FRAMING])
    assert bench.bytes[at] == 0
    assert (bench.twin.framing, bench.twin.breaks, bench.twin.glitches) == (1, 0, 0)
    at = len(bench.bytes)
    await bench.pinged(3)
    assert bench.bytes[at] != 0
    bench.level = 0
    await bench.clocks(2)
    bench.level = None
    await bench.clocks(bench.bits(2))
    assert (bench.twin.framing, bench.twin.breaks, bench.twin.glitches) == (1, 0, 1)
    assert bench.twin.server.counters.frames_framing == 1


@cocotb.test()
async def reset_at_many_ages(dut) -> None:
    """In a command, a reply, a stream's packet, a wanted rate and a tried one."""
    bench = await Bench.started(dut)
    for age in range(9):
        await bench.start()
        bench.waiting[0].append(bench.packet(0x40, 20))
        step = bench.default // 2
        bench.to_send.extend(encode_frame(command(Command.WRITE, 1, write(UART_STEP, [step]))))
        await bench.clocks(bench.bits(130 + 60 * age))
        await bench.start(uart_step_strobe=1, bus_done=1, rx=age % 2)
        await bench.clocks(bench.bits(3))
        assert not bench.bytes and bench.twin.step_now == bench.default
        await bench.pinged(age)
        assert bench.bytes[0] == 0


@cocotb.test()
async def glitches_stop_at_their_largest_count(dut) -> None:
    bench = await Bench.started(dut)
    await bench.start()
    # Low for two clocks of every ten.
    pulses = Clock(dut.rx_i, 10 * CLOCK_NS, unit="ns", period_high=8 * CLOCK_NS)
    pulses.start()
    await Timer((COUNT_MAX + 5) * 10 * CLOCK_NS, "ns")
    await FallingEdge(dut.clk_i)
    assert port(dut, "uart_glitches_o").value == COUNT_MAX
    assert port(dut, "uart_framing_o").value == port(dut, "uart_breaks_o").value == 0
    pulses.stop()


@EACH_VOLUME
@pytest.mark.parametrize("given", each(ELABORATIONS, 1), ids=lambda given: f"{given['Baud']}")
def test_uart_link_rtl_equals_model(given: dict[str, int], volume: str) -> None:
    simulate("uart_link", __file__, given, volume=volume)


# ---- the model alone ----


def test_the_registers_default_is_the_links() -> None:
    register = REGISTERS["uart_step"]
    step = default_step(100_000_000, 3_000_000)
    assert register.reset[0] == step == UartLink().step_now
    assert abs(step / ONE * 100e6 / 3e6 - 1) < 1e-6


@pytest.mark.parametrize(("clock_hz", "baud"), [(8_000_000, 1_000_002), (100_000_000, 2)])
def test_uart_link_model_refuses(clock_hz: int, baud: int) -> None:
    with pytest.raises(ValueError, match="uart_link: baud"):
        UartLink(clock_hz, baud)

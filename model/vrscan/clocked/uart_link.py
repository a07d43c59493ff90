"""The host's end of the serial line, the twin of ``rtl/link/uart_link.sv``."""

from vrscan.clocked import (
    command_server,
    frame_decoder,
    frame_encoder,
    packet_arbiter,
    uart_rx,
    uart_tx,
)
from vrscan.clocked.command_executor import Outcome
from vrscan.clocked.command_server import CommandServer
from vrscan.clocked.frame_decoder import FrameDecoder
from vrscan.clocked.frame_decoder import Status as FrameStatus
from vrscan.clocked.frame_encoder import FrameEncoder
from vrscan.clocked.packet_arbiter import PacketArbiter
from vrscan.clocked.uart_rx import STEP_WIDTH, UartRx
from vrscan.clocked.uart_tx import UartTx
from vrscan.data import link_pkg

COUNT_MAX = 0xFFFF
QUIET_CLKS = 8  # clocks without output before the rate changes
STREAM_BYTES = 240  # bytes of the longest packet of a stream
# Bytes on the line between a command and its reply, at most: such a packet with CRC, codes and
# 0x00, the encoder's ring, five registers, and two while the command is taken and executed.
MOST_BEFORE_REPLY = STREAM_BYTES + 4 + 256 + 5 + 2
_HELD = 1  # clocks of a byte between encoder and transmitter


def default_step(clock_hz: int, baud: int) -> int:
    """Return ``uart_step`` for a rate: bits per clock with 24 fraction bits, to nearest."""
    return ((baud << STEP_WIDTH) + clock_hz // 2) // clock_hz


def latency(
    step: int, payload: bytes, outcome: Outcome, accesses: int = 0, bus_latency: int = 0
) -> int:
    """Return the clocks from a command to its reply where nothing else is in progress.

    Args:
        step: Value of ``uart_step`` for the rate.
        payload: The command.
        outcome: Outcome of the command.
        accesses: Number of accesses to registers that it makes.
        bus_latency: Clocks of one access.

    Returns:
        From the first low sample of the start bit of the 0x00 that ends the command to that of the
        reply's first byte.
    """
    clocks = uart_rx.latency(step) + frame_decoder.LATENCY
    clocks += command_server.latency(payload, outcome, accesses, bus_latency)
    clocks += packet_arbiter.LATENCY
    zero = outcome.reply.find(0)
    if zero >= 0:
        clocks += zero + frame_encoder.ZERO_LATENCY
    else:
        clocks += len(outcome.reply) - 1 + frame_encoder.LATENCY
    return clocks + _HELD + uart_tx.LATENCY


class UartLink:
    """Clock-accurate link. A new one is in the state after a reset.

    Args:
        clock_hz: Frequency of the clock, ``ClockHz``.
        baud: Rate after reset, ``Baud``.
        trial_clks: Clocks of the trial of a new rate, ``TrialClks``.
        streams: Number of streams, ``Streams``.

    Attributes:
        tx: The outgoing serial line.
        server: The server of commands; its outputs are the link's.
        step_now: ``uart_step`` of the rate in use.
        framing, breaks, glitches, fallbacks: Counters of these events.
    """

    def __init__(
        self,
        clock_hz: int = 100_000_000,
        baud: int = 3_000_000,
        trial_clks: int | None = None,
        streams: int = 2,
    ) -> None:
        self._default = default_step(clock_hz, baud)
        if not 1 <= self._default <= uart_rx.STEP_MAX_MAJORITY:
            raise ValueError("uart_link: baud must be at most clock_hz / 8")
        self._trial_clks = clock_hz if trial_clks is None else trial_clks
        self.server = CommandServer()
        self.step_now = self._default
        self.framing = 0
        self.breaks = 0
        self.glitches = 0
        self.fallbacks = 0

        self._receiver = UartRx()
        self._decoder = FrameDecoder(link_pkg.MAX_PAYLOAD)
        self._arbiter = PacketArbiter(streams + 1)
        self._encoder = FrameEncoder()
        self._transmitter = UartTx()
        self._pending_byte: int | None = None  # byte that waits for the transmitter
        self._wanted = False  # whether another rate is wanted
        self._quiet = 0
        self._trial_remaining_clks: int | None = None  # remaining clocks of the trial of a rate
        self._lead = True  # whether a 0x00 goes in front of the next frame
        self._boundary = True  # whether the next frame may begin now

    @property
    def tx(self) -> bool:
        """Return the level of the outgoing serial line."""
        return self._transmitter.tx

    def packet_ready(self) -> int:
        """Return ``packet_ready_o``."""
        return self._arbiter.ready(self._encoder.ready) >> 1

    def step(
        self,
        *,
        rx: bool,
        packet_valid: int,
        packet_data: int,
        packet_last: int,
        bus_done: bool,
        bus_status: int,
        bus_data: int,
        capture_busy: bool,
        uart_step: int,
        uart_step_strobe: bool,
    ) -> None:
        """Advance by one clock."""
        receiver, decoder, server = self._receiver, self._decoder, self.server
        arbiter, encoder, transmitter = self._arbiter, self._encoder, self._transmitter
        step = self.step_now
        broken, framing, glitch = receiver.break_, receiver.framing, receiver.glitch
        good = decoder.done and decoder.status == FrameStatus.OK
        lead = self._lead and self._boundary
        held = self._pending_byte
        told = 0 if lead or held is None else held
        sent = held is not None and transmitter.ready
        reply_ready = bool(arbiter.ready(encoder.ready) & 1)
        idle = not (server.busy or arbiter.busy or arbiter.valid or encoder.valid)
        quiet = idle and encoder.ready and held is None and not transmitter.busy

        # Each part sees the output of the part before it from the previous clock.
        transmitter.step(valid=held is not None, data=told, step=step, break_=False)
        merged = arbiter.valid, arbiter.data, arbiter.last
        merged_ready = encoder.ready
        if held is None:
            self._pending_byte = encoder.data if encoder.valid else None
        elif sent and not lead:
            self._pending_byte = None
        encoder.step(*merged, held is None)
        arbiter.step(
            valid=packet_valid << 1 | server.valid,
            data=packet_data << 8 | server.data,
            last=packet_last << 1 | (server.valid and server.last),
            hold=self._wanted or self._trial_remaining_clks is not None,
            ready=merged_ready,
        )
        server.step(
            valid=decoder.valid,
            data=decoder.data,
            done=decoder.done,
            status=decoder.status,
            halt=broken,
            ready=reply_ready,
            bus_done=bus_done,
            bus_status=bus_status,
            bus_data=bus_data,
            capture_busy=capture_busy,
        )
        decoder.step(receiver.valid or broken, receiver.data, framing)
        receiver.step(rx=rx, step=step)

        if sent:
            self._boundary = told == 0
            self._lead = self._lead and not lead
        self._lead = self._lead or framing
        self._count(framing=framing and not broken, breaks=broken, glitches=glitch)
        self._change_rate(quiet, good, broken, uart_step, uart_step_strobe)

    def _count(self, **events: bool) -> None:
        for name, event in events.items():
            if event:
                setattr(self, name, min(getattr(self, name) + 1, COUNT_MAX))

    def _change_rate(
        self, quiet: bool, good: bool, broken: bool, wanted_step: int, written: bool
    ) -> None:
        """Change to another rate, or back to the default."""
        expires = self._trial_remaining_clks == 0
        if self._trial_remaining_clks is not None:
            self._trial_remaining_clks = None if good or expires else self._trial_remaining_clks - 1
        if self._wanted and quiet and self._quiet == QUIET_CLKS - 1:
            self.step_now = wanted_step
            self._wanted = False
            self._trial_remaining_clks = self._trial_clks - 1
            self._lead = True
        elif expires and not good:
            self.step_now = self._default
            self._lead = True
            self._count(fallbacks=True)
        self._quiet = min(self._quiet + 1, QUIET_CLKS - 1) if quiet else 0
        self._wanted = self._wanted or written
        if broken:
            self.step_now = self._default
            self._wanted = False
            self._trial_remaining_clks = None

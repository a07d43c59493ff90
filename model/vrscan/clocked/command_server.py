"""Execution of commands and their replies, the twin of ``rtl/link/command_server.sv``.

``answer`` is what it does, without clocks. ``CommandServer`` is the module, clock by clock.
"""

from collections.abc import Callable
from dataclasses import dataclass

from vrscan.clocked import command_executor, command_queue
from vrscan.clocked.command_executor import Access, Answer, CommandExecutor, Outcome, execute
from vrscan.clocked.command_queue import CommandQueue


def answer(payload: bytes, registers: Callable[[Access], Answer]) -> Outcome:
    """Execute a command on registers, without clocks.

    Args:
        payload: Payload of a good frame, not empty.
        registers: Function that takes an access and answers it.
    """
    run = execute(payload)
    try:
        access = next(run)
        while True:
            access = run.send(registers(access))
    except StopIteration as end:
        outcome: Outcome = end.value
        return outcome


def latency(payload: bytes, outcome: Outcome, accesses: int = 0, bus_latency: int = 0) -> int:
    """Return the clocks from ``done_i`` of a command's frame, with none before it, to ``valid_o``.

    The arguments are those of ``command_executor.latency``.
    """
    clocks = command_executor.latency(payload, outcome, accesses, bus_latency)
    return command_queue.LATENCY + clocks


@dataclass(frozen=True)
class Counters:
    """The counters: frames by their status, and commands."""

    frames_good: int
    frames_crc: int
    frames_malformed: int
    frames_too_long: int
    frames_too_short: int
    frames_framing: int
    commands_bad: int
    commands_lost: int


class CommandServer:
    """Clock-accurate server. A new one is in the state after a reset.

    Attributes:
        queue, executor: The twins of the parts; the executor's outputs are the server's.
    """

    def __init__(self) -> None:
        self.queue = CommandQueue()
        self.executor = CommandExecutor()

    @property
    def valid(self) -> bool:
        """Return whether there is a byte of a reply."""
        return self.executor.valid

    @property
    def data(self) -> int:
        """Return this byte."""
        return self.executor.data

    @property
    def last(self) -> bool:
        """Return whether it is the last one."""
        return self.executor.last

    @property
    def bus(self) -> Access | None:
        """Return the access that begins in this clock."""
        return self.executor.bus

    @property
    def strobes(self) -> set[str]:
        """Return the strobes that are high."""
        return self.executor.strobes

    @property
    def strobe_values(self) -> dict[str, int]:
        """Return the values that came with the last strobes."""
        return self.executor.strobe_values

    @property
    def alive(self) -> bool:
        """Return whether a command of a known kind and length is executed in this clock."""
        return self.executor.alive

    @property
    def busy(self) -> bool:
        """Return whether a command waits, is executed, or has a reply not yet taken."""
        return self.executor.busy

    @property
    def counters(self) -> Counters:
        """Return the counters of frames and commands."""
        return Counters(commands_bad=self.executor.commands_bad, **self.queue.counters)

    def step(
        self,
        *,
        valid: bool,
        data: int,
        done: bool,
        status: int,
        halt: bool,
        ready: bool,
        bus_done: bool,
        bus_status: int,
        bus_data: int,
        capture_busy: bool,
    ) -> None:
        """Advance by one clock."""
        queue, executor = self.queue, self.executor
        waits, frame = queue.waits, queue.frame
        take, release = executor.takes(waits=waits, halt=halt), executor.release
        executor.step(
            waits=waits,
            frame=frame,
            halt=halt,
            ready=ready,
            bus_done=bus_done,
            bus_status=bus_status,
            bus_data=bus_data,
            capture_busy=capture_busy,
        )
        queue.step(
            valid=valid,
            data=data,
            done=done,
            status=status,
            halt=halt,
            take=take,
            release=release,
        )

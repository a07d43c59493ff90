"""Commands of an M3 smart stage, the twin of ``rtl/actuators/m3_motor.sv``.

New Scale Technologies, M3-LS Linear Smart Stage Command & Control Reference Guide, 06224-M-0003.
"""

import re

from vrscan.clocked.i2c_master import Status, stream_clocks, stream_effect_clocks

# Statuses besides those of the bus and focus_motor's.
BAD_REPLY = 7
MOTOR_ERROR = 8
LIMIT = 9

MOST_BYTES = 30  # of a reply
COMMAND_EXTRA = 2  # clocks besides those of both streams
READ_COMMAND = b"<10>\r"
_REPLIES = {
    False: re.compile(rb"<08>\r"),
    True: re.compile(rb"<10 ([0-9A-F]{6}) ([0-9A-F]{8}) [0-9A-F]{8}>\r"),
}
_REPLY_SIZES = {False: 5, True: MOST_BYTES}
# Bits of the stage's status.
DRIVER_ERROR, FORWARD_LIMIT, REVERSE_LIMIT = 3, 9, 10
ENCODER_ERROR, ON_TARGET, MOVING, STALLED = 16, 18, 19, 23
BEYOND = 24  # bit of motor_status: the position is none of 16 bits


def command(*, read: bool, target: int = 0) -> bytes:
    """Return the bytes that ask for the position, or send the stage to a target."""
    return READ_COMMAND if read else b"<08 %08X>\r" % target


def command_clocks(*, read: bool, quarter: int) -> int:
    """Return the clocks from a command to its reply on a free bus without stretching.

    Args:
        read: Whether the command is a read; otherwise it is a write.
        quarter: Clocks of a quarter of a bit, at least 4.
    """
    sizes = len(command(read=read)), _REPLY_SIZES[read]
    return COMMAND_EXTRA + sum(1 + stream_clocks(count=size, quarter=quarter) for size in sizes)


def effect_clocks(*, read: bool, quarter: int) -> int:
    """Return the clocks from a command to the fall of SCL behind the last bit that it writes."""
    return 1 + stream_effect_clocks(count=len(command(read=read)), quarter=quarter)


class M3Motor:
    """Clock-accurate translation of commands and replies. A new one is in the state after a reset.

    Attributes:
        busy: Whether a command is at work.
        valid: Whether it has ended.
        status: Its outcome, a status of the bus or one of this module; defined with ``valid``.
        position: Position of the stage, u16; defined after a read that is OK, ``MOTOR_ERROR`` or
            ``LIMIT``.
        command_valid: Whether a stream begins in this clock.
        command_read: Whether it is a read; defined with ``command_valid``.
        byte: Next byte to be written, None where it is not defined.
        last: Whether no byte follows; defined while a stream is on the bus.
        motor_status: Status in the last good reply to a read, and the bit ``BEYOND``.
    """

    def __init__(self) -> None:
        self.busy = False
        self.valid = False
        self.status = 0
        self.position = 0
        self.command_valid = False
        self.command_read = False
        self.byte: int | None = None
        self.last = False
        self.motor_status = 0
        self._read = False
        self._to_send = b""
        self._received = b""

    def step(
        self,
        *,
        valid: bool,
        read: bool,
        target: int,
        byte_valid: bool,
        byte: int,
        reply_valid: bool,
        reply_status: int,
    ) -> None:
        """Advance by one clock with these inputs."""
        self.valid = self.command_valid = False
        self.byte = None
        if not self.busy:
            self.last = False
            if valid:
                self.busy = self.command_valid = True
                self.command_read = False
                self._read = read
                self._to_send = command(read=read, target=target)
        elif self.command_read:
            if byte_valid:
                self._received += bytes([byte])
                self.last = byte == ord("\r") or len(self._received) == MOST_BYTES
            if reply_valid:
                self._end(reply_status)
        else:
            self.byte = self._to_send[0] if self._to_send else ord(" ")
            if byte_valid:
                self._to_send = self._to_send[1:]
                self.last = not self._to_send
            if reply_valid:
                self.last = False
                if reply_status:
                    self._end(reply_status)
                else:
                    self.command_valid = self.command_read = True
                    self._received = b""

    def _end(self, status: int) -> None:
        """Reply with what both streams came to."""
        self.busy = False
        self.valid = True
        self.status = int(Status(status))
        if status:
            return
        reply = _REPLIES[self._read].fullmatch(self._received)
        if reply is None:
            self.status = BAD_REPLY
        elif self._read:
            self.motor_status, position = (int(digits, 16) for digits in reply.groups())
            if position >= 1 << 16:
                self.motor_status |= 1 << BEYOND
                position = 0 if position >> 31 else 0xFFFF
            self.position = position
            self.status = self._judge()

    def _judge(self) -> int:
        """Return what the stage's status says of it."""
        bits = {bit for bit in range(BEYOND + 1) if self.motor_status >> bit & 1}
        if bits & {DRIVER_ERROR, ENCODER_ERROR, STALLED}:
            return MOTOR_ERROR
        stopped = bits & {FORWARD_LIMIT, REVERSE_LIMIT} and MOVING not in bits
        if ON_TARGET not in bits and (stopped or BEYOND in bits):
            return LIMIT
        return Status.OK

"""Encoding of a payload as a frame (CRC, COBS, 0x00), the twin of ``rtl/link/frame_encoder.sv``."""

from collections import deque

CRC_INIT = 0xFFFF
LATENCY = 5  # clocks from last_i taken to valid_o with the code of a block that is not full
ZERO_LATENCY = 2  # clocks from a zero taken to valid_o with the code of its block
FRAME_BUBBLE = 4  # clocks without ready_o after last_i: two of CRC, the code, the 0x00
BLOCK_BUBBLE = 3  # the same after 254 bytes without a zero, at most, with a free output

_RING = 256
_MOST = 255  # largest code, and number of slots of a block with its code
_POLYNOMIAL = 0x1021


def _shifted(byte: int) -> int:
    """Return the change of the CRC by a byte that leaves the register."""
    crc = byte << 8
    for _ in range(8):
        crc = (crc << 1) ^ (_POLYNOMIAL if crc & 0x8000 else 0)
    return crc & 0xFFFF


_TABLE = [_shifted(byte) for byte in range(256)]


def crc_next(crc: int, data: int) -> int:
    """Return the CRC, 16 bits, after one more byte."""
    return ((crc << 8) & 0xFFFF) ^ _TABLE[(crc >> 8) ^ data]


class FrameEncoder:
    """Clock-accurate encoder. A new one is in the state after a reset.

    Attributes:
        ready: Whether a byte that is valid in this clock is taken.
        valid: Whether ``data`` is a byte of the frame.
        data: The byte; defined with ``valid``.
    """

    def __init__(self) -> None:
        self.ready = False
        self.valid = False
        self.data = 0

        self._written: deque[int] = deque()  # bytes that may be sent
        self._block: list[int] = []  # bytes that wait for their code
        self._ending: list[int | None] = []  # CRC, then None for the code and for the 0x00
        self._room = False
        self._crc = CRC_INIT

    def step(self, valid: bool, data: int, last: bool, ready: bool) -> None:
        """Advance by one clock with these inputs."""
        block = self._block
        taken = bool(valid and self.ready)
        before = len(self._written)
        going: list[int] = []  # written now, readable from the next clock on
        if taken:
            self._crc = crc_next(self._crc, data)
            going = self._put(data)
            if last:
                self._ending = [self._crc >> 8, self._crc & 0xFF, None, None]
        elif not self._room:
            pass
        elif len(self._ending) == 1:
            going = [0]
            self._ending = []
            self._crc = CRC_INIT
        elif len(block) == _MOST - 1 or len(self._ending) == 2:
            going = self._close()
            if len(self._ending) == 2:
                self._ending = [None]
        elif self._ending:
            value = self._ending.pop(0)
            assert value is not None
            going = self._put(value)

        # The open slot is taken too. What leaves the ring in this clock is seen a clock later.
        occupied = before + len(going) + 1 + len(self._block)
        self._room = occupied < _RING
        self.ready = self._room and not self._ending and len(self._block) < _MOST - 1

        if ready or not self.valid:
            self.valid = before > 0
            if before:
                self.data = self._written.popleft()
        self._written.extend(going)

    def _put(self, data: int) -> list[int]:
        """Put a byte into the block, and return the bytes that this releases."""
        if data == 0:
            return self._close()
        self._block.append(data)
        return []

    def _close(self) -> list[int]:
        """Return the block with its code, and begin a new one."""
        done = [len(self._block) + 1, *self._block]
        self._block = []
        return done

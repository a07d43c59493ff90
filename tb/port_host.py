"""A host's end of a virtual board's serial port, without the protocol."""

import fcntl
import os
import select
import struct
import time
from pathlib import Path

BAUD = 1_000_000
TCGETS2, TCSETS2, BOTHER, CBAUD = 0x802C542A, 0x402C542B, 0o010000, 0o010017


class Host:
    """A host's end of the port."""

    def __init__(self, port: Path, baud: int = BAUD) -> None:
        self.file = os.open(port, os.O_RDWR | os.O_NOCTTY)
        self.rate(baud)

    def __enter__(self) -> "Host":
        return self

    def __exit__(self, *_: object) -> None:
        os.close(self.file)

    def rate(self, baud: int) -> None:
        """Set any rate, as TCSETS2 can."""
        state = list(struct.unpack("4I20B2I", fcntl.ioctl(self.file, TCGETS2, bytes(44))))
        state[2] = state[2] & ~(CBAUD | CBAUD << 16) | BOTHER | BOTHER << 16
        state[-2:] = [baud, baud]
        fcntl.ioctl(self.file, TCSETS2, struct.pack("4I20B2I", *state))
        time.sleep(0.05)  # until the board has seen it

    def read(self, count: int, seconds: float = 10.0) -> bytes:
        """Return so many bytes, or what came in the time."""
        got, end = b"", time.monotonic() + seconds
        while len(got) < count:
            ready, _, _ = select.select([self.file], [], [], max(0.0, end - time.monotonic()))
            if not ready:
                break
            got += os.read(self.file, count - len(got))
        return got

    def ask(self, data: bytes, seconds: float = 10.0) -> bytes:
        """Send bytes and return as many."""
        sent, got = 0, b""
        end = time.monotonic() + seconds
        while len(got) < len(data) and time.monotonic() < end:
            reading, writing, _ = select.select(
                [self.file], [self.file] if sent < len(data) else [], [], 0.1
            )
            if writing:
                sent += os.write(self.file, data[sent : sent + 1024])
            if reading:
                got += os.read(self.file, 4096)
        return got

"""Frames by the cobs package and Python's own CRC; both ends of the link are tested against it."""

import binascii

import numpy as np
from cobs import cobs


def on_the_line(byte: int) -> list[int]:
    """Return the ten levels of a byte of a UART."""
    return [0, *(byte >> k & 1 for k in range(8)), 1]


def uncobs(coded: bytes) -> bytes | None:
    """Return what was coded, None where it is no COBS."""
    try:
        return cobs.decode(coded)
    except cobs.DecodeError:
        return None


def checked(payload: bytes) -> bytes:
    """Return the payload with its CRC."""
    return payload + binascii.crc_hqx(payload, 0xFFFF).to_bytes(2, "big")


def frame(payload: bytes) -> bytes:
    """Return a whole frame."""
    return cobs.encode(checked(payload)) + b"\0"


def is_good(coded: bytes) -> bytes | None:
    """Return the payload of a frame without its end, None where any part of it is wrong."""
    data = uncobs(coded)
    return data[:-2] if data is not None and len(data) > 2 and checked(data[:-2]) == data else None


def random_bytes(draw: np.random.Generator, count: int, zeros: float) -> bytes:
    """Return random bytes, some more of them zero."""
    data = draw.integers(0 if zeros else 1, 256, count)
    data[draw.random(count) < zeros] = 0
    return bytes(data.astype(np.uint8))


def random_payload(draw: np.random.Generator, most: int) -> bytes:
    """Return a payload, of any kind: few bytes or many, no zero, some, or nothing else."""
    count = int(min(most, draw.choice([1, 2, 3, 10, 253, 254, 255, 300, 511, most])))
    return random_bytes(draw, count, float(draw.choice([0, 0, 0.004, 0.1, 0.5, 1])))


def with_crc_byte(value: int, place: int, count: int, draw: np.random.Generator) -> bytes:
    """Return a payload of ``count`` bytes, no zero, the byte of whose CRC at ``place`` is known."""
    while True:
        payload = random_bytes(draw, count, 0)
        if checked(payload)[count + place] == value:
            return payload

"""A memory of several blocks against a list: both ports at random, at the ends of each block."""

from collections import deque

import cocotb
import pytest
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge
from harness import CLOCK_NS, drive, generator, parameters, rounds, simulate

DEPTH = 8192  # words of a block
LATENCY = 3


@cocotb.test()
async def test_both_ports_give_what_was_written(dut) -> None:
    draw, words, width = generator(), parameters()["Words"], parameters()["Width"]
    cocotb.start_soon(Clock(dut.clk_i, CLOCK_NS, unit="ns").start())
    ends = {0, 1, words - 1, *range(DEPTH - 2, words, DEPTH), *range(DEPTH, words, DEPTH)}
    places = sorted(ends | {int(place) for place in draw.integers(0, words, 40)})
    held: dict[int, int] = {}
    read: deque[int | None] = deque([None] * (LATENCY - 1))
    back: deque[int | None] = deque([None] * (LATENCY - 1))
    todo = list(places)  # each has a word before anything is chosen
    compared = 0
    for clock in range(len(places) + rounds(2000, 50_000)):
        write = bool(todo) or bool(draw.random() < 0.3)
        access = todo.pop() if todo else int(draw.choice(places))
        address, data = int(draw.choice(places)), int(draw.integers(0, 1 << width))
        drive(dut.write_i, int(write))
        drive(dut.access_i, access)
        drive(dut.address_i, address)
        drive(dut.data_i, data)
        read.append(None if write and address == access else held.get(address))  # a collision
        back.append(held.get(access))
        if write:
            held[access] = data
        await FallingEdge(dut.clk_i)
        for name, wanted in (("read_o", read.popleft()), ("back_o", back.popleft())):
            if wanted is not None:
                got = int(getattr(dut, name).value)
                assert got == wanted, f"clock {clock}: {name} {got:#x}, want {wanted:#x}"
                compared += 1
    assert compared > 3000


# One block in part, a word more than one, and three.
@pytest.mark.parametrize("words", [100, DEPTH + 1, 2 * DEPTH + 77])
def test_two_port_memory_keeps_words(words: int) -> None:
    simulate("two_port_memory", __file__, {"Words": words, "Width": 4})

"""lit_gate: every clock of the RTL against the model, and what a change of the light closes."""

import cocotb
import pytest
from harness import TwinBench, as_integer, generator, parameters, simulate

from vrscan.clocked.lit_gate import LitGate

SHORT = {"AnswerClks": 8, "LevelClks": 21}
ELABORATIONS = [{"AnswerClks": 1, "LevelClks": 2, "Samples": 1}, SHORT | {"Samples": 2}, SHORT]


class Bench(TwinBench):
    """Drives the RTL and its twin with the same inputs and compares the gate every clock."""

    def __init__(self, dut) -> None:
        super().__init__(dut, ("pulse", "index_light", "startup", "gate"))
        own = parameters()
        self.answer, self.level = own["AnswerClks"], own["LevelClks"]
        self.ones = (1 << own.get("Samples", 4)) - 1

    async def start(self) -> None:
        """Reset for a clock in the light."""
        twin = LitGate(self.answer, self.level, startup=100)
        await self.reset_to(twin, pulse=0, index_light=1, startup=100, gate=self.ones)
        assert as_integer(self.dut.gate_o) == 0

    def check(self) -> None:
        """Compare the output."""
        got = as_integer(self.dut.gate_o)
        assert got == self.twin.gate, f"clock {self.clock}, {self.inputs}: gate {got}"

    async def opens_after(self, count: int) -> None:
        """Hold the light constant; the gate opens after so many clocks and stays open."""
        await self.clocks(count - 1)
        assert self.twin.gate == 0
        await self.clocks()
        assert self.twin.gate == self.ones
        await self.clocks(3 * self.level)
        assert self.twin.gate == self.ones


@cocotb.test()
async def random_light(dut) -> None:
    """Pulses, index light and levels of any length, resets among them, and a gate of its own."""
    draw = generator(1)
    bench = await Bench.fresh(dut)
    seen = set()
    for _ in range(20):
        await bench.start()
        for _ in range(40):
            change = {"pulse": int(draw.random() < 0.2), "index_light": int(draw.random() < 0.8)}
            if draw.random() < 0.2:
                change["startup"] = int(draw.integers(1 << 16))
            for _ in range(int(draw.integers(1, bench.level + 2 * bench.answer + 3))):
                await bench.clocks(gate=int(draw.integers(bench.ones + 1)), **change)
                seen.add(bench.twin.gate)
    assert seen == set(range(bench.ones + 1))


@cocotb.test()
async def a_change_of_the_light_closes_it_until_the_diode_has_answered(dut) -> None:
    """A pulse in the index light and the dark close it at once; a pulse alone never opens it."""
    bench = await Bench.started(dut)
    await bench.opens_after(bench.level)
    for change in ({"pulse": 1}, {"index_light": 0}, {"index_light": 0, "pulse": 1}):
        await bench.clocks(**change)
        assert bench.twin.gate == 0
        await bench.clocks(2 * bench.level)
        assert bench.twin.gate == 0
        bench.give(pulse=0, index_light=1)
        await bench.opens_after(bench.answer)


@cocotb.test()
async def a_change_of_the_level_closes_it_until_the_filter_has_settled(dut) -> None:
    """Every bit of the level counts, in the light and in the dark."""
    bench = await Bench.started(dut)
    await bench.opens_after(bench.level)
    for bit in range(16):
        await bench.clocks(startup=bench.inputs["startup"] ^ (1 << bit))
        assert bench.twin.gate == 0
        await bench.opens_after(bench.level)
    await bench.clocks(index_light=0, startup=0)
    bench.give(index_light=1)
    await bench.opens_after(bench.level)


@pytest.mark.parametrize("elaboration", ELABORATIONS, ids=["smallest", "odd", "samples"])
def test_rtl(elaboration: dict[str, int]) -> None:
    """Every elaboration runs every test above."""
    simulate("lit_gate", __file__, elaboration)

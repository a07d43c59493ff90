"""lit_gate: every clock of the RTL against the model, and what switched light cannot do by name."""

import cocotb
import pytest
from harness import TwinBench, as_integer, generator, parameters, simulate

from vrscan.clocked.lit_gate import LitGate

ELABORATIONS = [{"AnswerClks": 1, "Samples": 1}, {"AnswerClks": 8, "Samples": 2}, {}]


class Bench(TwinBench):
    """Drives the RTL and its twin with the same inputs and compares the gate every clock."""

    def __init__(self, dut) -> None:
        super().__init__(dut, ("lit", "gate"))
        self.answer = parameters().get("AnswerClks", 126)
        self.ones = (1 << parameters().get("Samples", 4)) - 1

    async def start(self) -> None:
        """Reset for a clock in the light."""
        await self.reset_to(LitGate(self.answer), lit=1, gate=self.ones)
        assert as_integer(self.dut.gate_o) == 0

    def check(self) -> None:
        """Compare the output."""
        got = as_integer(self.dut.gate_o)
        assert got == self.twin.gate, f"clock {self.clock}, {self.inputs}: gate {got}"


@cocotb.test()
async def random_light(dut) -> None:
    """Lights of any length, resets among them, and a gate of its own."""
    draw = generator(1)
    bench = await Bench.fresh(dut)
    seen = set()
    for _ in range(20):
        await bench.start()
        for _ in range(30):
            lit = int(draw.integers(2))
            for _ in range(int(draw.integers(1, 2 * bench.answer + 3))):
                await bench.clocks(lit=lit, gate=int(draw.integers(bench.ones + 1)))
                seen.add(bench.twin.gate)
    assert seen == set(range(bench.ones + 1))


@cocotb.test()
async def a_light_opens_it_after_the_answer_and_closes_it_at_its_end(dut) -> None:
    bench = await Bench.started(dut)
    for _ in range(3):
        await bench.clocks(lit=0)
        await bench.clocks(bench.answer - 1, lit=1)
        assert bench.twin.gate == 0
        await bench.clocks()
        assert bench.twin.gate == bench.ones
        await bench.clocks(5 * bench.answer)
        assert bench.twin.gate == bench.ones
        await bench.clocks(lit=0)
        assert bench.twin.gate == 0


@pytest.mark.parametrize("elaboration", ELABORATIONS, ids=["smallest", "odd", "shipped"])
def test_rtl(elaboration: dict[str, int]) -> None:
    """Every elaboration runs every test above."""
    simulate("lit_gate", __file__, elaboration)

"""commit_control: every clock of the RTL against the twin, and its promises by what it drives."""

import cocotb
from harness import TwinBench, generator, parameters, port, rounds, simulate

from vrscan.clocked.commit_control import EMPTY_CLKS, SETTLE_CLKS, CommitControl

QUIET = {"strobe": 0, "empty": 0, "renewing": 0}
OUTPUTS = ("copy", "hold", "take", "superseding")


class Bench(TwinBench):
    """Drives both, compares every output, and keeps what they did."""

    strobes = ("strobe",)

    def __init__(self, dut) -> None:
        super().__init__(dut, QUIET)
        self.copied: list[int] = []
        self.takes = 0

    def on_port(self, name: str, value: int) -> tuple[str, int]:
        """Return the port of an input."""
        return "commit_strobe" if name == "strobe" else name, value

    async def start(self) -> None:
        """Reset for a clock."""
        await self.reset_to(CommitControl(parameters()["Entries"]), **QUIET)
        self.check()

    def check(self) -> None:
        """Compare all outputs."""
        twin = self.twin
        want = [int(getattr(twin, name)) for name in OUTPUTS]
        want += [int(twin.waiting), twin.configuration]
        names = [*(f"{name}_o" for name in OUTPUTS), "commit_waiting_o", "configuration_o"]
        got = [int(port(self.dut, name).value) for name in names]
        assert got == want, f"clock {self.clock}: {names} {got}, want {want}"
        if twin.copy:
            assert int(self.dut.index_o.value) == twin.index
            self.copied.append(twin.index)
        self.takes += twin.take


@cocotb.test()
async def a_commit_takes_effect_once_and_with_nothing_inside(dut) -> None:
    """Any time until the chain is empty and the mirror ready, and commits meanwhile."""
    draw = generator(1)
    bench = await Bench.fresh(dut)
    entries = parameters()["Entries"]
    await bench.start()
    commits = rounds(60, 600)
    for k in range(commits):
        bit, takes = bench.twin.configuration, bench.takes
        if k:
            await bench.clocks(1, strobe=1)
        empty = int(draw.integers(2))
        await bench.clocks(entries + int(draw.integers(40)), empty=empty, renewing=1)
        await bench.clocks(1, strobe=1)  # the bus does not let it through
        taken = bench.takes > takes
        if not taken:
            await bench.clocks(int(draw.integers(30)), empty=0)
            assert bench.takes == takes and bench.twin.hold
            await bench.clocks(EMPTY_CLKS + 2, empty=1, renewing=1)
            assert bench.takes == takes + 1
        await bench.clocks(SETTLE_CLKS + int(draw.integers(40)), renewing=int(draw.integers(2)))
        await bench.clocks(SETTLE_CLKS + 4, empty=0, renewing=0)
        assert not (bench.twin.waiting or bench.twin.hold or bench.twin.superseding)
        assert bench.takes == takes + 1 and bench.twin.configuration == 1 - bit
        assert bench.copied == list(range(entries))
        bench.copied.clear()
        await bench.clocks(int(draw.integers(5)))


@cocotb.test()
async def reset_at_every_age(dut) -> None:
    """A reset begins a commit anew, whatever was under way."""
    bench = await Bench.fresh(dut)
    for age in range(parameters()["Entries"] + 40):
        await bench.start()
        await bench.clocks(age, empty=1)
        await bench.start()
        await bench.clocks(parameters()["Entries"] + 40, empty=1)
        assert not bench.twin.waiting and bench.twin.configuration == 0


def test_commit_control_rtl_equals_model() -> None:
    simulate("commit_control", __file__, {"Entries": 16})

"""bus_arbiter: every clock of the RTL against the model; commands stay whole, both are served."""

import cocotb
import pytest
from harness import FallingEdge, Ports, TwinBench, generator, simulate

from vrscan.clocked.bus_arbiter import LINGER_CLKS, BusArbiter
from vrscan.clocked.command_executor import Access, CommandExecutor
from vrscan.clocked.frame_decoder import Status as FrameStatus
from vrscan.data import link_pkg

OUTPUTS = (
    "done_o",
    "bus_valid_o",
    "status_o",
    "data_o",
    "bus_access_o",
    "bus_address_o",
    "bus_data_o",
)
BUS_CLKS = 14  # of register_file


class Bench(TwinBench):
    """Two sources, each with an access at its port, and a bus that answers after a while."""

    def __init__(self, dut) -> None:
        super().__init__(
            dut, ["valid", "access", "address", "data", "bus_done", "bus_status", "bus_data"]
        )
        self.draw = generator(1)
        self.outputs = Ports(dut, OUTPUTS)

    def check(self) -> None:
        twin, got = self.twin, dict(zip(OUTPUTS, self.outputs.read(), strict=True))
        assert got["done_o"] == (0 if twin.done is None else 1 << twin.done), self.clock
        assert got["bus_valid_o"] == (twin.bus is not None), self.clock
        if twin.done is not None:
            assert (got["status_o"], got["data_o"]) == (twin.status, twin.data)
        if twin.bus is not None:
            assert tuple(got[f"bus_{name}_o"] for name in Access._fields) == twin.bus

    async def start(self, **inputs: int) -> None:
        """Reset for a clock with these inputs."""
        self.open: list[Access | None] = [None, None]
        self.ports = [Access(0, 0, 0)] * 2
        self.due: int | None = None  # clocks until the bus answers
        self.begun: list[tuple[int, int]] = []  # clock and source of each access on the bus
        self.done: list[int] = []
        await self.reset_to(BusArbiter(), **(dict.fromkeys(self.inputs, 0) | inputs))
        self.check()

    async def clocks(self, count: int = 1, **inputs: int) -> None:
        raise NotImplementedError  # a clock here needs what is offered: ``tick`` takes it

    async def tick(self, offered: int) -> None:
        """Go on by a clock, in which these sources make an access if they have none."""
        valid = 0
        for source in range(2):
            if offered >> source & 1 and self.open[source] is None:
                word = int(self.draw.integers(1 << 32))
                self.ports[source] = self.open[source] = Access(
                    int(self.draw.integers(3)), int(self.draw.integers(1 << 16)), word
                )
                valid |= 1 << source
        if self.twin.done is not None:  # the source sees it in this clock
            self.open[self.twin.done] = None
        self.due = None if self.due is None else self.due - 1
        answer = {"bus_done": self.due == 0}
        answer |= {
            "bus_status": int(self.draw.integers(9)),
            "bus_data": int(self.draw.integers(1 << 32)),
        }
        first, second = self.ports
        self.give(
            valid=valid,
            access=first.access | second.access << link_pkg.ACCESS_WIDTH,
            address=first.address | second.address << link_pkg.ADDRESS_WIDTH,
            data=first.data | second.data << 32,
            **{name: int(value) for name, value in answer.items()},
        )
        await FallingEdge(self.dut.clk_i)
        self.twin.step(valid=valid, accesses=tuple(self.ports), **answer)
        self.clock += 1
        self.check()
        if self.twin.bus is not None:
            source = self.ports.index(self.twin.bus)
            self.begun.append((self.clock, source))
            self.due = int(self.draw.integers(2, 16))
        if self.twin.done is not None:
            self.done.append(self.twin.done)


@cocotb.test()
async def accesses_at_random(dut) -> None:
    bench = await Bench.fresh(dut)
    for often in ((0.05, 0.05), (0.02, 1.0), (1.0, 1.0), (0.0, 1.0)):
        await bench.start()
        for _ in range(1500):
            await bench.tick(sum((bench.draw.random() < p) << k for k, p in enumerate(often)))
        assert bench.done == [source for _, source in bench.begun][: len(bench.done)]
        assert len(bench.begun) - len(bench.done) <= 1
        assert {0: often[0] > 0, 1: often[0] < 1} == {s: s in bench.done for s in (0, 1)}


@cocotb.test()
async def a_command_is_not_interrupted(dut) -> None:
    """Source 0 pauses for less than LingerClks between its words; source 1 waits all the time."""
    bench = await Bench.started(dut)
    for _ in range(5):
        words = 0
        gap = 0
        while words < 8:
            gap = 0 if bench.open[0] else gap + 1
            offer = bench.open[0] is None and gap > LINGER_CLKS - 3
            words += offer
            await bench.tick(2 | offer if words else 0)
        while bench.open[0]:
            await bench.tick(2)
        for _ in range(4 * LINGER_CLKS):
            await bench.tick(2)
    order = [source for _, source in bench.begun]
    runs = "".join(map(str, order)).replace("1", " ").split()
    assert runs == ["0" * 8] * 5 and order.count(1) >= 5


@cocotb.test()
async def reset_at_every_age(dut) -> None:
    bench = await Bench.fresh(dut)
    for age in range(1, 40):
        await bench.start()
        for _ in range(age):
            await bench.tick(3 if age % 2 else 1)
        under_way = bench.twin.bus is None and (bench.due or 0) > 0
        await bench.start(bus_done=int(under_way))
        await bench.tick(2)
        assert bench.twin.bus is not None  # nothing lingers, nothing waits


def test_bus_arbiter_rtl_equals_model() -> None:
    simulate("bus_arbiter", __file__)


@pytest.mark.parametrize("command", [link_pkg.COMMAND_READ, link_pkg.COMMAND_WRITE])
def test_the_words_of_a_command_follow_soon_enough(command: int) -> None:
    """From an answer at the executor to its next access it is less than LINGER_CLKS."""
    data = [62] if command == link_pkg.COMMAND_READ else [1] * 4 * 62
    frame = (FrameStatus.OK, bytes([command, 0, 16, 0, *data]))
    twin, due, since, gaps = CommandExecutor(), 0, None, []
    for _ in range(62 * 100):
        due -= 1
        quiet = {"halt": False, "ready": False, "capture_busy": False}
        answer = {"bus_done": due == 0, "bus_status": link_pkg.STATUS_OK, "bus_data": 1}
        twin.step(waits=True, frame=frame, **quiet, **answer)
        since = 0 if due == 0 else since
        if twin.bus is not None:
            gaps += [] if since is None else [since]
            due = BUS_CLKS
        since = None if since is None else since + 1
    assert len(gaps) == (62 if command == link_pkg.COMMAND_READ else 124) - 1
    # The arbiter counts from the bus's answer, a clock before the one at the executor.
    print("clocks between words:", max(gaps))
    assert max(gaps) + 1 < LINGER_CLKS


@pytest.mark.parametrize("clks", [0, 256])
def test_bus_arbiter_model_refuses(clks: int) -> None:
    with pytest.raises(ValueError, match="bus_arbiter: linger_clks"):
        BusArbiter(clks)

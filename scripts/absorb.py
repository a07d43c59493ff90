"""Move the registers in front of a multiplier into it.

The ECP5's multiplier has registers of its own, which Yosys leaves unused: it takes flip-flops of
the fabric, and the route from them takes its part of the clock beside the multiplier's 4 ns.  What
is moved here has neither enable nor reset; both operands move, or none, since nextpnr has no times
for one of them alone.

Only the registers at the inputs: of those at the output the chip database knows neither the enable
nor every reset.  nextpnr has the times of a multiplier with registers at its inputs, setup before
and 3.9 ns from clock to product (MULT18X18D:REGS=INPUT), so nothing behind them is left out.
"""

from collections import Counter
from collections.abc import Iterator
from typing import Any

Bit = int | str  # a net's number, or a constant
Module = dict[str, Any]
Cell = dict[str, Any]

MULTIPLIER, REGISTER = "MULT18X18D", "TRELLIS_FF"
OPERANDS = {side: [f"{side}{bit}" for bit in range(18)] for side in "AB"}


def _moves(cell: Cell) -> bool:
    """Return whether a flip-flop does nothing but follow its input, from 0 on."""
    parameters, pins = cell["parameters"], cell["connections"]
    return bool(
        parameters["CEMUX"].strip() == "1"
        and parameters["CLKMUX"] == "CLK"
        and parameters["REGSET"] == "RESET"
        and parameters.get("LSRMUX", "LSR") == "LSR"
        and pins.get("LSR", ["0"]) == ["0"]
    )


def _bits(cell: Cell, direction: str) -> Iterator[Bit]:
    for pin, bits in cell["connections"].items():
        if cell["port_directions"][pin] == direction:
            yield from bits


def absorb(module: Module) -> int:
    """Change a mapped module; return how many multipliers took the registers at their inputs."""
    cells: dict[str, Cell] = module["cells"]
    registers = {
        cell["connections"]["Q"][0]: name
        for name, cell in cells.items()
        if cell["type"] == REGISTER and _moves(cell)
    }
    readers = Counter(bit for cell in cells.values() for bit in _bits(cell, "input"))
    readers.update(
        bit
        for port in module["ports"].values()
        if port["direction"] != "input"
        for bit in port["bits"]
    )
    taken = 0
    for cell in cells.values():
        if cell["type"] != MULTIPLIER or "CLK0" in cell["connections"]:
            continue
        pins = cell["connections"]
        operands = {pin: pins[pin][0] for side in OPERANDS.values() for pin in side}
        before = {
            pin: cells[registers[bit]]["connections"]
            for pin, bit in operands.items()
            if bit in registers
        }
        clocks = {connections["CLK"][0] for connections in before.values()}
        # A 0 stays one behind a register that begins with 0.
        if len(clocks) != 1 or any(
            pin not in before and bit != "0" for pin, bit in operands.items()
        ):
            continue
        for pin, connections in before.items():
            pins[pin] = connections["DI"]
            readers[operands[pin]] -= 1
            readers.update(connections["DI"])
        for side in OPERANDS:
            cell["parameters"] |= {
                f"REG_INPUT{side}_{what}": f"{what}0" for what in ("CLK", "CE", "RST")
            }
        cell["parameters"]["GSR"] = "DISABLED"
        # An open pin is 1, which would be a reset.
        for pin, bit in {"CLK0": clocks.pop(), "CE0": "1", "RST0": "0"}.items():
            pins[pin], cell["port_directions"][pin] = [bit], "input"
        taken += 1
    # A register that nothing reads any more may have been the only reader of another.
    idle = [bit for bit in registers if not readers[bit]]
    while idle:
        connections = cells.pop(registers.pop(idle.pop()))["connections"]
        readers.subtract(connections["DI"])
        idle += [bit for bit in connections["DI"] if bit in registers and not readers[bit]]
    return taken

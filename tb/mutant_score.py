"""The score of the tests: how many of the mutants that the code itself offers they notice.

A module's own test goes first. What it lets pass meets the tests of the modules that join it with
others, and last the virtual board. Verdicts are kept in ``build/mutants``: each stands until a file
that its simulation read has changed, so a run that was interrupted goes on.
"""

import contextlib
import hashlib
import json
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import tomllib
from collections import defaultdict
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from functools import cache
from pathlib import Path
from queue import Queue

import mutant_runs
from mutants import Mutant, sample, schemata, sources
from rich.console import Console
from rich.progress import Progress

from vrscan.engines.tools import build_folder, repository_root, rtl_closure
from vrscan.show.sheet import rewrite

ROOT = repository_root()
ARGUED = ROOT / "tb" / "equivalent_mutants.toml"
PAGE = ROOT / "docs" / "verification.md"
PARTS = ("rtl", "tb", "model", "scripts", "pyproject.toml", "requirements.txt")
JOINTS = (
    "command_server", "focus_control", "laser_control", "mirror_loop", "uart_link", "vrscan_chain",
)  # fmt: skip
REACHES = ("own", "joined", "board")
BOARD = "tb/test_vrscan.py"  # its tests share a board, so each mutant has all of them anew
SECONDS = 600  # in which a run of one mutant by itself ends
DECIDED = ("killed", "time-out", "invalid")


class ScoreError(Exception):
    """The score cannot be taken."""


def argued() -> dict[tuple[str, str, str], str]:
    """Return why nothing can notice a mutant, by its file and its lines before and after."""
    rows = tomllib.loads(ARGUED.read_text()).get("mutant", [])
    return {(row["file"], row["old"], row["new"]): row["why"] for row in rows}


@cache
def meets(file: str, reach: str) -> tuple[str, ...]:
    """Return the test files that a module's mutants meet, in this order.

    Args:
        file: The module.
        reach: One of ``REACHES``. What has no test of its own goes as far as it has to.
    """
    found = [*(ROOT / "tb").rglob(f"test_{Path(file).stem}.py")]
    if reach != "own" or not found:
        above = []
        for source in sources():
            closure = [str(f.relative_to(ROOT)) for f in rtl_closure(source)]
            if source.stem in JOINTS and file in closure:
                above += [(len(closure), f) for f in (ROOT / "tb").rglob(f"test_{source.stem}.py")]
        found += [test for _, test in sorted(above)]
    if reach == "board" or not found:
        found.append(ROOT / BOARD)
    return tuple(dict.fromkeys(str(test.relative_to(ROOT)) for test in found))


class Log:
    """The verdicts of a module's mutants that still stand."""

    def __init__(self, file: str) -> None:
        folder = build_folder() / "mutants"
        folder.mkdir(exist_ok=True)
        self.path = folder / f"{Path(file).stem}.jsonl"
        self.verdicts: dict[str, dict[str, str]] = {}
        self.load()

    def load(self) -> None:
        """Read the verdicts; what changed since then ends those that read it."""
        reads: defaultdict[str, dict[str, str]] = defaultdict(dict)
        self.verdicts = defaultdict(dict)
        for line in self.path.read_text().splitlines() if self.path.exists() else []:
            try:
                row = json.loads(line)
            except json.JSONDecodeError:  # the end of a run that was killed
                continue
            test = row["test"]
            if "reads" in row:
                reads[test] = row["reads"] if row.get("anew", True) else reads[test] | row["reads"]
            elif all(_digest(name) == digest for name, digest in reads[test].items()):
                self.verdicts[test][row["mutant"]] = row["verdict"]

    def note(self, test: str, **words: object) -> None:
        """Write a line."""
        with self.path.open("a") as log:
            log.write(json.dumps({"test": test, **words}) + "\n")

    def verdict(self, mutant: Mutant, order: Sequence[str]) -> str | None:
        """Return what became of a mutant: one of ``DECIDED``, "survived", or None if it is open."""
        for test in order:
            found = self.verdicts.get(test, {}).get(mutant.name)
            if found in DECIDED:
                return found
            if found != "passed":
                return None
        return "survived"


_digests: dict[str, str] = {}


def _digest(name: str) -> str:
    if name not in _digests:
        file = ROOT / name
        _digests[name] = hashlib.sha256(file.read_bytes()).hexdigest() if file.is_file() else "gone"
    return _digests[name]


def copied(folder: Path) -> Path:
    """Copy what the tests need into a new folder and return it."""
    folder.mkdir()
    for part in PARTS:
        source = ROOT / part
        if source.is_dir():
            shutil.copytree(source, folder / part, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy2(source, folder / part)
    return folder


class Tree:
    """A copy of the project in which modules are changed and tested."""

    def __init__(self, folder: Path) -> None:
        self.folder = copied(folder)
        # What all models share is built once.
        shared = build_folder() / "runtime"
        shared.mkdir(exist_ok=True)
        (folder / "build").mkdir()
        (folder / "build" / "runtime").symlink_to(shared)
        self.running: subprocess.Popen[str] | None = None
        self.stopped = False

    def stop(self) -> None:
        """End what runs, the simulator too, and run nothing more."""
        self.stopped = True
        self._kill()

    def _kill(self) -> None:
        if self.running is not None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self.running.pid, signal.SIGKILL)

    def pytest(
        self, words: Sequence[str], job: Path | None = None, seconds: float | None = None
    ) -> tuple[int | None, str]:
        """Run pytest in the tree; return its status, None after a time-out, and what it said."""
        environment = dict(os.environ) | {
            "PYTHONPATH": str(self.folder / "model"),
            "PYTHONDONTWRITEBYTECODE": "1",
            "COCOTB_MAX_FAILURES": "1",
            "VRSCAN_ANEW": "1",  # the text stays, the mutant changes
        }
        if self.stopped:
            raise ScoreError("stopped")
        command = [sys.executable, "-m", "pytest", "-q", "-x", "-o", "timeout=0", *words]
        if job is not None:
            environment[mutant_runs.JOB] = str(job)
            command += ["-p", "mutant_runs"]
            environment["PYTHONPATH"] += os.pathsep + str(self.folder / "tb")
        with subprocess.Popen(
            command, cwd=self.folder, env=environment, text=True, start_new_session=True,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        ) as self.running:  # fmt: skip
            try:
                said, _ = self.running.communicate(timeout=seconds)
            except subprocess.TimeoutExpired:
                self._kill()
                return None, ""
        if self.stopped:
            raise ScoreError("stopped")
        return self.running.returncode, said


class Campaign:
    """One module's mutants, from test to test."""

    def __init__(self, file: str, chosen: Sequence[Mutant], log: Log, reach: str) -> None:
        self.file = file
        self.text = (ROOT / file).read_text()
        self.order = meets(file, reach)
        self.log = log
        self.chosen = chosen
        self.argued = argued()
        self.items: list[str] = []

    def verdict(self, mutant: Mutant, log: Log) -> str | None:
        """Return what became of a mutant; an argument is held against the first test only."""
        if (mutant.file, mutant.old, mutant.new) not in self.argued:
            return log.verdict(mutant, self.order)
        found = log.verdict(mutant, self.order[:1])
        return "argued" if found == "survived" else found

    def open(self) -> list[Mutant]:
        """Return the mutants that have no verdict yet."""
        self.log.load()
        return [m for m in self.chosen if self.verdict(m, self.log) is None]

    def decided(self) -> int:
        """Return how many mutants have a verdict by now."""
        log = Log(self.file)
        return sum(self.verdict(m, log) is not None for m in self.chosen)

    def run(self, tree: Tree) -> None:
        """Take every open mutant through the tests until one notices it."""
        place = tree.folder / self.file
        try:
            for k, test in enumerate(self.order):
                waiting = [
                    m
                    for m in self.open()
                    if self.log.verdict(m, self.order[: k + 1]) is None
                    and self.log.verdict(m, self.order[:k]) == "survived"
                ]
                if not waiting:
                    continue
                running = [m for m in waiting if m.place is not None]
                self.items = []
                if test == BOARD:
                    self.items = [BOARD]
                    self._reads_all(test)
                    self._board(tree, place, running)
                else:
                    self._together(tree, place, test, running)
                for mutant in waiting:
                    if mutant.place is None:
                        place.write_text(mutant.within(self.text))
                        self._alone(tree, test, mutant, self.items)
        finally:
            place.write_text(self.text)

    def _reads_all(self, test: str) -> None:
        """Note that a test may read everything."""
        files = [f for part in PARTS for f in ([ROOT / part, *(ROOT / part).rglob("*")])]
        kept = (".sv", ".py", ".toml", ".txt", ".cpp", ".h", ".vlt")
        names = [str(f.relative_to(ROOT)) for f in files if f.suffix in kept and f.is_file()]
        self.log.note(test, reads={name: _digest(name) for name in names})

    def _together(self, tree: Tree, place: Path, test: str, waiting: list[Mutant]) -> None:
        """Run one test file for mutants of one text, those apart that keep it from building."""
        while True:
            number, touched = tree.folder / "number", tree.folder / "touched"
            touched.unlink(missing_ok=True)
            number.write_text("0")
            place.write_text(schemata(self.text, waiting, number, touched))
            outcome = tree.folder / "outcome.json"
            outcome.unlink(missing_ok=True)
            job = tree.folder / "job.json"
            names = {str(k): mutant.name for k, mutant in enumerate(waiting, 1)}
            digest = hashlib.sha256(self.text.encode()).hexdigest()
            job.write_text(json.dumps({
                "mutants": names, "number": str(number), "touched": str(touched),
                "log": str(self.log.path), "outcome": str(outcome), "test": test,
                "tree": str(tree.folder), "file": self.file, "digest": digest,
            }))  # fmt: skip
            _, said = tree.pytest([test], job)
            if not outcome.exists():  # a mutant hung in code that only the death of pytest ends
                self.log.load()
                verdicts = self.log.verdicts.get(test, {})
                hung = [m for m in waiting if verdicts.get(m.name) == "started"]
                if len(hung) != 1:
                    raise ScoreError(f"{test} ended without a verdict\n{said[-2000:]}")
                self.log.note(test, mutant=hung[0].name, verdict="time-out")
                waiting = [m for m in waiting if verdicts.get(m.name) not in DECIDED]
                waiting.remove(hung[0])
                continue
            found = json.loads(outcome.read_text())
            if found["state"] == "green":
                self.items = found["items"]
                return
            if found["state"] == "red" or not waiting:
                place.write_text(self.text)
                if not waiting or tree.pytest([test], seconds=SECONDS)[0] != 0:
                    raise ScoreError(f"{test} is red without a fault\n{found['words']}")
                # Its test is no simulation, and takes no text with all forms in it.
                self._reads_all(test)
                for mutant in waiting:
                    place.write_text(mutant.within(self.text))
                    self._alone(tree, test, mutant, [test])
                return
            self.log.load()
            verdicts = self.log.verdicts.get(test, {})
            waiting = [m for m in waiting if verdicts.get(m.name) not in DECIDED]
            if len(waiting) == 1:
                self.log.note(test, mutant=waiting[0].name, verdict="invalid")
                waiting = []
                if self.items:
                    return
                continue
            bad = {int(n) for n in re.findall(rf"{re.escape(place.name)}:(\d+):", found["words"])}
            apart = [m for m in waiting if m.line in bad]
            if not apart or len(apart) == len(waiting):
                apart = waiting[: len(waiting) // 2]
            self._together(tree, place, test, apart)
            waiting = [m for m in waiting if m not in apart]

    def _board(self, tree: Tree, place: Path, waiting: list[Mutant]) -> None:
        """Run the tests that share a virtual board, for each mutant anew."""
        number = tree.folder / "number"
        if not waiting:
            return
        place.write_text(schemata(self.text, waiting, number, tree.folder / "touched"))
        number.write_text("0")
        status, said = tree.pytest([BOARD], seconds=SECONDS)
        if status != 0:
            raise ScoreError(f"{BOARD} is red without a fault\n{said[-2000:]}")
        for k, mutant in enumerate(waiting, 1):
            number.write_text(str(k))
            self._alone(tree, BOARD, mutant, [BOARD])

    def _alone(self, tree: Tree, test: str, mutant: Mutant, items: Sequence[str]) -> None:
        """Run a test for one mutant, which is in the tree."""
        status, said = tree.pytest([*(items or [test])], seconds=SECONDS)
        verdict = "passed" if status == 0 else "killed"
        if status is None:
            verdict = "time-out"
        elif status and re.search(r"%(Error|Warning)", said) and "Assertion failed in" not in said:
            verdict = "invalid"
        self.log.note(test, mutant=mutant.name, verdict=verdict)


def campaigns(chosen: Sequence[Mutant], reach: str) -> list[Campaign]:
    """Return the mutants module by module."""
    files = sorted({m.file for m in chosen})
    return [Campaign(f, [m for m in chosen if m.file == f], Log(f), reach) for f in files]


def measure(runs: Sequence[Campaign], jobs: int, report: Callable[[int], object]) -> list[str]:
    """Take all mutants through their tests; return what kept some from it."""
    # The longest first: the others fit in beside it.
    runs = sorted(runs, key=lambda run: -len(run.chosen) * len(rtl_closure(ROOT / run.file)))
    troubles: list[str] = []
    with tempfile.TemporaryDirectory(prefix="mutants-") as place:
        free: Queue[Tree] = Queue()
        trees = [Tree(Path(place) / str(k)) for k in range(jobs)]
        for tree in trees:
            free.put(tree)

        def one(run: Campaign) -> None:
            if run.open():
                tree = free.get()
                try:
                    run.run(tree)
                finally:
                    free.put(tree)

        with ThreadPoolExecutor(jobs) as pool:
            try:
                waiting = {pool.submit(one, run): run for run in runs}
                done: set[Future[None]] = set()
                while len(done) < len(waiting):
                    done, _ = wait(waiting, timeout=2.0)
                    report(sum(run.decided() for run in runs))
                for future, run in waiting.items():
                    if isinstance(error := future.exception(), ScoreError):
                        troubles.append(f"{run.file}: {error}")
                    elif error is not None:
                        raise error
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                for tree in trees:
                    tree.stop()
                raise
    return troubles


def table(runs: Sequence[Campaign], made: str) -> str:
    """Return the scores and the survivors, for the page that says how they were ``made``."""
    verdicts: dict[str, dict[Mutant, str]] = {}
    for run in runs:
        run.log.load()
        found = {m: run.verdict(m, run.log) for m in run.chosen}
        verdicts[run.file] = {m: verdict for m, verdict in found.items() if verdict is not None}
    heads = ("module", "mutants", "killed", "of these by time", "argued", "survived", "invalid")
    rows = [
        f"Made by `{made}`.",
        "",
        "| " + " | ".join(heads) + " |",
        "|---" + "|--:" * (len(heads) - 1) + "|",
    ]

    def row(name: str, found: Sequence[str]) -> str:
        late = found.count("time-out")
        counts = (
            len(found), found.count("killed") + late, late, found.count("argued"),
            found.count("survived"), found.count("invalid"),
        )  # fmt: skip
        return f"| {name} | " + " | ".join(map(str, counts)) + " |"

    for file, some in verdicts.items():
        if some:
            rows.append(row(f"`{Path(file).stem}`", list(some.values())))
    every = [(m, verdict) for some in verdicts.values() for m, verdict in some.items()]
    rows.append(row("all", [verdict for _, verdict in every]))
    count = sum(len(run.chosen) for run in runs)
    if len(every) < count:
        rows += ["", f"{count - len(every)} of the {count} that were drawn have no verdict yet."]
    left = [m for m, verdict in every if verdict == "survived"]
    if left:
        rows += ["", "What survived, by its line before and after:", ""]
        left.sort(key=lambda m: (m.file, m.line, m.column))
        rows += [f"- `{Path(m.file).name}:{m.line}` `{m.old}` `{m.new}`" for m in left]
    return "\n".join(rows)


def main(
    count: int,
    names: Sequence[str],
    *,
    seed: int,
    jobs: int,
    reach: str,
    kept: bool,
    write: bool,
) -> int:
    """Take the score of ``count`` mutants, or only show what is ``kept`` of it.

    Returns:
        0 when all have a verdict and none survives without an argument.
    """
    console = Console(highlight=False, soft_wrap=True, markup=False)
    files = [str(f.relative_to(ROOT)) for f in sources() if not names or f.stem in names]
    if unknown := set(names) - {Path(f).stem for f in files}:
        print(f"mutate: {' '.join(sorted(unknown))}: no module with mutants", file=sys.stderr)
        return 2
    chosen = sample(files, count, seed)
    runs = campaigns(chosen, reach)
    start, before = time.monotonic(), sum(run.decided() for run in runs)
    troubles: list[str] = []
    if not kept:
        try:
            with Progress(console=Console(stderr=True), transient=True) as progress:
                task = progress.add_task("mutants", total=len(chosen))
                troubles = measure(runs, jobs, lambda done: progress.update(task, completed=done))
        except KeyboardInterrupt:
            print("mutate: interrupted; the verdicts so far are kept", file=sys.stderr)
            return 130
    shown = table(runs, f"--systematic {count} --seed {seed} --reach {reach}")
    found = [run.verdict(m, run.log) for run in runs for m in run.chosen]
    console.print(shown)
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    console.print(
        f"\n{len(chosen)} mutants, {before} of them known before, in "
        f"{time.monotonic() - start:.0f} s, {used.ru_utime + used.ru_stime:.0f} s of processors"
    )
    for trouble in troubles:
        print(f"mutate: {trouble}", file=sys.stderr)
    if write and not rewrite(PAGE, {"mutants": shown}):
        raise SystemExit("mutate: docs/verification.md has no mutants markers")
    return 1 if None in found or "survived" in found else 0

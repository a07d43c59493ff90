"""A pytest plugin: every test runs once for each mutant that no test before it has noticed.

tb/mutant_score.py loads it, in a copy of the tree in which a module is the text of all its mutants
(``mutants.schemata``). A test that never simulates that module runs once. Each verdict is a line of
the log as soon as it is known.
"""

import hashlib
import json
import os
import resource
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

JOB = "VRSCAN_MUTANTS"  # in the environment: the file that says what to do


def _seconds() -> float:
    """Return the processor time of this process and of all that it has waited for."""
    both = map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(used.ru_utime + used.ru_stime for used in both)


class Runs:
    """The runs of one test file for the mutants of one module.

    The job has: ``mutants``, their names by number; ``number`` and ``touched``, the files of
    ``mutants.schemata``; ``log`` and ``outcome``, files that are written; ``test``, the test file;
    ``tree``, the copy; ``file`` and ``digest``, the module and its own text's hash.
    """

    def __init__(self, job: dict[str, Any]) -> None:
        self.job = job
        self.alive: dict[int, str] = {int(k): name for k, name in job["mutants"].items()}
        self.items: list[str] = []
        self.reads: dict[str, str] = {}
        self.state = "green"
        self.words = ""

    def note(self, **words: object) -> None:
        """Write a line into the log."""
        with open(self.job["log"], "a") as log:
            log.write(json.dumps({"test": self.job["test"], **words}) + "\n")

    def _choose(self, number: int) -> None:
        Path(self.job["number"]).write_text(str(number))

    def _seen(self) -> int:
        touched = Path(self.job["touched"])
        return touched.stat().st_size if touched.exists() else 0

    def _reads(self) -> dict[str, str]:
        """Return the hashes of all that the simulations of this file have read so far."""
        tree = Path(self.job["tree"])
        found: dict[str, str] = {}
        for kept in tree.glob(f"build/sim/*/{Path(self.job['test']).stem}_*.json"):
            found |= json.loads(kept.read_text())
        reads = {
            str(Path(name).relative_to(tree)): digest
            for name, digest in found.items()
            if Path(name).is_relative_to(tree) and not name.startswith(f"{tree}/build/")
        }
        reads |= {
            name: hashlib.sha256((tree / name).read_bytes()).hexdigest()
            for name in ("tb/mutants.py", "requirements.txt")
        }
        return dict(sorted(reads.items())) | {self.job["file"]: self.job["digest"]}

    def _judge(self, call: Callable[[], object], seconds: float) -> str:
        # In processor time, which a process that has to wait for others does not use up. What
        # starts meanwhile inherits the limit; where it is this process itself, the log tells which
        # mutant it was.
        hard = resource.getrlimit(resource.RLIMIT_CPU)[1]
        own = resource.getrusage(resource.RUSAGE_SELF)
        limit = own.ru_utime + own.ru_stime + 10.0 + 5.0 * seconds
        resource.setrlimit(resource.RLIMIT_CPU, (round(limit), hard))
        try:
            call()
        except (Exception, SystemExit, pytest.fail.Exception) as error:
            return "time-out" if str(error).endswith(f": -{signal.SIGXCPU:d}") else "killed"
        finally:
            resource.setrlimit(resource.RLIMIT_CPU, (hard, hard))
        return "passed"

    @pytest.hookimpl(tryfirst=True)
    def pytest_pyfunc_call(self, pyfuncitem: pytest.Function) -> bool:
        given = {name: pyfuncitem.funcargs[name] for name in pyfuncitem._fixtureinfo.argnames}

        def call() -> object:
            return pyfuncitem.obj(**given)

        self._choose(0)
        before, start = self._seen(), _seconds()
        call()
        if self._seen() == before:
            return True
        seconds = _seconds() - start
        self.items.append(pyfuncitem.nodeid)
        reads = self._reads()
        if reads != self.reads:
            self.note(reads=reads, anew=not self.reads)
            self.reads = reads
        for number, name in list(self.alive.items()):
            self.note(mutant=name, verdict="started")
            self._choose(number)
            verdict = self._judge(call, seconds)
            if verdict == "passed":
                self.note(mutant=name, verdict="waits")
            else:
                self.note(mutant=name, verdict=verdict, by=pyfuncitem.name)
                del self.alive[number]
        self._choose(0)
        return True

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed and self.state == "green":
            self.words = report.longreprtext
            self.state = "does not build" if "%Error" in self.words else "red"
            if "Assertion failed in" in self.words:
                self.state = "red"

    def pytest_sessionfinish(self) -> None:
        if self.state == "green":
            for name in self.alive.values():
                self.note(mutant=name, verdict="passed")
        outcome = {"state": self.state, "words": self.words[-4000:], "items": self.items}
        Path(self.job["outcome"]).write_text(json.dumps(outcome))


def pytest_configure(config: pytest.Config) -> None:
    """Take the job of the environment."""
    job = json.loads(Path(os.environ[JOB]).read_text())
    config.pluginmanager.register(Runs(job), "mutant runs")

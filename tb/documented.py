"""The commands that README and docs print, which of them a test runs, and how it has less to do."""

import re
import shlex
from collections.abc import Iterator
from pathlib import Path

from vrscan.engines.tools import repository_root

ROOT = repository_root()
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
VRSCAN = ".venv/bin/vrscan "
BLOCK = re.compile(r"^```([^\n]*)\n(.*?)^```", re.DOTALL | re.MULTILINE)

# Beginnings of the commands that no test runs as they are printed, and why.
NOT_RUN = {
    "make test": "runs this test",
    "make scan": ".ci/run runs it",
    "make formal": ".ci/run runs it",
    "make bench": "takes the better part of an hour; tb/study/bench runs its parts",
    "make board": "has no end; tb/engines/test_board.py runs the board",
    "make bitstream": "takes twenty minutes or more",
    "make mutate": "tb/scripts/test_contributing.py runs it in make soak",
    "make timing": "takes minutes",
    ".venv/bin/pytest": "tb/scripts/test_contributing.py runs it in a copy of the project",
    "openFPGALoader": "wants a board",
    "fusesoc": "tb/scripts/test_cores.py runs it",
    "ln -s ../../vr-scan": "wants a ROS workspace",
    "colcon": "wants ROS",
    ". install/setup.sh": "wants ROS",
    "ros2": "wants ROS",
    f"{VRSCAN}view --board": "renders a scene for minutes; tb/view/test_live.py runs it",
    f"{VRSCAN}efficiency": "takes minutes; tb/study/report/test_efficiency.py runs it small",
    f"{VRSCAN}bench attack": "takes minutes; tb/study/bench/test_attack.py runs it small",
    f"{VRSCAN}bench loops": "takes an hour; tb/study/report/test_loops_report.py runs it small",
    f"{VRSCAN}calibrate run-all": "takes half an hour; tb/study/test_experiment.py runs it small",
    f"{VRSCAN}report instrument": "wants that experiment; tb/study/report has its test",
}

# What a test adds to a command, by its beginning: in front of the page's own options, which then
# hold, and behind them, in their place.
LESS = {
    "scan relief": ("--engine ideal --fidelity minimal --jobs 1", "--lines 603"),
    "scan": ("--engine fixed --fidelity minimal --jobs 1", "--lines 151"),
    "budget": ("", "--lines 151"),
    "stray": ("", "--lines 151"),
    "mirror --config polygon": ("--seconds 0.01", "--config slow-polygon.toml"),
    "mirror": ("--seconds 0.12 --config slow.toml", ""),
    "calibrate coarse": ("--no-simplex", ""),
    "link watch": ("--seconds 0.2", ""),
    "link points --space": ("", "--seconds 0.5"),
    "link points": ("", "--count 100"),
    "view": ("--http-port 0", ""),
}


def shell(page: Path) -> Iterator[str]:
    """Yield each command of a page's blocks for a shell; one with a line's end in quotes is one."""
    for kind, block in BLOCK.findall(page.read_text()):
        text = ""
        for line in block.splitlines() if kind in ("sh", "console") else ():
            if kind == "console" and not line.startswith("$ "):
                continue  # what is printed
            text += line.removeprefix("$ ") + "\n"
            try:
                words = shlex.split(text, comments=True)
            except ValueError:  # within quotes
                continue
            if words:
                yield text.rstrip()
            text = ""
        assert not text, f"{page}: {text}"


def commands(page: Path) -> Iterator[list[str]]:
    """Yield the words of each ``vrscan`` command of a page."""
    for text in shell(page):
        if text.startswith(VRSCAN):
            yield shlex.split(text, comments=True)[1:]


def is_run(text: str) -> bool:
    """Return whether a test runs a command."""
    return not text.startswith(tuple(NOT_RUN))


def shortened(words: list[str]) -> list[str]:
    """Return the words of a ``vrscan`` command with less to do."""
    for name, (before, behind) in LESS.items():
        first = name.split()
        if words[: len(first)] == first:
            return [*first, *before.split(), *words[len(first) :], *behind.split()]
    return words

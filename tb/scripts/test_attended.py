"""Scripts that run tools for minutes: they say so, and Ctrl-C ends them with their tools."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from vrscan.engines.tools import repository_root

SCRIPTS = repository_root() / "scripts"
UNLIKE_ANY = f"0.{os.getpid():08}"  # of a second, by which the tools are found


def tools_left() -> int:
    """Return how many of the tools run."""
    found = 0
    for place in Path("/proc").glob("[0-9]*/cmdline"):
        with contextlib.suppress(OSError):
            words = place.read_text().split("\0")
            found += words[0] == "sleep" and words[1].endswith(UNLIKE_ANY[1:])
    return found


CODE = """
import subprocess, sys
from concurrent.futures import ThreadPoolExecutor
import attended
attended.EVERY_S = 0.2
attended.ends_with_its_tools("script")
tool = ["sh", sys.argv[1]]
with attended.told("work", 3) as step, ThreadPoolExecutor(2) as pool:
    step()
    for _ in pool.map(lambda _: subprocess.run(tool), range(8)):
        step()
"""


def test_ctrl_c_ends_a_script_with_its_tools_and_their_tools(tmp_path: Path) -> None:
    """Two tools at once, of which each has one of its own, and others still wait."""
    tool = tmp_path / "tool"
    tool.write_text(f"sleep 300{UNLIKE_ANY[1:]} & sleep 301{UNLIKE_ANY[1:]}\n")
    with subprocess.Popen(
        [sys.executable, "-c", CODE, tool], cwd=SCRIPTS, stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            assert process.stderr is not None
            assert process.stderr.readline().startswith("work: 1 of 3, ")
            begun = time.monotonic()
            while tools_left() < 4:
                assert time.monotonic() < begun + 60.0
            process.send_signal(signal.SIGINT)
            assert process.wait(30.0) == 130
            said = process.stderr.read()
        finally:
            process.kill()
    assert said.endswith("\nscript: interrupted\n") and "Traceback" not in said
    assert tools_left() == 0


@pytest.mark.parametrize("script", ["bitstream", "formal", "lint", "timing"])
def test_every_script_of_tools_ends_by_ctrl_c(script: str) -> None:
    assert f'ends_with_its_tools("{script}")' in (SCRIPTS / f"{script}.py").read_text()

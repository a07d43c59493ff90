"""The commands that README and docs print: each is run, or ``documented`` says why it is not.

A page's commands run one after another in a folder of their own, with less to do, and find what
those before have left. Boards are boards of the twins.
"""

import contextlib
import re
import shlex
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from documented import LESS, NOT_RUN, PAGES, ROOT, VRSCAN, is_run, shell, shortened
from fake_board import FakeBoard
from scene_board import let_see, scene_lines
from synthetic import plane, relief, scanned
from test_link_commands import TestBoard
from typer.testing import CliRunner

from vrscan.calibrate import recording
from vrscan.calibrate.recording import Setup
from vrscan.cli import view_commands
from vrscan.cli.app import app
from vrscan.clocked.command_executor import Outcome
from vrscan.data import recordings
from vrscan.data.config import Config, load, presets
from vrscan.data.correction_maps import focus_of_mm
from vrscan.link import selftest
from vrscan.link.device import RUN
from vrscan.scene.timeline import Scan, write_edges
from vrscan.scene.tolerances import drawn

PORT = "build/board/port"
WRITTEN = ("--out", "--csv", "--picture", "--port-file")
SLOW = "[clock]\nfrequency_hz = 10e6\n"  # a second of the mirror then takes three
SCAN = re.compile(r"^((?:relief|plane)-[\w-]+)\.(?:mcap|npz)$")  # of earlier versions, here
FOUND = {page: list(shell(page)) for page in PAGES}
RUN_PAGES = [page for page, texts in FOUND.items() if any(map(is_run, texts))]


def stood(name: str) -> Setup:
    """Return what stands before the scanner in a scan of docs/calibration.md, by its name."""
    kind, place = name.split("-", 1)
    if kind == "relief":
        return relief(float(place))
    if place == "check":
        return plane(390.0, 390.0)
    if place.startswith("f"):  # a focus: 0.512 mm of the lens to the next, as it is calibrated
        focal_mm = load(Path("build/mirror.toml")).geometry.focal_mm
        lens_mm = 1.712 + 0.512 * int(place[1])
        off_mm = 0.2 if place.endswith("near") else -0.2
        return plane(focus_of_mm(lens_mm + off_mm, focal_mm), focus_of_mm(lens_mm, focal_mm))
    z_mm = {"1": 320.0, "2": 420.0}[place[1]]
    return plane(z_mm, drive_phase={"a": 0.0, "b": 0.02}[place[0]])


def keep_lines(path: Path) -> None:
    """Write the lines of a recording as arrays."""
    kept = recordings.read(Path("build/lines/lines.mcap")).lines
    np.savez(path, lines=kept.lines, angle_rad=kept.angle_rad)


def keep_scan(path: Path) -> None:
    """Write a calibration scan of an instrument that differs."""
    with path.open("wb") as file:
        recording.write(scanned(stood(path.stem), drawn(7), len(path.stem), frames=603), file)


def keep_edges(path: Path) -> None:
    """Write the edges of a tenth of a second."""
    with path.open("wb") as file:
        write_edges(file, 0.0, 0.1, Config(), Scan(), 1)


# What a reader brings along, and how a test makes it when a command first names it.
GIVEN: dict[str, Callable[[Path], object]] = {
    "my.toml": lambda path: path.write_text('[[target]]\nkind = "plane"\n'),
    "my-site.toml": lambda path: path.write_text("range_mm = [800]\n"),
    "own.toml": lambda path: path.write_text("[focus]\naverage_points = 64\n"),
    "instrument.toml": lambda path: path.write_text("[laser]\npower_max = 30000\n"),
    "lines.npz": keep_lines,
    "edges.csv": keep_edges,
    "build/scan/points.csv": lambda _: run_one(f"{VRSCAN}scan --out build/scan"),
    "slow.toml": lambda path: path.write_text(SLOW),
    "slow-polygon.toml": lambda path: path.write_text(presets()["polygon"].read_text() + SLOW),
}


class Board(TestBoard):
    """A board whose mirror is in RUN as soon as it is enabled."""

    def _execute(self, payload: bytes) -> Outcome:
        outcome = super()._execute(payload)
        self.file.inputs["mirror_state"] = RUN * self.file.values["mirror_enable"][0]
        return outcome


def begun(board: FakeBoard) -> None:
    """Let a board be as after its reset."""
    board.reset()
    let_see(board, *scene_lines(151))
    board.file.values["line_enable"] = [0]
    board.file.inputs["mirror_state"] = 0


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder that looks like the repository's."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "build" / "board").mkdir(parents=True)
    (tmp_path / ".venv").symlink_to(Path(sys.prefix))
    (tmp_path / "scripts").symlink_to(ROOT / "scripts")
    monkeypatch.setenv("VRSCAN_PORT", PORT)
    monkeypatch.setattr(selftest, "LINES", 10)  # of each run
    monkeypatch.setattr(recording, "PLACES", 300)  # of each scan
    polls = iter([None, None])
    monkeypatch.setattr(
        view_commands,
        "interrupted",
        lambda *_: contextlib.nullcontext(lambda: next(polls, signal.SIGINT)),
    )
    return tmp_path


def run_one(text: str) -> None:
    """Run a command."""
    text = text.replace("/dev/ttyUSB0", PORT)
    if not text.startswith(VRSCAN):
        done = subprocess.run(["bash", "-ec", text], capture_output=True, text=True, check=False)
        assert done.returncode == 0, f"{text}: {done.stderr}"
        return
    words = shortened([SCAN.sub(r"\1.npz", w) for w in shlex.split(text, comments=True)[1:]])
    for word in words:
        make = keep_scan if SCAN.fullmatch(word) else GIVEN.get(word)
        if make is not None and not Path(word).exists():
            Path(word).parent.mkdir(parents=True, exist_ok=True)
            make(Path(word))
    result = CliRunner().invoke(app, words, input="\n" * 40)
    assert result.exit_code == 0, f"{text}: {result.exception!r}\n{result.output}"
    for option in set(WRITTEN) & set(words):
        path = Path(words[words.index(option) + 1])
        assert path.is_dir() or path.stat().st_size > 0, text


@pytest.mark.parametrize("page", RUN_PAGES, ids=lambda page: page.name)
def test_the_commands_of_a_page_run_one_after_another(page: Path, folder: Path) -> None:
    texts = FOUND[page]
    with contextlib.ExitStack() as stack:
        board: FakeBoard | None = None
        if any("bin/vrscan link" in text or "--port" in text for text in texts):
            board = stack.enter_context(Board(folder / PORT))
            begun(board)
        for text in filter(is_run, texts):
            if not text.startswith("export "):
                run_one(text)
            elif board is not None:
                begun(board)  # another board, in a terminal of its own


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_what_documented_commands_write_lies_below_build(page: Path) -> None:
    for text in FOUND[page]:
        words = shlex.split(text, comments=True)
        for option in set(WRITTEN) & set(words):
            assert words[words.index(option) + 1].startswith("build/"), text


def test_the_list_of_what_is_not_run_names_commands_of_the_docs() -> None:
    texts = [text for each in FOUND.values() for text in each]
    assert len(list(filter(is_run, texts))) > 50
    for beginning in NOT_RUN:
        assert any(text.startswith(beginning) for text in texts), beginning
    for beginning in LESS:
        assert any(text.startswith(f"{VRSCAN}{beginning}") for text in texts), beginning

"""``vrscan link`` whose port disappears at some moment of each command, and comes back."""

import os
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest
import test_link_commands
from fake_board import FakeBoard
from harness import in_volume
from run_command import ended

from vrscan.cli.link_commands import link
from vrscan.clocked.command_executor import Outcome

board = test_link_commands.board  # the fixture

COMMANDS = {
    "info": [],
    "registers": [],
    "read": ["k_noise"],
    "write": ["k_noise", "3"],
    "watch": ["--seconds", "0.5"],
    "points": ["--out", "points.csv", "--count", "200", "--step", "1"],
    "points, started": ["--out", "points.csv", "--count", "200", "--step", "1", "--start"],
    "capture": ["--lines", "3", "--out", "lines.mcap", "--config", "config.toml"],
    "load": ["--config", "config.toml"],
    "selftest": [],
    "bench": ["--pings", "5", "--seconds", "0.1", "--bauds", "3000000,1000000"],
}
PATIENCE_S = 20.0
QUIET = ("selftest", "bench")  # which want the lines to rest


def test_every_command_is_here() -> None:
    names = {each.name or each.callback.__name__ for each in link.registered_commands}
    assert names == {words.partition(",")[0] for words in COMMANDS}


class Counting:
    """Counts the commands that a board takes, and unplugs it at one of them."""

    def __init__(self, made: FakeBoard, last: int | None = None) -> None:
        self.count = 0
        self._last = last
        self._board = made
        self._execute: Callable[[bytes], Outcome] = made._execute
        made._execute = self

    def __call__(self, payload: bytes) -> Outcome:
        self.count += 1
        if self.count == self._last:
            self._board.unplug()
        return self._execute(payload)

    def end(self) -> int:
        """Count no more; return how many there were."""
        self._board._execute = self._execute
        return self.count


def status(monkeypatch: pytest.MonkeyPatch, *words: str) -> int:
    return ended(monkeypatch, "link", *words, "--port", "port", "--timeout", "4")


@pytest.mark.parametrize(
    ("command", "moment"),
    [
        in_volume(command, moment) if command in QUIET and moment != 0.6 else (command, moment)
        for command in COMMANDS
        for moment in (0.0, 0.3, 0.6)  # of the commands that the board takes; the last ones end it
    ],
)
def test_a_port_that_disappears_and_comes_back(
    board: FakeBoard,
    command: str,
    moment: float,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """One line says so, nothing half-written stays, and the command works when it is back."""
    board.file.values["line_enable"] = [int(command not in QUIET)]
    if "started" in command:
        board.file.inputs["mirror_state"] = 3
    words = [command.partition(",")[0], *COMMANDS[command]]
    whole = Counting(board)
    assert status(monkeypatch, *words) == 0
    capsys.readouterr()
    made = {name for name in os.listdir() if name not in ("port", "config.toml")}
    for name in ("points.csv", "lines.mcap"):
        Path(name).unlink(missing_ok=True)
    before = set(os.listdir())

    part = Counting(board, 1 + int(moment * (whole.end() - 1)))
    threads = threading.active_count()
    assert status(monkeypatch, *words) == 2
    part.end()
    told = [line for line in capsys.readouterr().err.splitlines() if line.startswith("vrscan: ")]
    assert len(told) == 1 and "the port is gone" in told[0]
    left = set(os.listdir()) | {"port"}
    assert left - before <= made
    assert all(name in told[0] for name in left - before)
    end = time.monotonic() + PATIENCE_S
    while threading.active_count() > threads and time.monotonic() < end:
        time.sleep(0.01)  # on a busy machine a thread that was told to end takes its time
    assert threading.active_count() <= threads

    board.plug()
    assert status(monkeypatch, *words) == 0

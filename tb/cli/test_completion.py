"""What a shell is told when it completes a command."""

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import click
import pytest
import typer
from typer.testing import CliRunner

from vrscan.cli.app import PANELS, app
from vrscan.cli.calibrate_commands import PANELS as CALIBRATE_PANELS
from vrscan.cli.link_commands import PANELS as LINK_PANELS
from vrscan.data.config import presets
from vrscan.scene.description import shipped

PORTS = {"ttyUSB7": "USB VID:PID=0403:6015", "ttyS0": "n/a"}


def completed(words: str) -> list[str]:
    """Return what bash would offer after the words."""
    environment = os.environ | {
        "_VRSCAN_COMPLETE": "complete_bash",
        "COMP_WORDS": words,
        "COMP_CWORD": str(len(words.split(" ")) - 1),
    }
    command = [sys.executable, "-c", "import sys; sys.argv[0] = 'vrscan'\n"
               "from vrscan.__main__ import main; main()"]  # fmt: skip
    ended = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert ended.stderr == ""
    return ended.stdout.split()


@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        ("vrscan dete", ["detectability"]),
        ("vrscan scan win", [name for name in shipped() if name.startswith("win")]),
        ("vrscan scan --config ", list(presets())),
        ("vrscan scan --fid", ["--fidelity"]),
        ("vrscan scan --fidelity mini", ["minimal"]),
        ("vrscan link write scrat", ["scratch"]),
    ],
)
def test_a_shell_completes_commands_options_and_names(words, wanted):
    assert completed(words) == wanted
    assert wanted


def test_a_shell_completes_serial_ports(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Those with a device, and those of the simulated boards that run here."""
    plugged, bare = (SimpleNamespace(device=f"/dev/{n}", hwid=h) for n, h in PORTS.items())
    monkeypatch.setattr("serial.tools.list_ports.comports", lambda: [bare, plugged])
    monkeypatch.setattr("vrscan.engines.tools.build_folder", lambda: tmp_path / "build")
    monkeypatch.chdir(tmp_path)
    port = tmp_path / "build" / "board" / "port"
    port.parent.mkdir(parents=True)
    port.touch()
    root = typer.main.get_command(app)
    for words in (["view"], ["link", "info"], ["link", "maps", "load"]):
        command = root
        for word in words:
            command = command.commands[word]
        (option,) = (each for each in command.params if each.name == "port")
        for begun, wanted in {
            "": [plugged.device, "build/board/port"],
            "/": [plugged.device, str(port)],
            "build/b": ["build/board/port"],
            "x": [],
        }.items():
            found = option.shell_complete(
                command.make_context("x", [], resilient_parsing=True), begun
            )
            assert [each.value for each in found] == wanted


@pytest.mark.parametrize("words", [[], ["link"], ["calibrate"]], ids=" ".join)
def test_every_command_has_its_panel_in_the_help(words: list[str]) -> None:
    panels = {"": PANELS, "link": LINK_PANELS, "calibrate": CALIBRATE_PANELS}[" ".join(words)]
    text = CliRunner().invoke(app, [*words, "--help"]).output
    assert [panel for panel in panels if panel not in text] == []
    names = [name for names in panels.values() for name in names]
    shown = re.findall(r"^│ ([a-z][a-z-]*) ", text, re.MULTILINE)
    assert sorted(shown) == sorted(names)


def test_nothing_of_a_help_is_taken_as_markup() -> None:
    """A word in square brackets would not be shown."""

    def texts(command: click.Command) -> Iterator[str]:
        yield command.help or ""
        yield from (getattr(each, "help", None) or "" for each in command.params)
        for each in getattr(command, "commands", {}).values():
            yield from texts(each)

    found = list(texts(typer.main.get_command(app)))
    assert len(found) > 200
    assert [text for text in found if "[" in text] == []

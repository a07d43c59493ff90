"""What a shell is told when it completes a command."""

import os
import re
import subprocess
import sys

import pytest
from typer.testing import CliRunner

from vrscan.cli.app import PANELS, app
from vrscan.data.config import presets
from vrscan.scene.description import shipped


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


def test_every_command_has_its_panel_in_the_help():
    text = CliRunner().invoke(app, ["--help"]).output
    assert [panel for panel in PANELS if panel not in text] == []
    names = [name for names in PANELS.values() for name in names]
    shown = re.findall(r"^│ ([a-z]+) ", text, re.MULTILINE)
    assert sorted(shown) == sorted(names)

"""The commands that README and docs print: they can be given so, and write below build/ only."""

import re
import subprocess
import sys
from pathlib import Path

import click
import pytest
import typer
from documented import ROOT, commands

from vrscan.cli.app import app

PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
WRITTEN = ("--out", "--csv", "--picture", "--port-file")


FOUND = [(page.name, words) for page in PAGES for words in commands(page)]


def test_there_are_commands() -> None:
    assert len(FOUND) > 20
    assert sum(bool(set(WRITTEN) & set(words)) for _, words in FOUND) > 8


@pytest.mark.parametrize(("page", "words"), FOUND, ids=[" ".join(w) for _, w in FOUND])
def test_a_documented_command_is_taken_and_leaves_git_clean(page: str, words: list[str]) -> None:
    command: click.Command = typer.main.get_command(app)
    context = None
    rest = words
    while hasattr(command, "commands"):
        context = command.make_context("vrscan", list(rest), parent=context)
        name, command, rest = command.resolve_command(
            context, [*context._protected_args, *context.args]
        )
    command.make_context(name, list(rest), parent=context)  # or it is refused, as in a shell
    for option in set(WRITTEN) & set(words):
        assert words[words.index(option) + 1].startswith("build/"), f"{page}: {words}"


def test_the_commands_of_the_formats_page_run_one_after_another(tmp_path: Path) -> None:
    """With fewer lines."""
    page = (ROOT / "docs" / "formats.md").read_text()
    blocks = re.findall(r"^```sh\n(.*?)^```", page, re.DOTALL | re.MULTILINE)
    script = "".join(block for block in blocks if "colcon" not in block)  # ROS is not here
    assert script.count("--lines 3000") == 1
    (tmp_path / "build").mkdir()
    (tmp_path / ".venv").symlink_to(Path(sys.prefix))
    done = subprocess.run(
        ["bash", "-ec", script.replace("--lines 3000", "--lines 400")],
        cwd=tmp_path,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    written = re.findall(r"build/[\w/.-]+\.\w+", script)
    assert len(written) > 10
    for name in written:
        assert (tmp_path / name).stat().st_size > 0, name

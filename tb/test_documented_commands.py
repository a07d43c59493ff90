"""The commands that README and docs print: they can be given so, and write below build/ only."""

import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import click
import pytest
import typer

from vrscan.cli.app import app
from vrscan.engines.tools import repository_root

ROOT = repository_root()
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
WRITTEN = ("--out", "--csv", "--port-file")


def commands(page: Path) -> Iterator[list[str]]:
    """Yield the words of each ``vrscan`` command in a page's code blocks."""
    for block in re.findall(r"^```\w*\n(.*?)^```", page.read_text(), re.DOTALL | re.MULTILINE):
        for line in block.splitlines():
            words = shlex.split(line.removeprefix("$ "), comments=True) if "vrscan " in line else []
            if words and words[0].endswith("bin/vrscan"):
                yield words[1:]


FOUND = [(page.name, words) for page in PAGES for words in commands(page)]


def test_there_are_commands() -> None:
    assert len(FOUND) > 20
    assert sum(bool(set(WRITTEN) & set(words)) for _, words in FOUND) > 8


@pytest.mark.parametrize(("page", "words"), FOUND, ids=[" ".join(w) for _, w in FOUND])
def test_a_documented_command_is_taken_and_leaves_git_clean(page: str, words: list[str]) -> None:
    command: click.Command = typer.main.get_command(app)  # type: ignore[assignment]
    context = None
    rest = words
    while hasattr(command, "commands"):
        context = command.make_context("vrscan", list(rest), parent=context)
        name, command, rest = command.resolve_command(  # type: ignore[attr-defined]
            context, [*context._protected_args, *context.args]
        )
    command.make_context(name, list(rest), parent=context)  # or it is refused, as in a shell
    for option in set(WRITTEN) & set(words):
        assert words[words.index(option) + 1].startswith("build/"), f"{page}: {words}"

"""The module that docs/contributing.md adds: a copy of the project with its files takes it."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from documented import ROOT
from mutant_score import Tree

FILE = re.compile(r'^```\w+ title="([^"]+)"\n(.*?)^```', re.MULTILINE | re.DOTALL)
NAME = "running_mean"


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Tree:
    """Return a copy in which each file is made, and each other block follows its first line."""
    tree = Tree(tmp_path_factory.mktemp("contributing") / "tree")
    for name, text in FILE.findall((ROOT / "docs" / "contributing.md").read_text()):
        file = tree.folder / name
        if file.exists():
            first = text.splitlines(keepends=True)[0]
            before = file.read_text()
            assert before.count(f"\n{first}") == 1, f"{name}: {first}"
            text = before.replace(f"\n{first}", f"\n{text}")
        file.write_text(text)
    return tree


def test_the_python_of_the_example_is_as_lint_wants_it(tree: Tree) -> None:
    files = list(tree.folder.rglob(f"*{NAME}.py"))
    files += [tree.folder / name for name in ("scripts/formal.py", "tb/mutate.py")]
    assert len(files) == 5
    for words in (["check"], ["format", "--check"]):
        ruff = [Path(sys.executable).with_name("ruff"), *words, "--no-cache", "-q", *files]
        done = subprocess.run(ruff, cwd=tree.folder, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr


def test_the_example_passes_its_own_test(tree: Tree) -> None:
    status, said = tree.pytest(["-n", "0", f"tb/peak/test_{NAME}.py"])
    assert status == 0, said
    assert "4 passed" in said


@pytest.mark.soak
@pytest.mark.parametrize("script", ["scripts/formal.py", "tb/mutate.py"])
def test_the_examples_proof_and_faults_hold(tree: Tree, script: str) -> None:
    command = [sys.executable, script, NAME]
    done = subprocess.run(
        command,
        cwd=tree.folder,
        env=os.environ | {"PYTHONPATH": str(tree.folder / "model")},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr

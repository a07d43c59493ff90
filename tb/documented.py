"""The commands that README and docs print."""

import re
import shlex
from collections.abc import Iterator
from pathlib import Path

from vrscan.engines.tools import repository_root

ROOT = repository_root()


def commands(page: Path) -> Iterator[list[str]]:
    """Yield the words of each ``vrscan`` command in a page's code blocks."""
    for block in re.findall(r"^```[^\n]*\n(.*?)^```", page.read_text(), re.DOTALL | re.MULTILINE):
        for line in block.splitlines():
            words = shlex.split(line.removeprefix("$ "), comments=True) if "vrscan " in line else []
            if words and words[0].endswith("bin/vrscan"):
                yield words[1:]

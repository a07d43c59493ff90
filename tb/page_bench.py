"""The live view of a board, and what is asked of its page in a browser."""

import contextlib
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager
from pathlib import Path
from typing import NamedTuple

from browser import DEEP, Browser

MODEL = "Bokeh.documents[0].get_model_by_name"


class Shown(NamedTuple):
    """A live view: URL of its page, number of its process, and the word for its buttons."""

    url: str
    pid: int
    word: str


def shown_at(port: Path, *words: str, control: bool = True) -> AbstractContextManager[Shown]:
    """Show a board."""
    return shown("--port", str(port), "--out", str(port.parent / "kept"), *words, control=control)


@contextlib.contextmanager
def shown(*words: str, control: bool = False) -> Iterator[Shown]:
    """Run the view."""
    command = [sys.executable, "-m", "vrscan", "view", "--http-port", "0", *words]
    command += ["--control"] * control
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as running:
        assert running.stdout is not None
        url = running.stdout.readline().strip()
        word = running.stdout.readline().split()[0] if control else ""
        try:
            yield Shown(url, running.pid, word)
        finally:  # a test that fails would wait for it without end
            running.send_signal(signal.SIGTERM)
        assert running.wait(60.0) == 0


@contextlib.contextmanager
def opened(url: str) -> Iterator[Browser]:
    """Open a page; its console has to stay without errors."""
    with Browser() as page:
        page.open(url)
        page.wait("window.Bokeh && Bokeh.documents.length && document.querySelector('.bk-Figure')")
        yield page
        assert page.complaints() == []


def element(page: Browser, what: str) -> str:
    """Return an expression for the only element, within shadow trees too, that fits."""
    return f"(() => {{ {DEEP} return all(document.body).find((e) => {what}) }})()"


def unlock(page: Browser, shown: Shown) -> None:
    """Type the word that the terminal printed."""
    enter(page, "word in the terminal", shown.word)
    page.wait(element(page, "e.tagName == 'BUTTON' && e.textContent.trim() == 'Start'"))


def press(page: Browser, label: str) -> None:
    """Press a button that the page hides."""
    hidden = f"{MODEL}('{label.lower()}')"
    page.wait(hidden)
    page.run(f"{hidden}.visible = true")
    click(page, label)


def click(page: Browser, label: str) -> None:
    """Press the button of this label."""
    wanted = element(page, f"e.tagName == 'BUTTON' && e.textContent.trim() == '{label}'")
    page.wait(wanted)
    page.run(f"{wanted}.click()")


def says(page: Browser, text: str, seconds: float = 20.0) -> None:
    """Wait until the page says something."""
    page.wait(element(page, f"!e.children.length && e.textContent.includes('{text}')"), seconds)


def enter(page: Browser, placeholder: str, text: str) -> None:
    """Type a text into a field."""
    field = element(page, f"e.placeholder == '{placeholder}'")
    page.run(
        f"const field = {field}; field.value = arguments[0];"
        "for (const kind of ['input', 'change']) field.dispatchEvent(new Event(kind))",
        text,
    )


def choose(page: Browser, register: str) -> None:
    """Choose a register in the list."""
    enter(page, "part of a name", register)
    cell = element(page, f"e.classList.contains('slick-cell') && e.textContent == '{register}'")
    page.wait(cell)
    page.run(f"{cell}.click()")
    says(page, f"{register}: ")


def columns(page: Browser, name: str, glyph: int, *keys: str) -> list[list[float]]:
    """Return what a figure draws."""
    found = page.run(
        f"const figure = {MODEL}(arguments[0]);"
        "const data = figure.renderers[arguments[1]].data_source.data;"
        "return arguments[2].map((key) => Array.from(data[key]))",
        name,
        glyph,
        keys,
    )
    return list(found)


def count(page: Browser) -> int:
    """Return the number of points that came."""
    tile = element(page, "e.className == 'tile' && e.textContent.endsWith('points')")
    page.wait(tile)
    return int(page.run(f"return {tile}.querySelector('b').textContent").replace(",", ""))


def grows(page: Browser, least: float, seconds: float = 20.0) -> None:
    """Wait until there are more points."""
    end = time.monotonic() + seconds
    while count(page) <= least:
        assert time.monotonic() < end
        time.sleep(0.2)

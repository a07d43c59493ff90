"""A headless Chromium, by the protocol of its driver: opens a page, looks at it, and clicks.

.venv/bin/python tb/browser.py http://127.0.0.1:5100/ build/view.png --dark --width 1440
"""

import argparse
import base64
import contextlib
import json
import shutil
import socket
import subprocess
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import Any, Self

import pytest

DRIVER, CHROMIUM = "chromedriver", "chromium"
START_S = 30.0
# The models of Bokeh stand in shadow trees, which no selector reaches from outside.
DEEP = """
const all = (root) => [...root.querySelectorAll("*")].flatMap(
  (each) => each.shadowRoot ? [each, ...all(each.shadowRoot)] : [each])
"""


def missing() -> str | None:
    """Return what this machine lacks, or None."""
    lacking = [name for name in (DRIVER, CHROMIUM) if shutil.which(name) is None]
    return f"no {' and no '.join(lacking)}: apt install chromium-driver" if lacking else None


NEEDED = pytest.mark.skipif(bool(missing()), reason=missing() or "")  # an optional program


class Browser:
    """A browser with one page.

    Args:
        width: Width of the page in px.
        height: Height of the page in px.
        dark: Whether the page is asked to be dark.
    """

    def __init__(self, width: int = 1440, height: int = 900, *, dark: bool = False) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        self._driver = subprocess.Popen(
            [DRIVER, f"--port={port}"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        self._url = f"http://127.0.0.1:{port}"
        words = ["--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars"]
        words += [f"--window-size={width},{height}", "--force-device-scale-factor=1"]
        wanted = {
            "browserName": "chrome",
            "goog:chromeOptions": {"binary": shutil.which(CHROMIUM), "args": words},
            "goog:loggingPrefs": {"browser": "ALL"},
        }
        try:
            self._wait(lambda: self._ask("GET", "/status"), START_S)
            session = self._ask("POST", "/session", capabilities={"alwaysMatch": wanted})
            self._url += f"/session/{session['sessionId']}"
            self.resize(width, height)
            scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
            self._chrome("Emulation.setEmulatedMedia", features=[scheme])
        except BaseException:
            self._driver.kill()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        with contextlib.suppress(OSError):
            self._ask("DELETE", "")
        self._driver.terminate()
        self._driver.wait()

    def resize(self, width: int, height: int) -> None:
        """Give the page another size."""
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self._chrome("Emulation.setDeviceMetricsOverride", **size)

    def open(self, url: str) -> None:
        """Open a page."""
        self._ask("POST", "/url", url=url)

    def run(self, script: str, *words: object) -> Any:
        """Run a function's body in the page, and return what it returns."""
        return self._ask("POST", "/execute/sync", script=script, args=list(words))

    def text(self) -> str:
        """Return all text of the page, that of its shadow trees too."""
        leaf = "all(document.body).filter(e => !e.children.length && e.tagName != 'STYLE' "
        leaf += "&& e.tagName != 'SCRIPT').map(e => e.textContent)"
        return str(self.run(f"{DEEP} return {leaf}.join('\\n')"))

    def wait(self, what: str, seconds: float = 20.0) -> None:
        """Wait until an expression is true in the page.

        Raises:
            TimeoutError: if it is not in time, with what the page says.
        """
        try:
            self._wait(lambda: bool(self.run(f"return Boolean({what})")) or None, seconds)
        except TimeoutError:
            raise TimeoutError(f"not in {seconds:g} s: {what}\n{self.text()}") from None

    def picture(self) -> bytes:
        """Return the whole page as PNG."""
        shot = self._chrome("Page.captureScreenshot", captureBeyondViewport=True)
        return base64.b64decode(shot["data"])

    def complaints(self) -> list[str]:
        """Return what the page wrote to its console as errors since the last call."""
        log = self._ask("POST", "/se/log", type="browser")
        return [each["message"] for each in log if each["level"] == "SEVERE"]

    def _chrome(self, command: str, **words: Any) -> Any:
        return self._ask("POST", "/goog/cdp/execute", cmd=command, params=words)

    def _ask(self, method: str, path: str, **words: Any) -> Any:
        data = json.dumps(words).encode() if method == "POST" else None
        request = urllib.request.Request(self._url + path, data, method=method)
        try:
            with urllib.request.urlopen(request, timeout=60.0) as answer:
                return json.load(answer)["value"]
        except urllib.error.HTTPError as error:
            raise RuntimeError(json.load(error)["value"]["message"].splitlines()[0]) from error

    def _wait(self, found: Callable[[], object | None], seconds: float) -> None:
        end = time.monotonic() + seconds
        while True:
            with contextlib.suppress(urllib.error.URLError, ConnectionError):
                if found() is not None:
                    return
            if time.monotonic() > end:
                raise TimeoutError
            time.sleep(0.1)


def main() -> None:
    """Take a picture of a page."""
    words = argparse.ArgumentParser(description=main.__doc__)
    words.add_argument("url")
    words.add_argument("png", type=Path)
    words.add_argument("--width", type=int, default=1440)
    words.add_argument("--height", type=int, default=1500)
    words.add_argument("--dark", action="store_true")
    words.add_argument("--after", type=float, default=8.0, help="seconds")
    given = words.parse_args()
    with Browser(given.width, given.height, dark=given.dark) as browser:
        browser.open(given.url)
        time.sleep(given.after)
        given.png.write_bytes(browser.picture())
        print("\n".join(browser.complaints()))


if __name__ == "__main__":
    main()

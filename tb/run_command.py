"""Runs the command in the test's own process."""

import signal
import sys

import pytest

from vrscan.cli import app


def ended(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> int:
    """Run ``vrscan`` and return its status; the handler of SIGTERM stays the test's own."""
    monkeypatch.setattr(sys, "argv", ["vrscan", *arguments])
    handler = signal.getsignal(signal.SIGTERM)
    with pytest.raises(SystemExit) as caught:
        app.main()
    signal.signal(signal.SIGTERM, handler)
    return int(caught.value.code or 0)

"""What holds for every test."""

import os
import signal
import sys
from collections.abc import Iterator

import harness
import pytest

from vrscan.engines.board import Board

# A shell's background jobs ignore an interrupt, and so would what the tests start to interrupt it.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.hookimpl(tryfirst=True)  # before xdist reads the groups
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Keep the tests that share a module's fixture in one worker, which then makes it once.

    So it is with those of the virtual board: its one elaboration takes minutes, for which another
    worker would wait, and two boards at once are two processors that the other tests lack.

    Where a test may draw pictures, they are looked at.
    """
    if "matplotlib.figure" in sys.modules:
        import pictures

        pictures.watch()
    for item in items:
        assert isinstance(item, pytest.Function)
        if item.get_closest_marker("xdist_group"):
            continue
        if getattr(item.module, "Board", None) is Board:
            item.add_marker(pytest.mark.xdist_group("board"))
            continue
        known = item._fixtureinfo.name2fixturedefs
        if any(known[name][-1].scope == "module" for name in item.fixturenames if name in known):
            item.add_marker(pytest.mark.xdist_group(item.module.__name__))


def pytest_configure(config: pytest.Config) -> None:
    """Let --cache-clear mean the simulations that passed before, too."""
    if config.getoption("cacheclear", default=False):
        os.environ[harness.ANEW] = "1"


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Iterator[None]:
    """Report which simulations stood: a worker's reports are all that its controller sees."""
    harness.STOOD.clear()
    yield
    if harness.STOOD:
        item.user_properties.append(("stood", len(harness.STOOD)))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Say how many simulations did not have to run."""
    passed = terminalreporter.stats.get("passed", [])
    stood = sum(n for report in passed for name, n in report.user_properties if name == "stood")
    if stood:
        terminalreporter.write_line(
            f"{stood} simulations stand as they passed: nothing that they read has changed "
            '(ARGS="--cache-clear" runs them)'
        )

"""The page in a browser, before a board made of the twins that sees a scene."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import browser
import numpy as np
import pytest
from browser import Browser
from fake_board import FakeBoard
from page_bench import (
    MODEL,
    Shown,
    choose,
    click,
    columns,
    count,
    enter,
    grows,
    opened,
    press,
    says,
    shown_at,
    unlock,
)
from scene_board import let_see, scene_lines

from vrscan.data import recordings, records
from vrscan.data.points import table
from vrscan.view import playback

pytestmark = browser.NEEDED
LINES_PER_S = 600.0
PATIENCE_S = 20.0


def until(wanted: Callable[[], bool]) -> None:
    end = time.monotonic() + PATIENCE_S
    while not wanted():
        assert time.monotonic() < end
        time.sleep(0.05)


@pytest.fixture(scope="module")
def board(tmp_path_factory: pytest.TempPathFactory) -> Iterator[FakeBoard]:
    with FakeBoard(tmp_path_factory.mktemp("view") / "port") as made:
        let_see(made, *scene_lines(753))
        made.lines_per_s = LINES_PER_S
        yield made


@pytest.fixture(scope="module")
def shown(board: FakeBoard) -> Iterator[Shown]:
    with shown_at(board.path, "--timeout", "4", "--step", "1") as made:
        yield made


@pytest.fixture(scope="module")
def page(shown: Shown) -> Iterator[Browser]:
    with opened(shown.url) as made:
        unlock(made, shown)
        yield made


def test_it_shows_the_scene_and_goes_on(page: Browser, board: FakeBoard, shown: Shown) -> None:
    says(page, "mirror RUN, settled, lines run")
    first = count(page)
    page.wait(f"{MODEL}('profile').renderers[2].data_source.data.z.length > 99")
    places = zip(*columns(page, "profile", 2, "x", "z"), strict=True)
    seen = {(r["x"] / 4096.0, r["z"] / 4096.0) for r in board.made}
    assert set(places) <= seen
    page.wait(f"{MODEL}('line').renderers[0].data_source.data.count.length")
    (pixels,) = columns(page, "line", 0, "count")
    assert any(np.array_equal(pixels, row) for row in board.pixels)
    grows(page, first)
    came = page.run("return performance.getEntriesByType('resource').map((e) => e.name)")
    assert came and all(each.startswith(shown.url) for each in came)


def test_it_writes_a_register_and_says_why_not(page: Browser, board: FakeBoard) -> None:
    choose(page, "scratch")
    says(page, "scratch: rw")
    enter(page, "value", "4711")
    click(page, "Write")
    says(page, "scratch = 4711")
    assert board.file.values["scratch"] == [4711]
    enter(page, "value", "many")
    click(page, "Write")
    says(page, "scratch: must be a number (many)")
    assert board.file.values["scratch"] == [4711]


def test_it_records_every_point(page: Browser, board: FakeBoard) -> None:
    says(page, "lines run")
    click(page, "Record")
    says(page, ": recording")
    time.sleep(1.5)
    click(page, "End")
    says(page, "points, ")
    (path,) = (board.path.parent / "kept").glob("view-*.mcap")
    kept = recordings.read(path)
    assert kept.complete and kept.lost == 0
    number = kept.points.line
    assert len(number) > LINES_PER_S
    assert int(np.sum(np.diff(number) - 1)) == int(kept.notes["account"]["missing"])
    want = table(records.points(board.made[number % len(board.made)]))
    for name in ("snr", "x_mm", "z_mm", "sigma_z_mm", "free_to_mm", "measured"):
        np.testing.assert_array_equal(getattr(kept.points, name), getattr(want, name))
    rows = {row.tobytes() for row in board.pixels}
    assert len(kept.lines) and {row.tobytes() for row in kept.lines.lines} <= rows
    times = [state["time_s"] for state in kept.board]
    assert len(times) > 2 and times == sorted(times) and "index_alive" in kept.board[0]
    played = playback.opened(path)
    assert played.length == len(number) and played.state.endswith(f"{len(kept.lines)} raw lines")


def test_it_outlives_the_port(page: Browser, board: FakeBoard) -> None:
    says(page, "live")
    before = count(page)
    board.unplug()
    says(page, "offline")
    says(page, "the port is gone")
    board.plug()
    says(page, "live")
    grows(page, before + LINES_PER_S)


def test_a_page_gives_no_orders_without_the_word(shown: Shown, board: FakeBoard) -> None:
    """Buttons that a page hides can still be pressed by a program."""
    held = board.file.values
    with opened(shown.url) as page:
        enter(page, "word in the terminal", shown.word[:-1])
        says(page, "a page was given a wrong word")
        held["laser_enable"] = [0]
        for label in ("Start", "Record", "Write"):
            press(page, label)
            says(page, "This page is read-only.")
        assert held["laser_enable"] == [0]
        unlock(page, shown)
        click(page, "Start")
        until(lambda: held["laser_enable"] == [1])
        page.open(shown.url)
        click(page, "Stop")  # needs no word
        until(lambda: held["laser_enable"] == [0])


def test_a_view_without_control_is_read_only(tmp_path: Path) -> None:
    with FakeBoard(tmp_path / "port") as other:
        held = other.file.values
        with (
            shown_at(other.path, "--timeout", "4", control=False) as shown,
            opened(shown.url) as page,
        ):
            says(page, "read-only")
            page.wait(f"{MODEL}('profile').title.text.startsWith('waiting for lines, which stand')")
            for label in ("Start", "Stop", "Unlock", "Record", "Write"):
                press(page, label)
            says(page, "This page is read-only.")
            assert held["laser_enable"] == held["line_enable"] == held["mirror_enable"] == [0]


@pytest.mark.parametrize("width", [1440, 480])
def test_nothing_is_wider_than_the_page(page: Browser, width: int) -> None:
    page.resize(width, 900)
    page.wait(f"document.documentElement.scrollWidth <= {width}")
    cards = page.run("return [...document.querySelectorAll('section')].map((e) => e.clientWidth)")
    assert min(cards) > (width - 60 if width < 900 else 200)

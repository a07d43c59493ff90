"""The page in a browser, before the RTL of the whole instrument: the virtual board."""

from collections.abc import Iterator
from pathlib import Path

import browser
import numpy as np
import pytest
from browser import Browser
from page_bench import choose, click, columns, count, enter, grows, opened, says, shown_at, unlock
from slow_board import CONFIG, SCENE

from vrscan.data import recordings
from vrscan.data.config import to_toml
from vrscan.engines.board import Board
from vrscan.scene import library
from vrscan.scene.description import load

pytestmark = browser.NEEDED
SECONDS = 120.0  # the board's are longer than those of the clock on the wall


@pytest.fixture(scope="module")
def port(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("page") / "port"


@pytest.fixture(scope="module")
def page(port: Path) -> Iterator[Browser]:
    config = port.parent / "config.toml"
    config.write_text(to_toml(CONFIG))
    words = "--config", str(config), "--timeout", "30", "--step", "5", "--start"
    with shown_at(port, *words) as shown, opened(shown.url) as made:
        unlock(made, shown)
        yield made


def board(port: Path) -> Board:
    return Board(SCENE, CONFIG, port=port, swinging=True, loaded=True)


def test_it_waits_shows_writes_records_and_comes_back(page: Browser, port: Path) -> None:
    says(page, "offline")
    with board(port):
        says(page, "mirror RUN, settled, lines run", SECONDS)
        grows(page, 200, SECONDS)
        (z,) = np.array(columns(page, "profile", 2, "z"))
        assert len(z) > 20 and (z > 200.0).all() and (z < 1100.0).all()

        choose(page, "scratch")
        enter(page, "value", "4711")
        click(page, "Write")
        says(page, "scratch = 4711", SECONDS)

        click(page, "Record")
        says(page, ": recording", SECONDS)
        grows(page, count(page) + 300, SECONDS)
        click(page, "End")
        says(page, "points, ", SECONDS)
    (path,) = (port.parent / "kept").glob("view-*.mcap")
    kept = recordings.read(path)
    assert kept.complete and kept.lost == 0 and len(kept.points) >= 300 and len(kept.lines)
    made = library.renderer(load(SCENE), CONFIG)
    truth = made.look(library.at_angles(kept.points.angle_rad, CONFIG.mirror))
    seen = kept.points.located & np.isfinite(truth.position_px)
    assert seen.sum() > 100
    error = np.abs(kept.points.z_mm - truth.z_mm)[seen]
    assert np.median(error / kept.points.sigma_z_mm[seen]) < 1.5

    says(page, "offline", SECONDS)
    before = count(page)
    with board(port):
        says(page, "live", SECONDS)
        click(page, "Start")
        grows(page, before + 100, SECONDS)

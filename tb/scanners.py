"""The shipped scanners: what depends on the instrument is tested with each of them."""

from collections.abc import Callable
from pathlib import Path

import pytest

from vrscan.data.boards import BOARDS
from vrscan.data.config import Config, load, presets

# By name; a file that joins the presets joins the tests, but for those of a board's clock and rate.
SCANNERS = {"default": load(None)} | {
    name: load(Path(name)) for name in presets() if name not in BOARDS
}


def each_scanner(having: Callable[[Config], bool] = lambda _: True) -> pytest.MarkDecorator:
    """Return what runs a test of a ``config`` with each shipped scanner that has something."""
    chosen = [pytest.param(each, id=name) for name, each in SCANNERS.items() if having(each)]
    return pytest.mark.parametrize("config", chosen)


def resonant(config: Config) -> bool:
    """Return whether a scanner's mirror swings, so that its amplitude is controlled."""
    return not config.mirror.polygon


def first_of_its_sensor(config: Config) -> bool:
    """Return whether no scanner before has the same sensor: up to a position they are the same."""
    return next(each for each in SCANNERS.values() if each.sensor == config.sensor) is config


def words(config: Config) -> list[str]:
    """Return the words by which a command takes a shipped scanner."""
    return [] if config == SCANNERS["default"] else ["--config", config.source]


EACH_SCANNER = each_scanner()
EACH_RESONANT = each_scanner(resonant)
EACH_SENSOR = each_scanner(first_of_its_sensor)

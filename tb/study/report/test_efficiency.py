"""The shipped thresholds reach the stated efficiency; the whole study is ``vrscan efficiency``."""

import pytest

from vrscan.data.config import Config
from vrscan.engines.engine import Engine
from vrscan.study.report.efficiency import (
    GOAL_EFFICIENCY,
    GOAL_LOST,
    PEAKS,
    SIGMAS_PX,
    efficiency_table,
    geometric_mean,
    study,
    worst_lost,
)

COUNT = 800  # lines a spot: a variance is known to 5 %, the mean of 20 to 1.1 %


@pytest.mark.parametrize("engine", [Engine.FIXED, Engine.IDEAL])
def test_shipped_thresholds_reach_the_goal(engine: Engine) -> None:
    done: list[int] = []
    cells = study(engine, Config(), COUNT, done.append)
    assert done == list(range(1, len(PEAKS) * len(SIGMAS_PX) + 1))
    if engine is Engine.IDEAL:
        assert study(engine, Config(), COUNT, jobs=2) == cells
    shipped, printed = [cell.shipped for cell in cells], [cell.printed for cell in cells]
    assert geometric_mean(shipped) >= GOAL_EFFICIENCY
    assert worst_lost(shipped) <= GOAL_LOST
    assert geometric_mean(printed) < 0.5
    one_pass, two_pass = [cell.one_pass for cell in cells], [cell.two_pass for cell in cells]
    assert geometric_mean(shipped) >= geometric_mean(two_pass)
    assert geometric_mean(two_pass) >= 1.03 * geometric_mean(one_pass)
    assert worst_lost(two_pass) <= GOAL_LOST
    assert max(score.rival for score in shipped) < 0.12
    assert efficiency_table(cells, engine, COUNT).row_count == len(cells)

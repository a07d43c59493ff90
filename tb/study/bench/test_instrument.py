"""The budget of the whole instrument: which lines its arithmetic counts."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from vrscan.data.config import Config
from vrscan.engines.engine import Engine, run
from vrscan.fixed import vrscan_chain
from vrscan.ideal import chain
from vrscan.scene.simulate import take
from vrscan.study.bench import instrument


@pytest.mark.parametrize(
    ("engine", "user"),
    [(Engine.FIXED, vrscan_chain), (Engine.IDEAL, chain)],
    ids=[Engine.FIXED, Engine.IDEAL],
)
def test_the_points_that_a_fit_moves_are_those_where_it_stands(
    engine: Engine, user: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By the fit's own word; one that stands may give the very position that it was given."""
    lines = take("sunlit", 700, Config()).lines
    stands = []
    module = user.peak_fit

    def peak_fit(*args: object, **named: object) -> object:
        found = module.peak_fit(*args, **named)
        stands.append(found.fitted)
        return found

    heard = SimpleNamespace(peak_fit=peak_fit, History=module.History)
    with monkeypatch.context() as patched:
        patched.setattr(user, "peak_fit", heard)
        points = run(engine, lines, Config())
    fitted = np.concatenate(stands)
    moved, joined = instrument._moved(engine, points, lines, Config())
    assert fitted.mean() > 0.2 and (points.measured & ~fitted).mean() > 0.05
    assert not (moved & (~fitted | joined)).any() and 0.0 < joined.mean() < 0.5
    assert (fitted & ~moved & ~joined).mean() < 0.01
    without = instrument.with_window(Config(), "two_pass")
    assert not instrument._moved(engine, run(engine, lines, without), lines, without)[0].any()

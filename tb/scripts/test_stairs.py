"""The measured staircase, where its data are at hand: they are not part of this repository."""

import os
import sys
from pathlib import Path

import pytest

from vrscan.engines.engine import Engine
from vrscan.engines.tools import repository_root

sys.path.insert(0, str(repository_root() / "scripts"))
import stairs


def data() -> Path:
    default = repository_root().parent / "shared" / "data"
    path = Path(os.environ.get("VRSCAN_DATA", default)) / "stairs.npz"
    if not path.is_file():
        pytest.skip(f"no {path}; set VRSCAN_DATA to the folder of stairs.npz")
    return path


@pytest.mark.parametrize("engine", list(Engine))
def test_heights_agree_with_the_caliper(engine: Engine) -> None:
    outcome = stairs.experiment(data(), engine)
    assert outcome.usable > 1300
    assert outcome.usable_valid >= stairs.GOAL_VALID * outcome.usable
    assert [level.height_mm for level in outcome.levels] == [0.0, 2.35, 20.1, 24.82]
    for level in outcome.levels:
        assert abs(level.residual_mm) <= stairs.GOAL_MM, level
    assert outcome.good


def test_the_fit_scatters_no_more_than_two_passes() -> None:
    """Of a camera's lines, which are no Gaussians: 8 bits, with a gamma, half of them saturated."""
    found = stairs.scatters(data(), Engine.FIXED)
    print({window: [round(each, 3) for each in two] for window, two in found.items()})
    # Gaps that a fit closes, as out of focus it has to, cost the saturated lines 7 %.
    for fit, two_pass, most in zip(found["fit"], found["two_pass"], (1.03, 1.08), strict=True):
        assert fit <= most * two_pass

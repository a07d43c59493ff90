"""The index mark's table: its formats, its ends, and what a straight line between entries costs."""

import math

import numpy as np
import pytest
from harness import generator
from scanners import EACH_RESONANT, SCANNERS, resonant

from vrscan.data import pkg
from vrscan.data.config import Config
from vrscan.data.errors import InputError
from vrscan.ideal.motion import crossings
from vrscan.registers.mirror_table import (
    ENTRIES,
    ENTRIES_PER_TURN,
    amplitude_table,
    interpolation_bound,
)

LARGE = [[1.0, 0.0], [0.03, 2.0], [0.01, -1.3], [4e-3, 0.7], [2e-3, 3.0], [1e-3, -1.1]]
STEP = 2.0 * math.pi * 2.0**-pkg.AMPLITUDE_FRACTION  # rad
TOP = 2**pkg.AMPLITUDE_WIDTH - 1
MARK = math.radians(17.0)
MOTIONS = {"large": LARGE} | {
    name: config.mirror.harmonics for name, config in SCANNERS.items() if resonant(config)
}


@pytest.mark.parametrize("harmonics", MOTIONS.values(), ids=MOTIONS)
@pytest.mark.parametrize("mark", [MARK, -MARK, 0.02, 1.5])
def test_entries_are_the_crossings_rounded(harmonics: list[list[float]], mark: float) -> None:
    """Every entry that is in range is within half a step; beyond, the largest; never falling."""
    amplitude, midpoint = amplitude_table(mark, harmonics)
    assert amplitude.shape == midpoint.shape == (ENTRIES,) == (1024,)
    want, middle = crossings(np.arange(ENTRIES) / 4096, mark, harmonics)
    inside = want < TOP * STEP
    assert np.abs(amplitude[inside] - want[inside] / STEP).max() <= 0.5 + 1e-6
    assert np.all(amplitude[~inside] == TOP) and np.count_nonzero(~inside) > 0
    assert np.all(np.diff(amplitude[inside]) >= 0) and amplitude.min() > 0
    error = (midpoint * 2.0**-pkg.MIDPOINT_WIDTH - middle + 0.5) % 1.0 - 0.5
    assert np.abs(error).max() <= 2.0 ** -(pkg.MIDPOINT_WIDTH + 1) * (1 + 1e-6)
    half = 2 ** (pkg.MIDPOINT_WIDTH - 1)
    assert midpoint.min() >= -half and midpoint.max() < half


@EACH_RESONANT
def test_a_mark_on_the_other_side_is_half_a_turn_away(config: Config) -> None:
    """(11): the same amplitudes, and midpoints that differ by half a turn."""
    mark, harmonics = math.radians(config.mirror.index_deg), config.mirror.harmonics
    amplitude, midpoint = amplitude_table(mark, harmonics)
    other, opposite = amplitude_table(-mark, harmonics)
    assert np.array_equal(amplitude, other)
    assert np.all((midpoint - opposite) % 2**pkg.MIDPOINT_WIDTH == 2 ** (pkg.MIDPOINT_WIDTH - 1))


@EACH_RESONANT
def test_interpolation_costs_as_much_as_predicted(
    config: Config, capsys: pytest.CaptureFixture[str]
) -> None:
    """Measured, predicted and floor of amplitude and midpoint between entries, 17 to 26 degrees."""
    mark, harmonics = math.radians(config.mirror.index_deg), config.mirror.harmonics
    amplitude, midpoint = (table.astype(float) for table in amplitude_table(mark, harmonics))
    half = generator(1).uniform(0.002, 0.14, 20_000)
    at = half * ENTRIES_PER_TURN
    got = np.interp(at, np.arange(ENTRIES), amplitude) * STEP
    want, middle = crossings(half, mark, harmonics)
    error = np.abs(got - want)
    bound = interpolation_bound(half, mark, harmonics) * 2.0 * math.pi
    shift = np.interp(at, np.arange(ENTRIES), midpoint) * 2.0**-pkg.MIDPOINT_WIDTH - middle
    with capsys.disabled():
        print(
            f"\namplitude between entries: measured {error.max() * 1e6:.3f} urad, predicted "
            f"{bound.max() * 1e6:.3f}, floor {STEP / 2e-6:.4f}; at 20.5 degrees "
            f"{error[np.abs(want - 0.3578) < 0.003].max() * 1e6:.3f} urad\n"
            f"midpoint between entries: measured {np.abs(shift).max():.2e} turns, floor "
            f"{2.0 ** -(pkg.MIDPOINT_WIDTH + 1):.2e}"
        )
    assert np.all(error <= bound * 1.001)
    assert error.max() > 0.9 * bound.max()
    assert error[want < math.radians(20.6)].max() < 0.25e-6  # a tenth of what the range asks for
    assert np.abs(shift).max() < 3 * 2.0**-pkg.MIDPOINT_WIDTH


def test_what_has_no_table_is_refused() -> None:
    for mark, harmonics, word in (
        (0.0, LARGE, "index_deg"),
        (MARK, [[1.0, 0.0], [3.0, 1.5]] + [[0.0, 0.0]] * 4, "too large"),
        (MARK, [[1.0, 0.0], [0.3, math.pi]] + [[0.0, 0.0]] * 4, "same index times"),
        (MARK, [[1.0, 0.0]] + [[0.0, 0.0]] * 9, "pairs"),
    ):
        with pytest.raises(InputError, match=word) as caught:
            amplitude_table(mark, harmonics)
        assert "\n" not in str(caught.value)

"""Float statistics, threshold and window against their definitions, pixel by pixel."""

import numpy as np
import pytest

from vrscan.ideal.peak import isolate, threshold
from vrscan.ideal.statistics import BLOCK_LENGTH, statistics

SEED = 20100301


@pytest.mark.parametrize("length", [2048, 2000, 640, 1025])
def test_background_is_that_of_the_darkest_pairs(length: int) -> None:
    rng = np.random.default_rng(SEED)
    lines = rng.integers(0, 4096, (50, length)).astype(np.uint16)
    lines[0] = 77  # flat: the first maximum is pixel 0
    lines[1, length - 1] = 4095
    found = statistics(lines, max_window=255)
    for row, line in enumerate(lines.astype(np.float64)):
        first = int(np.flatnonzero(line == line.max())[0])
        block = np.arange(length) // BLOCK_LENGTH
        own = first // BLOCK_LENGTH
        assert found.maximum[row] == line.max()
        assert found.first_maximum[row] == first
        assert found.row_mean[row] == pytest.approx(line.mean(), rel=1e-13)
        assert found.row_variance[row] == pytest.approx(line.var(), rel=1e-12)
        pairs = []
        for away in range(2, 9):
            left, right = line[block == own - away], line[block == own + away]
            sides = [side for side in (left, right) if len(side) == BLOCK_LENGTH]
            if sides:
                parts = [side.reshape(4, 16).var(axis=1, ddof=1) for side in sides]
                pairs.append([np.mean(sides), np.mean(parts)])
        pairs = sorted(pairs)[: max(min(4, len(pairs) - 3), 0)]
        assert found.row_only[row] == (not pairs)
        background, variance = np.mean(pairs, axis=0) if pairs else (line.mean(), line.var())
        far = line[np.abs(block - own) > 4] if pairs else line
        assert found.background[row] == pytest.approx(background, rel=1e-13)
        assert found.noise[row] == pytest.approx(np.sqrt(variance), rel=1e-12)
        assert found.spread[row] == pytest.approx(far.std(), rel=1e-12)


def test_a_line_without_background_uses_the_row() -> None:
    lines = np.full((1, 512), 50, np.uint16)
    lines[0, 256] = 100  # block 4 of 8: four on either side cover all
    found = statistics(lines, max_window=255)
    assert found.row_only[0]
    assert found.background[0] == found.row_mean[0]


def test_window_is_the_run_that_holds_the_maximum() -> None:
    rng = np.random.default_rng(SEED)
    lines = rng.integers(0, 8, (500, 40)).astype(np.uint16)
    first = np.argmax(lines, axis=1)
    level = rng.uniform(0.0, 8.0, 500)
    found = isolate(lines, first, level, min_width=3)
    for row, line in enumerate(lines):
        above = line > level[row]
        if not above[first[row]]:
            assert found.width[row] == 0
            left, right = first[row], first[row] - 1
        else:
            left = right = first[row]
            while left > 0 and above[left - 1]:
                left -= 1
            while right < 39 and above[right + 1]:
                right += 1
            assert (found.left[row], found.right[row]) == (left, right)
            assert found.width[row] == right - left + 1
        others = "".join("1" if a else "0" for a in above[:left])
        others += "0" + "".join("1" if a else "0" for a in above[right + 1 :])
        assert (found.rivals[row] > 0) == ("111" in others)


def test_saturated_plateau_keeps_its_middle() -> None:
    lines = np.zeros((1, 100), np.uint16)
    lines[0, 40:61] = 4095
    found = isolate(lines, np.array([40]), np.array([100.0]), min_width=3)
    assert (found.left[0], found.right[0], found.width[0]) == (40, 60, 21)


def test_threshold_takes_the_larger_term() -> None:
    background, noise = np.array([100.0, 100.0, 100.0]), np.array([5.0, 5.0, 5.0])
    maximum = np.array([200, 4000, 90])
    level = threshold(background, noise, maximum, k_noise=2.0, k_height=0.05)
    assert level.tolist() == [110.0, 295.0, 110.0]

"""Errors as the page shows them: numbers, or a word where there is no number."""

import math
from collections import Counter
from collections.abc import Sequence

NO_POSITION = "no position"
NO_POINT = "no point"
NO_PEAK = "no peak"  # S/N below the printed detector's least one
NO_WINDOW = "no window"  # not even the maximum is above the threshold
PHANTOM = "a point where there is none"
OTHER_WINDOW = "the place of another window"
ZERO_SNR = "0/0 in S/N"
ZERO_PERIOD = "0/0 in (8)"
HUGE = 1e6  # a float above this is a result of rounding only

Value = float | str


def number(value: float, unit: str) -> str:
    """Return a number with two digits and its unit."""
    if math.isnan(value):
        return "nan"
    if math.isinf(value):
        return "infinite"
    size = abs(value)
    sign = "-" if value < 0.0 else ""
    if size >= HUGE:
        return f"beyond {sign}1e6 {unit}"
    if size < 1e-5:
        return f"0 {unit}" if size == 0.0 else f"< 1e-5 {unit}"
    if size >= 99.5:
        return f"{sign}{size:.0f} {unit}"
    digits = max(0, 1 - math.floor(math.log10(size)))
    return f"{sign}{size:.{digits}f} {unit}"


def summary(values: Sequence[Value], unit: str) -> str:
    """Return the largest of the errors, and the number of lines that have a word instead.

    Args:
        values: An error or a word for each line.
        unit: Unit of the errors.
    """
    count = len(values)
    numbers = [v for v in values if not isinstance(v, str)]
    words = Counter(v for v in values if isinstance(v, str))
    parts = []
    finite = [abs(v) for v in numbers if math.isfinite(v)]
    if finite:
        parts.append(number(max(finite), unit))
    words.update("nan" if math.isnan(v) else "infinite" for v in numbers if not math.isfinite(v))
    for word, times in words.items():
        parts.append(word if times == count else f"{word} on {times} of {count}")
    return ", ".join(parts)

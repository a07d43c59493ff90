"""A sensor's pixels in another clock: the order of the words of ``rtl/sensor/pixel_fifo.sv``.

Between two clocks no model knows in which clock a word comes. Which words come, in which order, and
which words an overflow may remove, is exact.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Word:
    """The outputs of a clock with a word.

    Attributes:
        start: Whether this is the line's first pixel.
        end: Whether this is the line's last pixel.
        pixel: The pixel; None where the start comes alone, because an overflow has removed its
            pixel.
    """

    start: bool
    end: bool
    pixel: int | None


def words(samples: Iterable[tuple[bool, bool, int]]) -> list[Word]:
    """Return the words that come out where nothing overflows.

    Args:
        samples: line_valid, pixel_valid and pixel of every pixel clock, including the last line's
            fall.
    """
    sent: list[Word] = []
    line: list[int] = []
    for line_valid, pixel_valid, pixel in samples:
        if line_valid and pixel_valid:
            line.append(pixel)
        if not line_valid and line:
            last = len(line) - 1
            sent += [Word(k == 0, k == last, value) for k, value in enumerate(line)]
            line = []
    return sent


def split(sent: Iterable[Word]) -> list[list[Word]]:
    """Return words by lines; each begins with a start.

    Raises:
        ValueError: if a word belongs to no line.
    """
    found: list[list[Word]] = []
    for word in sent:
        if word.start:
            found.append([])
        elif not found or found[-1][-1].end:
            raise ValueError(f"pixel_fifo: {word} is in no line")
        found[-1].append(word)
    return found


def lost(sent: Sequence[Word], got: Sequence[Word]) -> int:
    """Return the number of lines that an overflow has cut off or removed.

    A line comes whole, or as its first pixels without its end, or as its start alone, or, if there
    was no room before its end, not at all.

    Args:
        sent: Words that ``words`` returns.
        got: Words that came out.

    Raises:
        ValueError: if ``got`` cannot come from ``sent``.
    """
    lines = split(sent)
    whole = at = 0
    for line in split(got):
        bare = line[0].pixel is None
        if bare and len(line) > 1:
            raise ValueError("pixel_fifo: a start that came alone has pixels")
        while at < len(lines) and not bare and lines[at][: len(line)] != line:
            at += 1
        if at == len(lines):
            raise ValueError(f"pixel_fifo: {line[:3]} .. was not sent, or not in this order")
        whole += not bare and line == lines[at]
        at += 1
    return len(lines) - whole

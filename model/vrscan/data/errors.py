"""Errors that end a command with a message of one line."""

import difflib
import reprlib
import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

EXIT_BAD_INPUT, EXIT_INTERRUPTED, EXIT_TERMINATED = 2, 130, 143


def alike(word: str, known: Iterable[str], most: int = 1, likeness: float = 0.5) -> list[str]:
    """Return the known words, at most so many, that are like a word in any case, best first."""
    lower = {each.lower(): each for each in known}
    found = difflib.get_close_matches(word.lower(), lower, n=most, cutoff=likeness)
    return [lower[each] for each in found]


def nearest(word: str, known: Iterable[str], most: int = 1) -> str:
    """Return "; did you mean ...?" with the known words that are most like a wrong one, or ""."""
    found = " or ".join(map(repr, alike(word, known, most)))
    return f"; did you mean {found}?" if found else ""


def beside(path: Path, *endings: str) -> str:
    """Return the same for a file that is not there, with what lies in its folder.

    Only files with one of the endings are meant, by default with that of the missing one.
    """
    wanted = endings or (path.suffix.lower(),)
    try:
        there = sorted(each for each in path.parent.iterdir() if each.suffix.lower() in wanted)
    except OSError:
        return ""
    names = {each.stem: each.name for each in there}
    found = alike(path.stem, names, likeness=0.6)
    return f"; did you mean {names[found[0]]!r}?" if found else ""


def unread(error: OSError, path: Path, *endings: str) -> str:
    """Return why a file cannot be read, with what is ``beside`` it if it is not there."""
    missing = isinstance(error, FileNotFoundError)
    return f"{error.strerror or one_line(error)}{beside(path, *endings) if missing else ''}"


class InputError(Exception):
    """Bad input: the text is one line that names the file (or key) and the value.

    The commands print it on the error stream and end with status 2.

    Example:
        >>> import vrscan
        >>> try:
        ...     lines = vrscan.simulate("plain")
        ... except vrscan.InputError as error:
        ...     print(str(error)[:5])
        plain
    """


@contextmanager
def blamed(source: str) -> Iterator[None]:
    """Return a context in which bad input names the file that it came from, too."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{source}: {error}") from error


@contextmanager
def reading(path: Path, wrong: str, *endings: str) -> Iterator[None]:
    """Return a context in which whatever a library raises is an ``InputError`` of the file.

    Args:
        path: The file.
        wrong: What is wrong with a file that the library cannot read.
        endings: As those of ``unread``.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of a library, about a damaged file
            yield
    except InputError:
        raise
    except Exception as error:  # damaged bytes make libraries raise errors of every kind
        if isinstance(error, OSError) and error.strerror:
            raise InputError(f"{path}: {unread(error, path, *endings)}") from error
        raise InputError(f"{path}: {wrong} ({one_line(error)})") from error


class InterruptError(Exception):
    """Ctrl-C with a message of one line; the commands print it and end with status 130."""


class LinesError(InputError, ValueError):
    """Lines, angles, powers or flags that no engine takes; ``contract`` defines what they take.

    It is an ``InputError``, for the user who gives a command a bad file, and a ``ValueError``, for
    the author of a program that passes bad arrays.
    """


class InputWarning(UserWarning):
    """Input that is good as far as it goes; the text is one line that says what is assumed."""


class _Short(reprlib.Repr):
    def repr_int(self, x: int, level: int) -> str:
        # Python writes no integer of more than 4300 digits.
        return repr(x) if x.bit_length() <= 128 else f"<integer of {x.bit_length()} bits>"


_SHORT = _Short()
_SHORT.maxlevel, _SHORT.maxstring, _SHORT.maxother = 3, 80, 80
_SHORT.maxdict = _SHORT.maxlist = _SHORT.maxtuple = 8


def shown(value: object) -> str:
    """Return a value as a message shows it: in one line, and short however large it is."""
    return _SHORT.repr(value)


def listed(words: Sequence[str], most: int = 12) -> str:
    """Return words with commas between them, "none", or the first of very many."""
    more = f", ... ({len(words)})" if len(words) > most else ""
    return ", ".join(cut(word, 40) for word in words[:most]) + more or "none"


def one_line(error: BaseException) -> str:
    """Return what an error of a library says, fit for a message of one line.

    That is its first line or, if it has none, its type; what a damaged file put into it is escaped,
    and cut after 200 characters.
    """
    return cut((str(error).splitlines() or [""])[0] or type(error).__name__)


def cut(text: str, most: int = 200) -> str:
    """Return at most so many characters of a text, escaped where they cannot be printed."""
    there = "".join(c if c.isprintable() else repr(c)[1:-1] for c in text[: most + 1])
    return there if len(there) <= most else f"{there[: most - 3]}..."

"""Errors that end a command with a message of one line."""

EXIT_BAD_INPUT, EXIT_INTERRUPTED, EXIT_TERMINATED = 2, 130, 143


class InputError(Exception):
    """Bad input: the text is one line that names the file (or key) and the value.

    The commands print it on the error stream and end with status 2.
    """


class InterruptError(Exception):
    """Ctrl-C with a message of one line; the commands print it and end with status 130."""


class LinesError(InputError, ValueError):
    """Lines, angles, powers or flags that no engine takes; ``contract`` defines what they take.

    It is an ``InputError``, for the user who gives a command a bad file, and a ``ValueError``, for
    the author of a program that passes bad arrays.
    """


class InputWarning(UserWarning):
    """Input that is good as far as it goes; the text is one line that says what is assumed."""


def one_line(error: BaseException) -> str:
    """Return what an error of a library says, fit for a message of one line.

    That is its first line or, if it has none, its type; what a damaged file put into it is escaped,
    and cut after 200 characters.
    """
    first = (str(error).splitlines() or [""])[0] or type(error).__name__
    shown = "".join(c if c.isprintable() else repr(c)[1:-1] for c in first[:201])
    return shown if len(shown) <= 200 else f"{shown[:197]}..."

"""What ends a command, said in one line."""

EXIT_BAD_INPUT, EXIT_INTERRUPTED, EXIT_TERMINATED = 2, 130, 143


class InputError(Exception):
    """Bad input: the text is one line that names the file (or key) and the value.

    The commands print it on the error stream and end with status 2.
    """


class InterruptError(Exception):
    """Ctrl-C, where there is more to say of it: one line, which the commands print; status 130."""


class LinesError(InputError, ValueError):
    """Lines, angles, powers or flags that no engine takes; ``contract`` says which it does.

    A command's user gave a bad file, a program's author bad arrays: it is the error of both.
    """


class InputWarning(UserWarning):
    """Input that is good as far as it goes: the text is one line that says what is assumed."""

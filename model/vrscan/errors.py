"""What the user did wrong, said in one line."""


class InputError(Exception):
    """Bad input: the text is one line that names the file (or key) and the value.

    The commands print it on the error stream and end with status 2.
    """


class LinesError(InputError, ValueError):
    """Lines, angles, powers or flags that no engine takes; ``vrscan.contract`` says which it does.

    A command's user gave a bad file, a program's author bad arrays: it is the error of both.
    """


class InputWarning(UserWarning):
    """Input that is good as far as it goes: the text is one line that says what is assumed."""

"""What the user did wrong, said in one line."""


class InputError(Exception):
    """Bad input: the text is one line that names the file (or key) and the value.

    The commands print it on the error stream and end with status 2.
    """

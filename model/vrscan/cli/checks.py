"""What commands refuse of their options."""

from pathlib import Path

from vrscan.data.errors import InputError


def check_range(name: str, value: float, low: float, high: float) -> None:
    """Raise an error, which names the option, unless its value is within a range."""
    if not low <= value <= high:  # also refuses NaN
        raise InputError(f"{name}: must be {low:g} to {high:g} ({value:g})")


def check_suffix(path: Path | None, known: tuple[str, ...]) -> str:
    """Return the suffix of a file's name, which has to be a known one."""
    if path is None:
        return ""
    if path.suffix not in known:
        raise InputError(f"{path}: must end in {' or '.join(known)}")
    return path.suffix

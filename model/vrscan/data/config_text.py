"""A configuration as the text of a TOML file, with what each value means and may be."""

import json
import textwrap
from typing import Any, Literal, get_args, get_origin

import annotated_types
from pydantic.fields import FieldInfo

from vrscan.data.config import Config, Section

COLUMNS = 100
# What follows from other values where no file says it.
FOLLOWS = {("geometry", "centre_px"), ("peak", "kappa"), ("line", "rate_hz")}
_UNIT_WORDS = (  # by the end of a key
    "_mm_per_s:mm/s _hz_per_s:Hz/s _hz:Hz _mm:mm _um:um _deg:degrees _px:px _us:us _ms:ms _ns:ns "
    "_s:s _mw:mW _uj:uJ _ppm:ppm _urad:urad _periods:periods _points:points _e:electrons"
)
_UNITS = dict(pair.split(":") for pair in _UNIT_WORDS.split(" "))


def text(config: Config, *, chosen: bool = False) -> str:
    """Return a configuration as TOML; ``config.load`` makes the same configuration of it.

    Args:
        config: The configuration.
        chosen: Whether to leave out what was not given, and what the values may be.

    Returns:
        Tables and keys in the order of ``Config``. A value that follows from others, and one that
        TOML has no word for, stands in a comment.
    """
    lines: list[str] = []
    for name in Config.model_fields:
        section: Section = getattr(config, name)
        keys = [key for key in type(section).model_fields if _given(section, key) or not chosen]
        if not keys:
            continue
        lines += [] if chosen else _comment((type(section).__doc__ or "").split("\n\n")[0])
        lines.append(f"[{name}]")
        for key in keys:
            if not chosen:
                lines += _comment(explained(key, type(section).model_fields[key]))
            lines.append(_assignment(config, name, key))
        lines.append("")
    return "\n".join(lines)


def explained(key: str, field: FieldInfo) -> str:
    """Return what a value is, its unit and its range, as far as the model has them."""
    unit = next((unit for end, unit in _UNITS.items() if key.endswith(end)), "")
    parts = [field.description or "", unit, _range(field)]
    return "; ".join(part.strip().removesuffix(".") for part in parts if part)


def _given(section: Section, key: str) -> bool:
    return key in section.model_fields_set


def _comment(words: str) -> list[str]:
    return [f"# {line}" for line in textwrap.wrap(" ".join(words.split()), COLUMNS - 2)]


def _range(field: FieldInfo) -> str:
    """Return the values that a field takes."""
    words: list[str] = []
    kind: Any = field.annotation
    if get_origin(kind) is Literal:
        words.append(" | ".join(json.dumps(value) for value in get_args(kind)))
    for inner in (*field.metadata, *(m for one in get_args(kind) for m in _metadata(one))):
        for sign, name in ((">", "gt"), (">=", "ge"), ("<", "lt"), ("<=", "le")):
            limit = getattr(inner, name, None)
            if isinstance(inner, annotated_types.BaseMetadata) and limit is not None:
                words.append(f"{sign} {limit:g}")
    return ", ".join(words)


def _metadata(kind: Any) -> tuple[Any, ...]:
    """Return what stands beside a type, and in its Field."""
    found = getattr(kind, "__metadata__", ())
    return tuple(m for one in found for m in (getattr(one, "metadata", None) or [one]))


def _assignment(config: Config, name: str, key: str) -> str:
    section: Section = getattr(config, name)
    value = getattr(section, key)
    if value is None:
        return f"# {key} ="
    shown = json.dumps(value)  # numbers, truth, texts and lists of these are the same in TOML
    follows = (name, key) in FOLLOWS and not _given(section, key)
    return f"# {key} = {shown}" if follows else f"{key} = {shown}"

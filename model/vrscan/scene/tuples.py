"""Values of several numbers in a scene's file: TOML has lists only, and a section holds tuples."""

from typing import Annotated

from pydantic import BeforeValidator

from vrscan.data.config import Positive

_LIST = BeforeValidator(lambda value: tuple(value) if isinstance(value, list) else value)

Pair = Annotated[tuple[float, float], _LIST]
Vector = Annotated[tuple[float, float, float], _LIST]
Size = Annotated[tuple[Positive, Positive], _LIST]
Size3 = Annotated[tuple[Positive, Positive, Positive], _LIST]

"""Short names for the array types that signatures use, and rows of dataclasses of such arrays."""

from collections.abc import Collection, Sequence
from dataclasses import fields, replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Ints = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]
Pixels = npt.NDArray[np.uint16]
Columns = TypeVar("Columns", bound="DataclassInstance")


def some_rows(
    columns: Columns, rows: slice | Bools | Ints, *, shared: Collection[str] = ()
) -> Columns:
    """Return some rows of a dataclass of arrays; ``shared`` names the fields that have no rows."""
    names = [each.name for each in fields(columns) if each.name not in shared]
    return replace(columns, **{name: getattr(columns, name)[rows] for name in names})


def all_rows(parts: Sequence[Columns], *, shared: Collection[str] = ()) -> Columns:
    """Return all rows of one or more dataclasses of arrays, with the first's ``shared`` fields."""
    names = [each.name for each in fields(parts[0]) if each.name not in shared]
    return replace(
        parts[0],
        **{name: np.concatenate([getattr(part, name) for part in parts]) for name in names},
    )

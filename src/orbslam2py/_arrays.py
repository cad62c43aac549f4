# SPDX-License-Identifier: BSD-3-Clause
"""Names of the array types that signatures share, and records that hold arrays.

The names tell the type of the elements; shapes, units and frames stand where an array is
described.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import Field, fields
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
ByteArray = NDArray[np.uint8]


class EqualByValue:
    """Gives a dataclass with arrays, made with ``eq=False``, what the usual one has without.

    Two records are equal if all their fields are, arrays number by number; NaN equals NaN, so that
    a copy is equal. The hash is of those fields only that cannot be changed: no arrays, no dicts.
    """

    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return all(
            _equal(getattr(self, one.name), getattr(other, one.name))
            for one in fields(self)
            if one.compare
        )

    def __hash__(self) -> int:
        values = (getattr(self, one.name) for one in fields(self) if one.compare)
        # NaN equals NaN here, but the hash of each is its own.
        same = (None if _is_nan(value) else value for value in values)
        return hash(tuple(value for value in same if isinstance(value, Hashable)))


class MadeAgainByCopies:
    """Gives a dataclass copies and pickles that are made as the record was, from its fields.

    So they are checked, and their arrays are read-only where it makes them so, which no array is
    that comes out of a pickle.
    """

    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]

    def __reduce__(self) -> tuple[type[Any], tuple[Any, ...]]:
        return type(self), tuple(getattr(self, one.name) for one in fields(self) if one.init)


def _equal(one: Any, other: Any) -> bool:
    if not (isinstance(one, np.ndarray) and isinstance(other, np.ndarray)):
        if one is None or other is None:
            return one is other
        both_nan = _is_nan(one) and _is_nan(other)
        return both_nan or one is other or bool(np.all(one == other))
    may_hold_nan = one.dtype.kind in "fc" and other.dtype.kind in "fc"
    return np.array_equal(one, other, equal_nan=may_hold_nan)


def _is_nan(value: Any) -> bool:
    return isinstance(value, float) and value != value  # noqa: PLR0124 (only NaN is not itself)

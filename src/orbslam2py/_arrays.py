# SPDX-License-Identifier: BSD-3-Clause
"""Names of array types for signatures, and records that contain arrays.

The names give the type of the elements; shapes, units and frames are in the description of each
array.
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
    """Adds equality and hash to a dataclass with arrays that has ``eq=False``.

    Two records are equal if all their fields are, arrays element by element; NaN equals NaN, so
    that a copy is equal. The hash uses only immutable fields: no arrays, no dicts.
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
    """Lets copies and pickles of a dataclass be created from its fields, like the record itself.

    So they are checked, and their arrays become read-only, which unpickled arrays are not
    otherwise.
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

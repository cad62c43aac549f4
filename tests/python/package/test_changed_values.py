# SPDX-License-Identifier: BSD-3-Clause
"""Changed copies of frozen dataclasses."""

from __future__ import annotations

import dataclasses
from functools import cached_property

import pytest

from orbslam2py._values import replace


@dataclasses.dataclass(frozen=True)
class Interval:
    begin: float
    end: float = 1.0

    @cached_property
    def length(self) -> float:
        return self.end - self.begin


def test_only_the_given_fields_change() -> None:
    interval = Interval(0.25)
    changed = replace(interval, end=2.0)
    assert changed == dataclasses.replace(interval, end=2.0) == Interval(0.25, 2.0)
    assert interval == Interval(0.25)
    with pytest.raises(dataclasses.FrozenInstanceError):
        changed.end = 3.0  # type: ignore[misc]


def test_cached_properties_are_computed_anew() -> None:
    interval = Interval(0.25)
    assert interval.length == 0.75
    assert replace(interval, end=2.0).length == 1.75


def test_an_unknown_field_is_named() -> None:
    with pytest.raises(TypeError, match="Interval has no field start"):
        replace(Interval(0.0), start=1.0)

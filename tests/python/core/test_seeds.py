# SPDX-License-Identifier: BSD-3-Clause
"""Seeds of draws."""

from __future__ import annotations

from itertools import product

from orbslam2py import _core


def test_other_numbers_give_other_seeds() -> None:
    numbers = list(product((0, 1, 2**63), (0, 1, 1000), (0, 1, 1000)))
    assert len({_core.seed_of(*n) for n in numbers}) == len(numbers)


def test_a_seed_is_the_same_everywhere() -> None:
    assert _core.seed_of(5, 17, 3) == _core.seed_of(5, 17, 3)
    assert _core.seed_of(0, 0, 0) == 2558736989570252433

# SPDX-License-Identifier: BSD-3-Clause
"""Association of time stamps, against the plain greedy walk."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from pytest_benchmark.fixture import BenchmarkFixture

from orbslam2py.trajectory import associate


def plain_greedy(first: list[float], second: list[float], limit: float) -> list[tuple[int, int]]:
    """The procedure as it is described, over all pairs."""
    pairs = sorted(
        (abs(a - b), a, b, i, j)
        for i, a in enumerate(first)
        for j, b in enumerate(second)
        if abs(a - b) < limit
    )
    used_first: set[int] = set()
    used_second: set[int] = set()
    taken = []
    for _, a, _, i, j in pairs:
        if i not in used_first and j not in used_second:
            used_first.add(i)
            used_second.add(j)
            taken.append((a, i, j))
    return [(i, j) for _, i, j in sorted(taken)]


# Multiples of 1/64 are exact, so ties are real ties.
STAMPS = st.lists(st.integers(0, 40).map(lambda k: k / 64), max_size=30)


@given(first=STAMPS, second=STAMPS, limit=st.sampled_from([1 / 64, 3 / 64, 10 / 64]))
@hypothesis_settings(max_examples=300, deadline=None)
def test_equals_the_plain_walk(first: list[float], second: list[float], limit: float) -> None:
    i, j = associate(np.array(first), np.array(second), limit)
    expected = plain_greedy(first, second, limit)
    # Equal stamps may be paired in either order: compare the stamps, and that none is used twice.
    assert [(first[a], second[b]) for a, b in zip(i, j, strict=True)] == [
        (first[a], second[b]) for a, b in expected
    ]
    assert len(set(i.tolist())) == len(i)
    assert len(set(j.tolist())) == len(j)


def test_long_chains_of_conflicts() -> None:
    """Each stamp's favourite is taken by its neighbour: the worst case for the rounds."""
    gaps = 0.019 * 0.99 ** np.arange(200)
    stamps = np.concatenate([[0.0], np.cumsum(gaps)])
    first, second = stamps[0::2], stamps[1::2]
    i, j = associate(first, second)
    expected = plain_greedy(first.tolist(), second.tolist(), 0.02)
    assert list(zip(i.tolist(), j.tolist(), strict=True)) == expected


def test_limit_is_not_reached() -> None:
    i, _ = associate(np.array([0.0, 1.0]), np.array([0.25, 1.125]), 0.25)
    np.testing.assert_array_equal(i, [1])


@pytest.mark.parametrize(("n", "m"), [(0, 0), (0, 3), (3, 0)])
def test_empty_lists(n: int, m: int) -> None:
    i, j = associate(np.arange(n) * 1.0, np.arange(m) * 1.0)
    assert len(i) == len(j) == 0


def test_output_follows_the_first_list_in_time() -> None:
    i, j = associate(np.array([2.0, 0.0, 1.0]), np.array([1.001, 2.001, 0.001]))
    np.testing.assert_array_equal(i, [1, 2, 0])
    np.testing.assert_array_equal(j, [2, 0, 1])


def test_hundred_thousand_stamps(benchmark: BenchmarkFixture) -> None:
    generator = np.random.default_rng(0)
    first = np.arange(100_000) * 0.05 + generator.uniform(0, 0.004, 100_000)
    second = np.arange(1_000_000) * 0.005
    i, _ = benchmark(associate, first, second)
    assert len(i) == 100_000

# SPDX-License-Identifier: BSD-3-Clause
"""Association of the time stamps of two lists."""

from __future__ import annotations

import numpy as np

from orbslam2py._arguments import array_of, finite_number
from orbslam2py._arrays import FloatArray, IntArray
from orbslam2py.errors import DatasetError

#: Largest difference of stamps that may belong together [s].
MAX_DIFFERENCE = 0.02

_ROUNDS = 16
_REMEDY = "seconds, 0 or more"


def associate(
    first: FloatArray,
    second: FloatArray,
    max_difference: float = MAX_DIFFERENCE,
) -> tuple[IntArray, IntArray]:
    """Pair the time stamps of two lists, each used at most once.

    The nearest of all pairs that differ by less than `max_difference` is used, then the nearest
    among the remaining stamps, and so on; of equal pairs the one with earlier stamps. This is the
    procedure of the tools of the TUM RGB-D benchmark (Sturm et al. 2012).

    Parameters
    ----------
    first, second
        Seconds, float64 (n,) and (m,), in any order.
    max_difference
        Limit in seconds; pairs must stay below it.

    Raises
    ------
    DatasetError
        If they are no lists of finite numbers, or the limit is below 0.

    Returns
    -------
    first_indices, second_indices
        int64 (k,) each, in the order of the stamps of `first`.
    """
    first = array_of(first, "the first time stamps", (-1,))
    second = array_of(second, "the second time stamps", (-1,))
    max_difference = finite_number(max_difference, "max_difference", _REMEDY, DatasetError)
    if max_difference < 0:
        raise DatasetError(f"max_difference is {max_difference:g}; give {_REMEDY}")
    i, j = _candidates(first, second, max_difference)
    order = np.lexsort((second[j], first[i], np.abs(first[i] - second[j])))
    i, j = i[order], j[order]
    taken = _take_greedily(i, j, len(first), len(second))
    i, j = i[taken], j[taken]
    by_time = np.lexsort((i, first[i]))
    return i[by_time], j[by_time]


def _candidates(
    first: FloatArray, second: FloatArray, max_difference: float
) -> tuple[IntArray, IntArray]:
    by_time = np.argsort(second, kind="stable")
    ordered = second[by_time]
    begin = np.searchsorted(ordered, first - max_difference, side="left")
    end = np.searchsorted(ordered, first + max_difference, side="right")
    counts = end - begin
    i = np.repeat(np.arange(len(first)), counts)
    within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    j = by_time[np.repeat(begin, counts) + within]
    near = np.abs(first[i] - second[j]) < max_difference
    return i[near].astype(np.int64), j[near].astype(np.int64)


def _take_greedily(i: IntArray, j: IntArray, n_first: int, n_second: int) -> IntArray:
    """Return the positions in the list of candidates (best first) that the greedy search uses."""
    remaining = np.arange(len(i))
    taken = []
    # A candidate that is the best one of both its members is taken whatever happens before it, so
    # most are found at once; only chains of conflicts are left to the walk below.
    for _ in range(_ROUNDS):
        if not len(remaining):
            break
        best_of_first = np.full(n_first, -1)
        best_of_second = np.full(n_second, -1)
        best_of_first[i[remaining[::-1]]] = remaining[::-1]
        best_of_second[j[remaining[::-1]]] = remaining[::-1]
        is_best = (best_of_first[i[remaining]] == remaining) & (
            best_of_second[j[remaining]] == remaining
        )
        accepted = remaining[is_best]
        taken.append(accepted)
        free_first, free_second = np.ones(n_first, bool), np.ones(n_second, bool)
        free_first[i[accepted]] = False
        free_second[j[accepted]] = False
        remaining = remaining[free_first[i[remaining]] & free_second[j[remaining]]]
    used_first, used_second, rest = set(), set(), []
    for position in remaining.tolist():
        a, b = int(i[position]), int(j[position])
        if a not in used_first and b not in used_second:
            used_first.add(a)
            used_second.add(b)
            rest.append(position)
    return np.concatenate([*taken, np.array(rest, dtype=np.int64)]).astype(np.int64)

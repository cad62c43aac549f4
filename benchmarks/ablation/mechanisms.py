# SPDX-License-Identifier: BSD-3-Clause
"""Mechanisms that the published method does not have, and the changes that switch each off."""

from __future__ import annotations

from collections.abc import Mapping

Changes = Mapping[str, float | int | bool]

_NEVER = 1e9

MECHANISMS: dict[str, Changes] = {
    "search of other hypotheses": {"acceptance.search_again": False},
    "cluster-robust covariance": {"acceptance.robust_covariance": False},
    "uncertain and rejected poses": {
        "acceptance.weak_share": 0,
        "acceptance.refused_share": 0,
    },
    "ambiguous places": {"relocalization.rival_share": _NEVER},
    "comparison of all views": {"initialization.compare_views": False},
    "views between the first two": {"initialization.view_between": 0},
    "keyframes before a turn": {"keyframes.kept_share": 0},
    "keyframes of few inliers": {"keyframes.few_inliers": 0},
    "more features of few inliers": {"tracking.feature_factor": 1},
}


def merged(names: list[str]) -> Changes:
    """Return the changes that switch several mechanisms off."""
    together: dict[str, float | int | bool] = {}
    for name in names:
        together |= MECHANISMS[name]
    return together

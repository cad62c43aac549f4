# SPDX-License-Identifier: BSD-3-Clause
"""What the package offers to those who import it."""

from __future__ import annotations

import pytest

import orbslam2py

pytestmark = pytest.mark.watchdog(20)


def test_everything_offered_is_there() -> None:
    for name in orbslam2py.__all__:
        assert getattr(orbslam2py, name) is not None
        assert name in dir(orbslam2py)
    with pytest.raises(AttributeError, match="Slam"):
        _ = orbslam2py.Slam  # type: ignore[attr-defined]
    assert not hasattr(orbslam2py, "path")

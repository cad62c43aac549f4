# SPDX-License-Identifier: BSD-3-Clause
"""The process of the page is as urgent as others: beside other tests it would take long."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from orbslam2py.viewer.process import companion
from support.viewer_pages import AS_URGENT


@pytest.fixture(autouse=True, scope="module")
def _as_urgent_as_others(request: pytest.FixtureRequest) -> Iterator[None]:
    if request.path.name == "test_process.py":  # which asserts how urgent it is
        yield
        return
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(companion, "_CODE", AS_URGENT + companion._CODE)
        yield

# SPDX-License-Identifier: BSD-3-Clause
"""Images are rendered whenever a test asks for them: how is what is tested."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from support.rendered_once import rendered_each_time


@pytest.fixture(autouse=True, scope="module")
def _rendered_each_time() -> Iterator[None]:
    with rendered_each_time():
        yield

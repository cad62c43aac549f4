# SPDX-License-Identifier: BSD-3-Clause
"""Examples that are started without what they need say how they are started."""

from __future__ import annotations

import re
import runpy
import sys
from pathlib import Path

import pytest

from support.data import CHECKOUT

pytestmark = pytest.mark.watchdog(30)

#: All but the one that renders its images itself.
EXAMPLES = [p for p in sorted(CHECKOUT.glob("examples/*.py")) if p.name != "your_own_images.py"]


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.name)
@pytest.mark.parametrize("n_too_many", [None, 3])
def test_usage(path: Path, n_too_many: int | None, monkeypatch: pytest.MonkeyPatch) -> None:
    arguments = [] if n_too_many is None else ["a"] * n_too_many
    monkeypatch.setattr(sys, "argv", [str(path), *arguments])
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(str(path), run_name="__main__")
    text = path.read_text()
    line = re.search(r"^python examples/\S+ .*$", text, re.MULTILINE)
    assert line is not None
    assert ended.value.code == f"usage: {line[0]}", "as in its description"


def test_there_are_some() -> None:
    assert len(EXAMPLES) >= 7

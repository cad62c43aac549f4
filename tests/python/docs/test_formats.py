# SPDX-License-Identifier: BSD-3-Clause
"""The page of what can be read is that of the code's lists."""

from __future__ import annotations

import subprocess
import sys

from orbslam2py.datasets.base import Layout
from orbslam2py.datasets.readable import READABLE_LAYOUTS
from support.documents import ROOT, read


def test_the_page_is_made_of_the_code() -> None:
    command = [sys.executable, "scripts/format_reference.py", "--check"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


def test_every_layout_is_on_the_page_once() -> None:
    named = [layout for one in READABLE_LAYOUTS for layout in one.layouts]
    assert sorted(named) == sorted(Layout)


def test_the_page_is_linked() -> None:
    assert "reference/formats.md" in read(ROOT / "mkdocs.yml")

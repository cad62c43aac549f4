# SPDX-License-Identifier: BSD-3-Clause
"""What the page of a run says first, and what it leaves out where there is nothing."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from orbslam2py.runs.report_page import write_report_page
from support.made_up_runs import made_up_run

pytestmark = pytest.mark.watchdog(60)


def changed(run: Path, **more: object) -> str:
    """The page of a run with other entries in its report.json."""
    file = run / "report.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | more))
    write_report_page(run / "report.html", run)
    return (run / "report.html").read_text().partition("<main>")[2]


def test_warnings_stand_before_everything_else(tmp_path: Path) -> None:
    run = made_up_run(tmp_path / "r")
    assert 'role="alert"' not in changed(run)
    page = changed(run, warnings=["the calibration <fits> badly", "depth images do not fit"])
    banner, _, rest = page.partition('class="tiles"')
    assert "2 warnings" in banner
    assert "The calibration &lt;fits&gt; badly" in banner
    assert "Depth images do not fit" in banner
    assert "Depth images do not fit" not in rest


def test_a_warning_is_the_likely_cause_of_an_empty_run(tmp_path: Path) -> None:
    run = made_up_run(tmp_path / "r", "n" * 12)
    assert "most likely" not in changed(run)
    assert "most likely for what the warning says" in changed(run, warnings=["it does not fit"])

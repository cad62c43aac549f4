# SPDX-License-Identifier: BSD-3-Clause
"""One or several runs as a page that needs no network: report.html.

All figures come from the files in the folders of the runs.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from orbslam2py._files import atomic_write
from orbslam2py.runs.report_page.comparison import Comparison, Row
from orbslam2py.runs.report_page.comparison_page import comparison_page
from orbslam2py.runs.report_page.page import PageKind, kind_of_page, run_page
from orbslam2py.runs.report_page.run_folder import RunFolder, read_run

__all__ = [
    "Comparison",
    "PageKind",
    "Row",
    "RunFolder",
    "compare_runs",
    "kind_of_page",
    "read_run",
    "write_comparison",
    "write_report_page",
]


def write_report_page(path: Path, folders: Path | Sequence[Path]) -> None:
    """Make the page of a run.

    Parameters
    ----------
    path : Path
        The file.
    folders : Path or sequence of Path
        The folder of the run; of several, each file is read from the first that has it.

    Raises
    ------
    DatasetError
        If the folder contains no run, or an incomplete one.
    OSError
        If the file cannot be written.
    """
    page = run_page(read_run(folders))
    with atomic_write(path) as stream:
        stream.write(page)


def compare_runs(folders: Sequence[Path]) -> Comparison:
    """Read several runs for a comparison.

    Parameters
    ----------
    folders : sequence of Path
        The folders of the runs.

    Returns
    -------
    Comparison
        Figures, trajectories in one frame, and remarks on the comparison.

    Raises
    ------
    DatasetError
        If there are fewer than two, or one is no run or an incomplete one.
    """
    return Comparison.of([read_run(folder) for folder in folders])


def write_comparison(path: Path, comparison: Comparison) -> None:
    """Make the page of several runs.

    Parameters
    ----------
    path : Path
        The file.
    comparison : Comparison
        As from `compare_runs`.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    page = comparison_page(comparison)
    with atomic_write(path) as stream:
        stream.write(page)

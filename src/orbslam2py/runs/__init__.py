# SPDX-License-Identifier: BSD-3-Clause
"""A sequence in, a folder of results out."""

from orbslam2py.runs.calibration_watch import check_calibration
from orbslam2py.runs.control import RunControl
from orbslam2py.runs.options import RunOptions
from orbslam2py.runs.report_page import (
    Comparison,
    compare_runs,
    write_comparison,
    write_report_page,
)
from orbslam2py.runs.result import FrameRow, RunResult
from orbslam2py.runs.run import FinishedRun, run_sequence
from orbslam2py.runs.runner import SequenceRunner
from orbslam2py.slam.options import SystemOptions

__all__ = [
    "Comparison",
    "FinishedRun",
    "FrameRow",
    "RunControl",
    "RunOptions",
    "RunResult",
    "SequenceRunner",
    "SystemOptions",
    "check_calibration",
    "compare_runs",
    "run_sequence",
    "write_comparison",
    "write_report_page",
]

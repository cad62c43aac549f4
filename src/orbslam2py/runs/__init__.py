# SPDX-License-Identifier: BSD-3-Clause
"""A sequence in, a folder of results out."""

from orbslam2py.runs.result import FrameRow, RunOptions, RunResult
from orbslam2py.runs.runner import SequenceRunner

__all__ = ["FrameRow", "RunOptions", "RunResult", "SequenceRunner"]

# SPDX-License-Identifier: BSD-3-Clause
"""Files that record a run: videos, and recordings for the Rerun viewer."""

from orbslam2py.recordings.rerun_recorder import RerunRecorder
from orbslam2py.recordings.video import VideoWriter

__all__ = ["RerunRecorder", "VideoWriter"]

# SPDX-License-Identifier: BSD-3-Clause
"""What was seen of a run, kept in files: videos, and recordings to be scrubbed through."""

from orbslam2py.recordings.rerun_recorder import RerunRecorder
from orbslam2py.recordings.video import VideoWriter

__all__ = ["RerunRecorder", "VideoWriter"]

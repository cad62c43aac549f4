# SPDX-License-Identifier: BSD-3-Clause
"""Lost and found: where to look for a lost camera, and when to believe that it was found."""

from orbslam2py.slam.relocalization.candidates import CandidatePlaces
from orbslam2py.slam.relocalization.confirmation import Confirmation
from orbslam2py.slam.relocalization.last_known_pose import LastKnownPose
from orbslam2py.slam.relocalization.lost_timer import LostTimer
from orbslam2py.slam.relocalization.relocalizer import Relocalizer

__all__ = [
    "CandidatePlaces",
    "Confirmation",
    "LastKnownPose",
    "LostTimer",
    "Relocalizer",
]

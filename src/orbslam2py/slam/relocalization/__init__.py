# SPDX-License-Identifier: BSD-3-Clause
"""Lost and found: where to look for a lost camera, and when to believe that it was found."""

from orbslam2py.slam.relocalization.candidates import CandidatePlaces
from orbslam2py.slam.relocalization.confirmation import Confirmation
from orbslam2py.slam.relocalization.loss_clock import LossClock
from orbslam2py.slam.relocalization.place_of_loss import PlaceOfLoss
from orbslam2py.slam.relocalization.relocalizer import Relocalizer

__all__ = [
    "CandidatePlaces",
    "Confirmation",
    "LossClock",
    "PlaceOfLoss",
    "Relocalizer",
]

# SPDX-License-Identifier: BSD-3-Clause
"""Where a lost camera is searched."""

from orbslam2py.slam.relocalization.candidates import CandidatePlaces
from orbslam2py.slam.relocalization.relocalizer import Relocalization, Relocalizer

__all__ = ["CandidatePlaces", "Relocalization", "Relocalizer"]

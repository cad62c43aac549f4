# SPDX-License-Identifier: BSD-3-Clause
"""Search of a lost camera in the map."""

from orbslam2py.slam.relocalization.candidates import CandidatePlaces
from orbslam2py.slam.relocalization.relocalizer import Relocalization, Relocalizer

__all__ = ["CandidatePlaces", "Relocalization", "Relocalizer"]

# SPDX-License-Identifier: BSD-3-Clause
"""Textured worlds with exact ground truth, as a sequence or as a data set on disk."""

from orbslam2py.synthetic.motions import SyntheticMotion
from orbslam2py.synthetic.options import SyntheticOptions
from orbslam2py.synthetic.scenes import Corners, SyntheticWorld
from orbslam2py.synthetic.sequence import DEPTH_PER_METRE, SyntheticSequence

__all__ = [
    "DEPTH_PER_METRE",
    "Corners",
    "SyntheticMotion",
    "SyntheticOptions",
    "SyntheticSequence",
    "SyntheticWorld",
]

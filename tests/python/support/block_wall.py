# SPDX-License-Identifier: BSD-3-Clause
"""A wall of grey blocks and words for it: the smallest world that keyframes can be matched in."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from orbslam2py import _core as core

WIDTH, HEIGHT = 320, 240
DEPTH = 2.5  # metres: one pixel to the side is one centimetre


def context(**options: object) -> core.FrameContext:
    """A camera before the wall, with options of its own."""
    usual = {"fx": 250.0, "fy": 250.0, "cx": 160.0, "cy": 120.0, "width": WIDTH, "height": HEIGHT}
    usual |= {"bf": 25.0, "depth_ratio": 40.0}
    return core.FrameContext(
        core.Camera(core.CameraOptions(**{**usual, **options})), core.ScalePyramid(1.2, 8)
    )


def texture(shift: int = 0, seed: int = 0) -> npt.NDArray[np.uint8]:
    """The wall, seen from `shift` pixels further to the right."""
    blocks = np.random.default_rng(seed).integers(0, 256, (30, 80), dtype=np.uint8)
    wall = np.kron(blocks, np.ones((8, 8), dtype=np.uint8))
    return np.ascontiguousarray(wall[:, shift : shift + WIDTH])


def some_frame() -> core.Frame:
    """What one camera sees of the wall: fifty keypoints."""
    extraction = core.OrbExtractor(core.OrbOptions(n_features=50)).extract(texture())
    return core.build_monocular_frame(context(bf=0.0), 0, 0.0, extraction)


def ten_words() -> core.Vocabulary:
    """A vocabulary of ten random words."""
    rng = np.random.default_rng(1)
    return core.Vocabulary.from_table(
        10,
        1,
        core.Scoring.L1,
        core.Weighting.TF_IDF,
        np.zeros(10, np.uint32),
        np.ones(10, np.uint8),
        rng.integers(0, 256, (10, 32), np.uint8),
        np.ones(10),
    )

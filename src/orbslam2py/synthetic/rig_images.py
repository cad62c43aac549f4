# SPDX-License-Identifier: BSD-3-Clause
"""The images of all cameras of a rig."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbslam2py._arrays import FloatArray
from orbslam2py.datasets import Images
from orbslam2py.settings import RigCamera
from orbslam2py.synthetic import lens
from orbslam2py.synthetic.wide_view import RenderSide, WideView


class RigEffects(NamedTuple):
    """What happens between the world and the images of one moment."""

    exposure: float
    """Factor on the grey values."""
    noise: float
    """Of the grey values."""
    seed: int
    seconds: float = 0.0
    """Time of the world's moving parts."""
    hand_rows: int = 0
    """Rows of the first image, from below, that a hand covers."""
    dark: bool = False
    """The hand covers all cameras."""


def images_of_rig(
    rig: Sequence[RigCamera],
    views: Sequence[WideView],
    side_of: Callable[[FloatArray], RenderSide],
    T_wb: FloatArray,
    number: int,
    effects: RigEffects,
    measured: Callable[[NDArray[np.float32], int], NDArray[np.uint16]],
) -> Images:
    """Render the images of all cameras.

    Parameters
    ----------
    rig, views
        The cameras, and what renders through their lenses.
    side_of
        Renders sides of the cube around a camera with this pose, camera to world (4, 4).
    T_wb
        Pose of the body.
    number
        Of the moment; seed of the noise.
    effects
        Exposure, noise and hand.
    measured
        Makes a depth image of depths along z [m].
    """
    cameras: list[Any] = []
    for k, (member, view) in enumerate(zip(rig, views, strict=True)):
        own = len(rig) * number + k
        image, depth = view.render(side_of(np.asarray(T_wb @ member.T_body_camera)))
        grey = lens.exposed(image, effects.exposure, effects.noise, [effects.seed, own])
        rows = effects.hand_rows if k == 0 or effects.dark else 0
        grey, depth = lens.covered(grey, depth, min(rows, grey.shape[0]))
        cameras.append((grey, measured(depth, own)) if member.depth else grey)
    first = cameras[0][0] if rig[0].depth else cameras[0]
    return Images(first, cameras=tuple(cameras))

# SPDX-License-Identifier: BSD-3-Clause
"""A path cut into parts in another order, with darkness between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from orbslam2py._arrays import IntArray
from orbslam2py.errors import SettingsError
from orbslam2py.synthetic.options import SyntheticOptions

#: Seconds in the dark between two pieces if nobody says anything else.
GAP = 3.0
#: Tells the draw of an order from others with the same seed.
_STREAM = 0x0BDE


@dataclass(frozen=True, eq=False)
class Arrangement:
    """Which image of the whole path each image is, and which are dark."""

    of_way: IntArray
    """(n,) number on the path; in the dark that of the image before, because the camera stands."""
    dark: npt.NDArray[np.bool_]
    """(n,)"""


def arrange(options: SyntheticOptions, n_images: int, fps: float) -> Arrangement:
    """Cut a path into the requested parts.

    Parameters
    ----------
    options
        Parts, their order, gap and overlap.
    n_images
        Number of images of the whole path.
    fps
        Images per second.

    Raises
    ------
    SettingsError
        If there are more parts than images.
    """
    n_pieces = options.pieces
    if n_pieces is None:
        return Arrangement(np.arange(n_images), np.zeros(n_images, np.bool_))
    if n_pieces > n_images:
        raise SettingsError(
            f"pieces is {n_pieces}, of a way of {n_images} images; take fewer pieces or more frames"
        )
    n_dark = round(fps * (GAP if options.gap is None else options.gap))
    n_shared = round(fps * (options.overlap or 0.0))
    order = _shuffled(n_pieces, options.seed) if options.order is None else options.order
    bounds = np.linspace(0, n_images, n_pieces + 1).astype(int)
    parts: list[IntArray] = []
    dark: list[npt.NDArray[np.bool_]] = []
    for place, number in enumerate(order):
        if place > 0:
            parts.append(np.full(n_dark, parts[-1][-1]))
            dark.append(np.ones(n_dark, np.bool_))
        first = max(0, int(bounds[number]) - n_shared)
        part = np.arange(first, min(n_images, int(bounds[number + 1]) + n_shared))
        parts.append(part)
        dark.append(np.zeros(len(part), np.bool_))
    return Arrangement(np.concatenate(parts), np.concatenate(dark))


def _shuffled(n_pieces: int, seed: int) -> tuple[int, ...]:
    """Return an order that differs from that of the path, if there is one."""
    random = np.random.default_rng([seed, _STREAM])
    while True:
        order = tuple(random.permutation(n_pieces).tolist())
        if n_pieces == 1 or order != tuple(range(n_pieces)):
            return order

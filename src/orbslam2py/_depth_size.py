# SPDX-License-Identifier: BSD-3-Clause
"""Depth images that are smaller than their colour images, as from phones with a LiDAR."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

#: Depth of phones is up to 7.5 times smaller than their images.
_MOST_TIMES_SMALLER = 16


def depth_size_problem(depth: tuple[int, ...], image: tuple[int, ...]) -> str | None:
    """Return why depth cannot be resized to its image; None if it can.

    Parameters
    ----------
    depth, image
        Shapes: rows, columns, and further dimensions.
    """
    (h, w), (H, W) = depth[:2], image[:2]
    sizes = f"depth has size {w}x{h}, the image {W}x{H}"
    if min(h, w) == 0:
        return f"{sizes}; give depth images with pixels"
    if w * _MOST_TIMES_SMALLER < W:
        return f"{sizes}, which is too small for depth of it; give the depth image of this image"
    # A size that was divided is rounded: less than a pixel is no other aspect.
    if abs(w * H - W * h) >= max(W, H):
        return (
            f"{sizes}: width and height have another ratio ({w / h:.3f} and {W / H:.3f}), so they "
            "do not show the same view; register depth to the image"
        )
    if h > H or w > W:
        return (
            f"{sizes}: depth is the larger one; make it as large as the image, by nearest "
            f"neighbour: depth = cv2.resize(depth, ({W}, {H}), interpolation=cv2.INTER_NEAREST)"
        )
    return None


def enlarged_depth(depth: NDArray[np.generic], image: tuple[int, ...]) -> NDArray[np.generic]:
    """Give every pixel of an image the depth (h, w) of the depth pixel that covers its centre.

    OpenCV's ``INTER_NEAREST_EXACT`` may choose the other pixel if a centre is on the border of two,
    as in an enlargement from 192 to 1440 rows.

    Parameters
    ----------
    depth
        Of any type, with the aspect of the image.
    image
        Shape of the image.
    """
    rows, columns = (
        ((np.arange(large) + 0.5) * (small / large)).astype(np.intp)
        for large, small in zip(image[:2], depth.shape, strict=True)
    )
    larger: NDArray[np.generic] = depth[rows[:, None], columns]
    return larger

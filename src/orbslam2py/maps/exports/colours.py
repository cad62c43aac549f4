# SPDX-License-Identifier: BSD-3-Clause
"""Colours for the keypoints of a map that was made without them, from the keyframes' images."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from orbslam2py._arrays import ByteArray
from orbslam2py.maps.contents import MapContents, contents_of
from orbslam2py.maps.exports.images import ImageOfKeyframe, image_of_row


class ColourSampler:
    """Collects colours keyframe by keyframe; those that a map has already stay.

    Parameters
    ----------
    contents
        The map.
    """

    def __init__(self, contents: MapContents) -> None:
        self._contents = contents
        keyframes = contents.keyframes
        self._known = keyframes.has_colours.copy()
        self._colours = (
            keyframes.colours.copy()
            if len(keyframes.colours)
            else np.zeros((len(keyframes.keypoints), 3), np.uint8)
        )

    def look_at(self, row: int, image: ByteArray) -> None:
        """Take the colours of a keyframe from its image.

        Parameters
        ----------
        row
            Of the keyframe.
        image
            As its camera saw it, uint8 (h, w) grey or (h, w, 3) RGB; another size is a scaled one.
        """
        if self._known[row]:
            return
        keyframes, cameras = self._contents.keyframes, self._contents.cameras
        part = keyframes.keypoints_of(row)
        raw = keyframes.raw_keypoints if len(keyframes.raw_keypoints) else keyframes.keypoints
        camera = int(keyframes.camera[row])
        height, width = image.shape[:2]
        scale = [width / int(cameras.width[camera]), height / int(cameras.height[camera])]
        # The pixel that a position lies in: the centre of the first is (0, 0).
        u, v = np.floor((raw[part] + 0.5) * scale).astype(np.int64).T
        seen = image[np.clip(v, 0, height - 1), np.clip(u, 0, width - 1)]
        self._colours[part] = seen if image.ndim == 3 else seen[:, None]
        self._known[row] = True

    def coloured(self) -> MapContents:
        """Return the map with all colours that are known."""
        if not self._known.any():
            return self._contents
        keyframes = replace(
            self._contents.keyframes, has_colours=self._known, colours=self._colours
        )
        return replace(self._contents, keyframes=keyframes)


def with_colours(contents: MapContents, images: ImageOfKeyframe) -> MapContents:
    """Colour the keypoints of keyframes that have no colours, from their images.

    Parameters
    ----------
    contents
        The map.
    images
        Where the keyframes' images come from; see `images_of`.

    Returns
    -------
    MapContents
        The same map; `MapContents.point_colours` then knows the points' colours.

    Raises
    ------
    ImageError
        If an image is not one that fits its camera.
    MapFileError
        If `contents` or `images` is something else.
    """
    contents_of(contents)
    sampler = ColourSampler(contents)
    for row in range(len(contents.keyframes)):
        if not contents.keyframes.has_colours[row]:
            image = image_of_row(contents, row, images)
            if image is not None:
                sampler.look_at(row, image)
    return sampler.coloured()

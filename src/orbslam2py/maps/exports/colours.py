# SPDX-License-Identifier: BSD-3-Clause
"""Colours for keypoints of a map without colours, from the images of its keyframes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from orbslam2py._arrays import ByteArray
from orbslam2py.maps.contents import MapContents, contents_of
from orbslam2py.maps.exports.images import ImageOfKeyframe, image_of_row


class ColourSampler:
    """Adds colours keyframe by keyframe; existing colours do not change.

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
            The distorted image, uint8 (h, w) grey or (h, w, 3) RGB; an image of another size counts
            as scaled.
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
        """Return the map with all known colours."""
        if not self._known.any():
            return self._contents
        keyframes = replace(
            self._contents.keyframes, has_colours=self._known, colours=self._colours
        )
        return replace(self._contents, keyframes=keyframes)


def with_colours(contents: MapContents, images: ImageOfKeyframe) -> MapContents:
    """Add colours from images to keypoints of keyframes without colours.

    Parameters
    ----------
    contents
        The map.
    images
        The source of the keyframes' images; see `images_of`.

    Returns
    -------
    MapContents
        The same map with colours, as `MapContents.point_colours` uses them.

    Raises
    ------
    ImageError
        If an image does not fit its camera.
    MapFileError
        If `contents` or `images` is invalid.
    """
    contents_of(contents)
    sampler = ColourSampler(contents)
    for row in range(len(contents.keyframes)):
        if not contents.keyframes.has_colours[row]:
            image = image_of_row(contents, row, images)
            if image is not None:
                sampler.look_at(row, image)
    return sampler.coloured()

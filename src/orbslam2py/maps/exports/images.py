# SPDX-License-Identifier: BSD-3-Clause
"""Images of keyframes: their sources, and their use in exports."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from orbslam2py._arguments import instance_of, path_of, shown
from orbslam2py._arrays import ByteArray, FloatArray
from orbslam2py.errors import DatasetError, ImageError, MapFileError
from orbslam2py.maps.contents import MapContents, contents_of
from orbslam2py.maps.exports.pinhole_views import PinholeView
from orbslam2py.settings import CameraModel, Settings
from orbslam2py.trajectory import associate

#: Gives the image of a keyframe by its id, uint8 (h, w) grey or (h, w, 3) RGB; None: there is none.
ImageOfKeyframe = Callable[[int], ByteArray | None]

#: Called after every image with how many are done and how many there are.
Progress = Callable[[int, int], None]

#: Time stamps of a keyframe and of its image are the same text, read twice [s].
_SAME_TIME = 1e-3


class _HasImage(Protocol):
    @property
    def image(self) -> ByteArray: ...


class ImageSequence(Protocol):
    """Argument of `images_of`: a sequence from `orbslam2py.open_sequence`, or a similar object.

    Attributes
    ----------
    settings
        The settings, which give the order of the colours (``camera.rgb``).
    timestamps
        Seconds, float64 (n,).
    """

    @property
    def settings(self) -> Settings: ...  # noqa: D102
    @property
    def timestamps(self) -> FloatArray: ...  # noqa: D102

    def load(self, index: int, /) -> _HasImage:
        """Read (and rectify) a frame; its ``image`` is of the single or left camera."""
        ...


def images_of(contents: MapContents, sequence: ImageSequence) -> ImageOfKeyframe:
    """Find the images of the keyframes in their sequence by the time stamps.

    Parameters
    ----------
    contents
        The map.
    sequence
        The sequence, opened for the same sensor, so that images of a pair are rectified as before.

    Returns
    -------
    callable
        ``image(keyframe_id)``: uint8 (h, w) or (h, w, 3) RGB; None for a keyframe without an image.

    Raises
    ------
    DatasetError
        If no keyframe's time stamp is in the sequence.
    MapFileError
        If `contents` is invalid.
    """
    keyframes = contents_of(contents).keyframes
    rows, indices = associate(keyframes.timestamps, sequence.timestamps, _SAME_TIME)
    if not len(rows):
        raise DatasetError(
            "no image of the sequence has the time stamp of a keyframe (keyframes "
            f"{_span(keyframes.timestamps)}, images {_span(sequence.timestamps)}); give the "
            "sequence that the map was made of"
        )
    frames = dict(zip(keyframes.ids[rows].tolist(), indices.tolist(), strict=True))
    to_rgb = not sequence.settings.camera.rgb

    def image_of(keyframe_id: int) -> ByteArray | None:
        index = frames.get(keyframe_id)
        if index is None:
            return None
        image = sequence.load(index).image
        if image.ndim == 2:
            return image
        return np.ascontiguousarray(image[:, :, 2::-1] if to_rgb else image[:, :, :3])

    return image_of


def image_of_row(contents: MapContents, row: int, images: ImageOfKeyframe) -> ByteArray | None:
    """Return the image of a keyframe; small copies are allowed.

    Parameters
    ----------
    contents
        The map.
    row
        Of the keyframe.
    images
        The source of the images.

    Raises
    ------
    ImageError
        If it is no uint8 image, or does not have the shape of the camera's.
    MapFileError
        If `images` is not callable.
    """
    if not callable(images):
        raise MapFileError(
            f"images is {shown(images)}; give a function image(keyframe_id), such as "
            "images_of(contents, sequence)"
        )
    number = int(contents.keyframes.ids[row])
    image: object = images(number)
    if image is None:
        return None
    name = f"the image of keyframe {number}"
    wanted = "give uint8 (h, w) grey or (h, w, 3) RGB, or None if there is none"
    if not isinstance(image, np.ndarray):
        raise ImageError(f"{name} is {shown(image)}; {wanted}")
    if image.ndim == 3 and image.shape[2] == 1:
        image = image[:, :, 0]
    fits = image.ndim == 2 or (image.ndim == 3 and image.shape[2] == 3)
    if image.dtype != np.uint8 or not fits or not image.size:
        raise ImageError(f"{name} is of {image.dtype} and shape {image.shape}; {wanted}")
    _check_aspect(contents, row, image, name)
    return image


def _check_aspect(contents: MapContents, row: int, image: ByteArray, name: str) -> None:
    """Refuse an image that is no scaled image of the camera, within rounding of its size."""
    cameras, camera = contents.cameras, int(contents.keyframes.camera[row])
    full_width, full_height = int(cameras.width[camera]), int(cameras.height[camera])
    height, width = image.shape[:2]
    if abs(width * full_height - height * full_width) > max(full_width, full_height):
        raise ImageError(
            f"{name} has {width} x {height} pixels, but its camera has {full_width} x "
            f"{full_height}; give that image, or a smaller copy of the same shape"
        )


def _span(timestamps: FloatArray) -> str:
    if not len(timestamps):
        return "none"
    return f"{timestamps[0]:.3f} to {timestamps[-1]:.3f} s"


@dataclass(frozen=True)
class View:
    """A keyframe in an export."""

    row: int
    """Row of the keyframe in `Keyframes`."""
    name: str
    """File name of its image, in the folder of images."""
    width: int
    """Of that image [px]."""
    height: int
    undistorted: bool
    """The image shows what a pinhole camera sees; otherwise the lens distorts it."""
    pinhole: PinholeView | None = None
    """The pinhole, if it differs from the camera without its distortion."""


def fisheye_of(
    model: CameraModel, format_name: str, others: Mapping[str, str]
) -> tuple[str, tuple[float, ...]]:
    """Return the name of a fisheye model in a format, and its parameters.

    Parameters
    ----------
    model
        The camera.
    format_name
        For the message.
    others
        Names of models other than Kannala-Brandt in the format, by our names.

    Raises
    ------
    DatasetError
        If the format does not have the model.
    """
    names = {"kannala_brandt": "OPENCV_FISHEYE", **others}
    if model.name not in names:
        raise DatasetError(
            f"{format_name} cannot hold a lens of the model {model.name}, only "
            f"{', '.join(names)}; give the images (--images, images=...), which are written as a "
            "pinhole camera sees them, or export points and trajectory (ply, pcd, tum)"
        )
    return names[model.name], model.parameters


def views_without_images(
    contents: MapContents, names: Mapping[int, str | Path] | None
) -> list[View]:
    """Views of all keyframes for existing, distorted images.

    Parameters
    ----------
    contents
        The map.
    names
        File names by keyframe id; by default ``keyframe_000012.png`` and so on.

    Raises
    ------
    MapFileError
        If `names` is no mapping, or a name cannot be that of a file.
    """
    if names is not None:
        remedy = "a dict from keyframe ids to names of files"
        instance_of(names, Mapping, "image_names", remedy, MapFileError)  # type: ignore[type-abstract]
    keyframes, cameras = contents.keyframes, contents.cameras
    distorts = np.any(cameras.distortion != 0, axis=1) | (cameras.model != 0)
    return [
        View(
            row,
            image_name(number) if names is None else _name_given(names[number], number),
            int(cameras.width[camera]),
            int(cameras.height[camera]),
            not distorts[camera],
        )
        for row, (number, camera) in enumerate(
            zip(keyframes.ids.tolist(), keyframes.camera.tolist(), strict=True)
        )
        if names is None or number in names
    ]


def _name_given(value: Any, keyframe_id: int) -> str:
    """Check the file name of a keyframe's image, for formats with lines of text."""
    what = f"image_names[{keyframe_id}]"
    path = path_of(value, what, MapFileError)
    name = value if isinstance(value, str) else path.as_posix()
    if "\n" in name or "\r" in name:
        raise MapFileError(f"{what} is {shown(name)}; give a name of one line")
    try:
        # Surrogates that Python puts for bytes of names are those bytes again in the file.
        name.encode("utf-8", "surrogateescape")
    except UnicodeEncodeError:
        raise MapFileError(f"{what} is {shown(name)}; give a name that UTF-8 can spell") from None
    return name


def image_name(keyframe_id: int) -> str:
    """Return the file name of a keyframe's image."""
    return f"keyframe_{keyframe_id:06d}.png"


def pixel_scale(contents: MapContents, view: View) -> tuple[float, float]:
    """Pixels of the exported image per pixel of the camera, in x and y."""
    camera = int(contents.keyframes.camera[view.row])
    cameras = contents.cameras
    return view.width / int(cameras.width[camera]), view.height / int(cameras.height[camera])

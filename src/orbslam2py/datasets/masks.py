# SPDX-License-Identifier: BSD-3-Clause
"""Masks: the regions of images that may have keypoints."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from orbslam2py._arrays import ByteArray, FloatArray
from orbslam2py.datasets.base import Images, LiveFrame, LiveSource, Sequence
from orbslam2py.datasets.frames import FramesInOrder
from orbslam2py.datasets.image_folder import image_files
from orbslam2py.datasets.images import read_image
from orbslam2py.datasets.imu import imu_of, imu_settings_of
from orbslam2py.errors import DatasetError, ImageError
from orbslam2py.inertial.samples import ImuSamples
from orbslam2py.settings import ImuSettings, Sensor, Settings
from orbslam2py.trajectory import Trajectory


class StaticMask:
    """One mask for all images.

    Parameters
    ----------
    path
        An image file with one channel of 8 bits: no keypoints where it is 0.

    Raises
    ------
    DatasetError
        If there is no such file.
    ImageError
        If it is no readable mask.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._mask = read_mask(path)

    def mask(self, index: int, image: ByteArray) -> ByteArray:
        """Return the mask of an image.

        Parameters
        ----------
        index
            Not used: the mask is the same for all.
        image
            The image the mask is for, uint8 (h, w) or (h, w, channels).

        Returns
        -------
        ByteArray
            (h, w), no keypoints where it is 0.

        Raises
        ------
        ImageError
            If it has another size than the image.
        """
        return _fitting(self._path, self._mask, image)


class MaskFolder:
    """One mask per image.

    If the file of every image has a mask of the same name (apart from the suffix), masks are
    assigned by names. Otherwise there must be as many masks as images, in the same order.

    Parameters
    ----------
    folder
        The file or folder of the masks.
    sequence
        The images.

    Raises
    ------
    DatasetError
        If the masks cannot be assigned.
    """

    def __init__(self, folder: Path, sequence: Sequence) -> None:
        files = image_files(folder)
        if not files:
            raise DatasetError(
                f"no masks in {folder}; give an image, or a folder with one per image"
            )
        n = len(sequence)
        by_stem = {path.stem: path for path in files}
        path_of = getattr(sequence, "image_path", None)
        stems = [path_of(i).stem for i in range(n)] if path_of is not None else []
        missing = [stem for stem in stems if stem not in by_stem]
        if stems and not missing:
            self._paths = [by_stem[stem] for stem in stems]
        elif len(files) == n:
            self._paths = files
        else:
            example = f" (the first without one is {missing[0]})" if missing else ""
            raise DatasetError(
                f"{folder} holds {len(files)} masks for {n} images: give one per image, with its "
                f"name{example} or in the same order, or a single file"
            )

    def mask(self, index: int, image: ByteArray) -> ByteArray:
        """Read the mask of an image.

        Parameters
        ----------
        index
            Number of the frame in the sequence, from 0.
        image
            The image the mask is for, uint8 (h, w) or (h, w, channels).

        Returns
        -------
        ByteArray
            (h, w), no keypoints where it is 0.

        Raises
        ------
        ImageError
            If it is no readable mask, or has another size than the image.
        """
        return _fitting(self._paths[index], read_mask(self._paths[index]), image)


def read_mask(path: Path) -> ByteArray:
    """Read a mask: uint8 (h, w), no keypoints where it is 0.

    Images with several equal channels are allowed too.

    Raises
    ------
    DatasetError
        If there is no such file.
    ImageError
        If it is no image of 8 bits, or its channels differ.
    """
    if not path.exists():
        raise DatasetError(
            f"mask {path} does not exist; give an image, or a folder with one per image"
        )
    image = read_image(path, rgb=False)
    if image.ndim == 2:
        return image
    colour = image[:, :, :3]
    if (colour != colour[:, :, :1]).any():
        raise ImageError(f"mask {path} is coloured; a mask has one channel, 0 where to ignore")
    return np.ascontiguousarray(colour[:, :, 0])


def _fitting(path: Path, mask: ByteArray, image: ByteArray) -> ByteArray:
    if mask.shape != image.shape[:2]:
        raise ImageError(
            f"mask {path} is {mask.shape[1]} x {mask.shape[0]}, "
            f"but its image {image.shape[1]} x {image.shape[0]}; give one of the image's size"
        )
    return mask


#: Attributes that not every sequence has: where its files are.
_OF_SOME = frozenset({"path", "folder", "image_path"})
#: Attributes that not every live source has: its device, IMU, losses, and recorder.
_OF_LIVE = frozenset(
    {"device", "has_imu", "imu_settings", "doubts", "counts", "set_tap", "is_split"}
)


class _Masked:
    """Common parts of masked sources: all but the masks comes from the source."""

    def __init__(self, source: Sequence | LiveSource, masks: StaticMask | MaskFolder) -> None:
        self._inner = source
        self._masks = masks

    @property
    def name(self) -> str:
        """Name of the source."""
        return self._inner.name

    @property
    def layout(self) -> str:
        """Layout on disk, or ``camera``."""
        return self._inner.layout

    @property
    def sensor(self) -> Sensor:
        """The sensor."""
        return self._inner.sensor

    @property
    def settings(self) -> Settings:
        """Settings of the source."""
        return self._inner.settings

    @property
    def up_in_truth(self) -> FloatArray | None:
        """Up direction in the world of the ground truth, (3,); None if it is not known."""
        return getattr(self._inner, "up_in_truth", None)

    def ground_truth(self) -> Trajectory | None:
        """Return the true poses; see `datasets.base.Source.ground_truth`."""
        return self._inner.ground_truth()

    def _with_mask(self, index: int, images: Images) -> Images:
        return replace(images, mask=self._masks.mask(index, images.image))


class MaskedSequence(FramesInOrder, _Masked):
    """A sequence whose images come with masks; see `datasets.base.Sequence`.

    Parameters
    ----------
    sequence
        The images. For a pair the masks belong to the left images as `load` returns them
        (rectified).
    masks
        A file, or a folder with one file for each image.

    Raises
    ------
    DatasetError
        If there is no such file or folder, or its masks cannot be assigned.
    ImageError
        If the file is no readable mask.
    """

    def __init__(self, sequence: Sequence, masks: str | Path) -> None:
        path = Path(masks)
        super().__init__(
            sequence, MaskFolder(path, sequence) if path.is_dir() else StaticMask(path)
        )
        self._sequence = sequence

    def __len__(self) -> int:
        return len(self._sequence)

    def imu(self) -> ImuSamples | None:
        """Read the samples of the IMU; None if the sequence has none."""
        return imu_of(self._sequence)

    def imu_settings(self) -> ImuSettings | None:
        """Read the IMU data that come with the sequence; None if nothing does."""
        return imu_settings_of(self._sequence)

    def __getattr__(self, name: str) -> Any:
        # Attributes that only some sequences have: `path` or `folder`, and `image_path`.
        if name in _OF_SOME:
            return getattr(self._sequence, name)
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")

    @property
    def timestamps(self) -> FloatArray:
        """Time of every frame in seconds, float64 (n,); from the sequence."""
        return self._sequence.timestamps

    def timestamp_text(self, index: int, /) -> str:
        """Return the time of a frame in seconds, with all digits of the source."""
        return self._sequence.timestamp_text(index)

    def default_settings(self) -> Settings:
        """Choose settings by the files beside the images; see `datasets.base.Sequence`."""
        return self._sequence.default_settings()

    def load(self, index: int, /) -> Images:
        """Read the images and the mask of a frame; see `datasets.base.Sequence.load`."""
        return self._with_mask(index, self._sequence.load(index))


class MaskedCamera(_Masked):
    """A camera with one mask for all images; see `datasets.base.LiveSource`.

    Parameters
    ----------
    camera
        The images.
    mask
        A file.

    Raises
    ------
    DatasetError
        If there is no such file, or it is a folder.
    ImageError
        If it is no readable mask.
    """

    def __init__(self, camera: LiveSource, mask: str | Path) -> None:
        path = Path(mask)
        if path.is_dir():
            raise DatasetError(f"{path} is a folder; a camera takes a single mask file")
        super().__init__(camera, StaticMask(path))
        self._camera = camera

    def __getattr__(self, name: str) -> Any:
        if name in _OF_LIVE:
            return getattr(self._camera, name)
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")

    @property
    def n_dropped(self) -> int:
        """Images that the camera lost so far."""
        return self._camera.n_dropped

    def open(self) -> None:
        """Open the camera; see `datasets.base.LiveSource.open`."""
        self._camera.open()

    def __enter__(self) -> MaskedCamera:
        self._camera.__enter__()
        return self

    def __exit__(self, *details: object) -> None:
        self._camera.__exit__(*details)

    def take(self, timeout: float, /) -> LiveFrame | None:
        """Take the newest image, with the mask; see `datasets.base.LiveSource.take`."""
        frame = self._camera.take(timeout)
        return frame and self._masked(frame)

    def __iter__(self) -> Iterator[LiveFrame]:
        """Yield the newest image again and again, with the mask."""
        return map(self._masked, self._camera)

    def _masked(self, frame: LiveFrame) -> LiveFrame:
        return replace(frame, images=self._with_mask(0, frame.images))

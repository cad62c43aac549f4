# SPDX-License-Identifier: BSD-3-Clause
"""Result of the readers of all formats: the cameras of a calibration file."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from orbslam2py._arrays import FloatArray
from orbslam2py.calibration.lenses import PINHOLE
from orbslam2py.errors import SettingsError
from orbslam2py.settings.foreign import CalibrationText


@dataclass(frozen=True, eq=False)
class ForeignCamera:
    """A camera as a file describes it.

    Attributes
    ----------
    name
        Its name in the file.
    number
        What ``--camera`` calls it.
    K
        Camera matrix (3, 3), pixels; the centre of the top-left pixel is (0, 0). None for a lens
        that is not supported.
    distortion
        OpenCV's k1, k2, p1, p2, k3, (5,), with k4, k5, k6, (8,), and with s1 to s4, (12,). Other
        lenses: all 0.
    size
        Width and height [pixels]; None if the file does not contain it.
    lens
        As `orbslam2py.calibration.lenses.lens_of` returns it.
    lens_numbers
        Parameters of a fisheye lens after fx, fy, cx, cy, as `orbslam2py.CameraModel` orders them.
    T_camera_rig
        Where it stands: from coordinates that all cameras of the file share (of the first one, or
        of the IMU) to those of the camera, (4, 4), metres. None if the file does not contain it.
    R, P
        Rectification of a pair if the file has it: rotation (3, 3) from raw to rectified camera
        coordinates, and projection (3, 4), pixels.
    """

    name: str
    number: int
    K: FloatArray | None
    distortion: FloatArray
    size: tuple[int, int] | None
    lens: str = PINHOLE
    T_camera_rig: FloatArray | None = None
    R: FloatArray | None = None
    P: FloatArray | None = None
    lens_numbers: tuple[float, ...] = ()


@dataclass(frozen=True, eq=False)
class CameraFile:
    """Contents of a calibration file.

    Attributes
    ----------
    cameras
        All cameras.
    prefix
        What stands before the numbers of cameras, in messages; None if they have no numbers.
    pairs
        Numbers of the left and right cameras of the pairs there are, the usual one first.
    place_key
        The name in the file of what tells where the cameras of a pair stand.
    rectified
        Whether the cameras are rectified ones.
    fps, depth_factor, n_features
        What else is known: images per second, units of depth images per metre, ORB features.
    rgb
        Whether colour images are RGB.
    note
        What the user should know of how the numbers were read.
    """

    cameras: tuple[ForeignCamera, ...]
    prefix: str | None = None
    pairs: tuple[tuple[int, int], ...] = ()
    place_key: str = "the place of the cameras"
    rectified: bool = False
    fps: float | None = None
    depth_factor: float | None = None
    n_features: int | None = None
    rgb: bool = False
    note: str = ""


class CalibrationSource(CalibrationText):
    """A calibration file that is to be read.

    Parameters
    ----------
    path
        The file, for messages.
    text
        What it holds.
    size
        Width and height of the images that the user names, if any.
    """

    def __init__(self, path: Path, text: str, size: tuple[int, int] | None = None) -> None:
        super().__init__(text)
        self.path = path
        self.size = size

    @cached_property
    def values(self) -> Mapping[str, Any]:
        """The named values of YAML or JSON; of several documents those of the first.

        Raises
        ------
        SettingsError
            Naming the file, if it is neither or holds something else.
        """
        if self.json:
            return self.json
        # OpenCV's head line, which some write, is no YAML.
        text = re.sub(r"^%YAML.*$", "", self.text, flags=re.MULTILINE)
        # What "rostopic echo" prints is one document after the other; the last may be cut off.
        documents = re.split(r"^---\s*$", text, flags=re.MULTILINE)
        first = next((one for one in documents if _has_content(one)), "")
        try:
            document = yaml.load(first, _Loader)
        except (yaml.YAMLError, RecursionError) as error:
            raise SettingsError(
                f"{self.path} is no YAML: {error}; write it again, or give another file"
            ) from error
        if not isinstance(document, Mapping):
            raise SettingsError(f"{self.path} holds no named values; give a calibration file")
        return document

    def value(self, key: str, values: Mapping[str, Any] | None = None, where: str = "") -> Any:
        """Take a value that must be there.

        Parameters
        ----------
        key
            Its name.
        values
            Where it is; by default the file's own.
        where
            The place of these in the file, with a point at the end.

        Raises
        ------
        SettingsError
            If it is missing.
        """
        values = self.values if values is None else values
        if key not in values:
            raise SettingsError(
                f"{self.path}: {where}{key} is missing; add it, or name another --format"
            )
        return values[key]

    def mapping(self, value: object, where: str) -> Mapping[str, Any]:
        """Take named values.

        Raises
        ------
        SettingsError
            If it is something else.
        """
        if not isinstance(value, Mapping):
            raise SettingsError(f"{self.path}: {where} holds no named values; add them")
        return value

    def mappings(self, value: object, where: str) -> list[Mapping[str, Any]]:
        """Take a list of named values that is not empty.

        Raises
        ------
        SettingsError
            If it is something else.
        """
        if not isinstance(value, list) or not value:
            raise SettingsError(f"{self.path}: {where} lists no camera; give the whole file")
        return [self.mapping(one, f"{where}[{i}]") for i, one in enumerate(value)]


def _has_content(text: str) -> bool:
    lines = (line.strip() for line in text.splitlines())
    return any(line and not line.startswith("#") for line in lines)


class _Loader(yaml.SafeLoader):  # type: ignore[misc]
    """Reads OpenCV's matrices as named values."""


def _named_values(loader: yaml.SafeLoader, node: yaml.Node) -> Any:
    return loader.construct_mapping(node, deep=True) if isinstance(node, yaml.MappingNode) else None


for _kind in ("opencv-matrix", "opencv-nd-matrix"):
    _Loader.add_constructor(f"tag:yaml.org,2002:{_kind}", _named_values)


def first_of(values: Mapping[str, Any], *names: str) -> Any:
    """Take the first value there is under one of several names; None if there is none."""
    return next((values[name] for name in names if name in values), None)


def in_order(values: Mapping[str, Any], *names: str) -> list[Any]:
    """Take values by their names; 0 for those there are not."""
    return [values.get(name, 0.0) for name in names]


def both_ways(numbers: list[int]) -> tuple[tuple[int, int], ...]:
    """Pair the first two cameras: the first one on the left, or with ``--camera`` the second."""
    if len(numbers) < 2:
        return ()
    first, second = numbers[:2]
    return ((first, second), (second, first))


NO_DISTORTION = np.zeros(5)

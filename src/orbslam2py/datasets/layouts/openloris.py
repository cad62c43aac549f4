# SPDX-License-Identifier: BSD-3-Clause
"""OpenLORIS-Scene (Shi et al. 2020): ``color.txt``, ``aligned_depth.txt``, ``sensors.yaml``."""

from __future__ import annotations

import logging
import re
from pathlib import Path

import yaml

from orbslam2py._arguments import cannot_open
from orbslam2py.datasets.base import Layout, Stamps
from orbslam2py.datasets.imu import ImuSamples, joined_streams
from orbslam2py.datasets.imu_csv import read_stream
from orbslam2py.datasets.layouts.frames_on_disk import DepthSequence
from orbslam2py.datasets.tum import read_image_list
from orbslam2py.errors import DatasetError
from orbslam2py.settings import Settings
from orbslam2py.trajectory import Trajectory, associate, read_tum

_log = logging.getLogger(__name__)

_COLOUR, _DEPTH, _CAMERAS = "color.txt", "aligned_depth.txt", "sensors.yaml"
_IMU = "d400_gyroscope.txt", "d400_accelerometer.txt"
_SENSOR = "d400_color_optical_frame"
_DEPTH_PER_METRE = 1000.0


class OpenLorisSequence(DepthSequence):
    """The colour camera of a sequence of OpenLORIS-Scene; see `datasets.base.Sequence`.

    Depth is ``aligned_depth``, which is registered to colour. The poses of ``groundtruth.txt`` are
    used unchanged.
    """

    layout = Layout.OPENLORIS
    _missing_calibration = (
        "sensors.yaml is missing; copy it there from the data set, or give --settings"
    )

    @staticmethod
    def recognises(folder: Path) -> bool:
        """Return whether a folder is such a sequence."""
        return (folder / _COLOUR).is_file() and (folder / "color").is_dir()

    def _list(self, folder: Path) -> tuple[list[Path], list[Path], Stamps]:
        colour, images = _read_list(folder / _COLOUR)
        if not (folder / _DEPTH).is_file():
            return images, [], colour
        depth, depths = _read_list(folder / _DEPTH)
        i, j = associate(colour.seconds, depth.seconds)
        if len(i) < len(images):
            _log.warning(
                "%s: %d colour images have no depth image, left out", folder, len(images) - len(i)
            )
        kept = i.tolist()
        stamps = Stamps(colour.seconds[i], tuple(colour.texts[k] for k in kept), ())
        return [images[k] for k in kept], [depths[k] for k in j.tolist()], stamps

    def ground_truth(self) -> Trajectory | None:
        """Read ``groundtruth.txt``; see `datasets.base.Sequence.ground_truth`."""
        path = self.folder / "groundtruth.txt"
        return read_tum(path) if path.is_file() else None

    def imu(self) -> ImuSamples | None:
        """Read the gyro and the accelerometer of the camera; see `RecordedSequence.imu`.

        The accelerometer is interpolated at the times of the gyro.
        """
        gyro, accel = (self.folder / name for name in _IMU)
        if not gyro.is_file() or not accel.is_file():
            return super().imu()
        return joined_streams(str(self.folder), read_stream(gyro), read_stream(accel))

    def _from_calibration(self) -> Settings | None:
        path = self.folder / _CAMERAS
        if not path.is_file():
            return None
        values = _values_of(path)
        width, height = values["width"][0], values["height"][0]
        # The four numbers stand in the order of the matrix: fx, cx, fy, cy. Where they are in the
        # usual order instead, the second is no middle of an image.
        a, b, c, d = values["intrinsics"]
        usual = abs(c - width / 2) + abs(b - a) < abs(b - width / 2) + abs(c - a)
        fy, cx = (b, c) if usual else (c, b)
        rate = values.get("fps", [30.0])[0]
        numbers = {"fx": a, "fy": fy, "cx": cx, "cy": d, "fps": rate}
        size = {"width": int(width), "height": int(height)}
        return self._camera({**numbers, **size}, _DEPTH_PER_METRE, path)


def _read_list(path: Path) -> tuple[Stamps, list[Path]]:
    listed = read_image_list(path)
    return listed.stamps, [path.parent / name for name in listed.paths]


def _values_of(path: Path) -> dict[str, list[float]]:
    """Return the parameters of the colour camera."""
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise DatasetError(cannot_open(path, error)) from error
    # OpenCV's head line and its names of types are no YAML.
    plain = re.sub(r"\A%YAML:1\.0\s*(?:\n---)?", "", text).replace("!!opencv-matrix", "")
    try:
        camera = yaml.safe_load(plain)[_SENSOR]
        intrinsics = camera["intrinsics"]
        matrix = intrinsics["data"] if isinstance(intrinsics, dict) else intrinsics
        found = {"intrinsics": [float(number) for number in matrix]}
        for name in ("width", "height", "fps"):
            if name in camera:
                found[name] = [float(camera[name])]
        if len(found["intrinsics"]) != 4 or not {"width", "height"} <= set(found):
            raise ValueError("numbers are missing")
    except (yaml.YAMLError, KeyError, TypeError, ValueError) as error:
        raise DatasetError(
            f"{path} does not describe the colour camera: it needs {_SENSOR} with width, height "
            "and four intrinsics; copy it again, or give --settings"
        ) from error
    return found

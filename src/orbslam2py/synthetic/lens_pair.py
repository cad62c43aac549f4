# SPDX-License-Identifier: BSD-3-Clause
"""The two cameras of a raw stereo pair, as settings describe them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.errors import SettingsError
from orbslam2py.settings import Sensor, Settings
from orbslam2py.settings.camera_model import CameraModel


@dataclass(frozen=True, eq=False)
class LensPair:
    """Both cameras and where they stand to the camera that is tracked.

    Attributes
    ----------
    models
        Left and right camera, raw.
    T_tracked_raw
        From raw to tracked camera coordinates, (4, 4), metres: of the left and of the right camera.
        The tracked camera is the rectified left one, or the left one of a fisheye pair.
    """

    models: tuple[CameraModel, CameraModel]
    T_tracked_raw: tuple[FloatArray, FloatArray]


def lens_pair_of(settings: Settings) -> LensPair:
    """Find the raw cameras of stereo settings.

    Raises
    ------
    SettingsError
        If they describe no raw pair.
    """
    camera, pair, right = settings.camera, settings.rectification, settings.right
    to_left, to_right = np.eye(4), np.eye(4)
    if pair is not None:
        to_left[:3, :3], to_right[:3, :3] = pair.left.R, pair.right.R
        to_right[0, 3] = -pair.right.P[0, 3] / pair.right.P[0, 0]
        models = pair.left.camera_model(), pair.right.camera_model()
    elif right is not None and camera.width is not None and camera.height is not None:
        size = camera.width, camera.height
        to_right = right.T_left_right.copy()
        models = camera.camera_model(*size), right.camera.camera_model(*size)
    else:
        raise SettingsError(
            "the settings describe no raw pair with its image size; give a file with Camera2.* and "
            "Stereo.T_c1_c2, or with LEFT.* and RIGHT.*, and Camera.width and Camera.height"
        )
    return LensPair(models, (to_left, to_right))


def check_lens_pair(settings: Settings, sensor: Sensor) -> None:
    """Raise `SettingsError` unless settings describe a raw pair for this sensor."""
    if sensor is not Sensor.STEREO or settings.sensor is not Sensor.STEREO:
        raise SettingsError("lens_pair is for the sensor stereo; give lens for one camera")
    lens_pair_of(settings)

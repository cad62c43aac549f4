# SPDX-License-Identifier: BSD-3-Clause
"""Settings of a rig from the cameras of a calibration file."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from orbslam2py.calibration.foreign_cameras import CameraFile
from orbslam2py.calibration.foreign_pairs import raw_camera
from orbslam2py.calibration.lenses import require_supported
from orbslam2py.errors import SettingsError
from orbslam2py.settings import OrbSettings, RigCamera, Sensor, Settings
from orbslam2py.settings.defaults import usual_n_features
from orbslam2py.settings.extrinsics import inverse_of


def rig_settings(path: Path, file: CameraFile, fps: float) -> Settings:
    """Make settings of a rig of all cameras of a file; the first one is the body.

    Parameters
    ----------
    path
        The file, for messages.
    file
        Its contents.
    fps
        Images per second.

    Raises
    ------
    SettingsError
        If there are not two to eight cameras with supported lenses, or the file contains neither
        their poses nor the sizes of their images.
    """
    if len(file.cameras) < 2:
        raise SettingsError(
            f"{path} holds one camera, and a rig has two or more; give a file of all cameras, such "
            "as a camchain of Kalibr"
        )
    cameras = []
    T_body = file.cameras[0].T_camera_rig
    for one in file.cameras:
        require_supported(f"{path}: {one.name}", one.lens)
        if one.T_camera_rig is None or T_body is None:
            key = file.place_key or "the extrinsics"
            raise SettingsError(
                f"{path} does not say how {one.name} is mounted ({key} is missing); calibrate all "
                "cameras together"
            )
        if one.size is None:
            raise SettingsError(
                f"{path} does not say the size of the images of {one.name}; give --size"
            )
        camera = raw_camera(one, fps, rgb=file.rgb)
        first = one is file.cameras[0]
        T_body_camera = np.eye(4) if first else T_body @ inverse_of(one.T_camera_rig)
        cameras.append(RigCamera(camera, T_body_camera))
    return Settings(
        sensor=Sensor.RIG,
        camera=cameras[0].camera,
        orb=OrbSettings(n_features=usual_n_features(*cameras[0].size)),
        rig=tuple(cameras),
    )

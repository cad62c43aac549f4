# SPDX-License-Identifier: BSD-3-Clause
"""Settings of a rig from a calibration of all its cameras."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from orbslam2py.calibration import read_camera_file
from orbslam2py.errors import SettingsError
from orbslam2py.settings import Settings
from support.rigs import mounted

CAMERA = """cam{number}:
  camera_model: pinhole
  distortion_model: equidistant
  distortion_coeffs: [0.01, 0.002, 0.0, 0.0]
  intrinsics: [75, 75, 127.5, 127.5]
  resolution: [256, 256]
"""


def camchain(path: Path, *, with_poses: bool = True) -> Path:
    """Three cameras; each knows its place relative to the one before."""
    poses = [np.eye(4), mounted(10, (0.12, 0, 0)), mounted(170, (0.1, 0.02, -0.2))]
    text = ""
    for number, T_bc in enumerate(poses):
        text += CAMERA.format(number=number)
        if number and with_poses:
            T_cn_cnm1 = np.linalg.inv(T_bc) @ poses[number - 1]
            text += f"  T_cn_cnm1: {T_cn_cnm1.tolist()}\n"
    path.write_text(text)
    return path


def test_a_camchain_becomes_a_rig(tmp_path: Path) -> None:
    settings = read_camera_file(camchain(tmp_path / "chain.yaml"), sensor="rig", fps=20)
    assert settings.rig is not None
    assert [member.size for member in settings.rig] == 3 * [(256, 256)]
    assert np.allclose(settings.rig[1].T_body_camera, mounted(10, (0.12, 0, 0)))
    assert np.allclose(settings.rig[2].T_body_camera, mounted(170, (0.1, 0.02, -0.2)))
    assert settings.rig[2].camera.model == "kannala_brandt"
    settings.save(tmp_path / "rig.yaml")
    assert Settings.load(tmp_path / "rig.yaml", "rig") == settings


def test_cameras_without_places_are_refused(tmp_path: Path) -> None:
    path = camchain(tmp_path / "chain.yaml", with_poses=False)
    with pytest.raises(SettingsError, match=r"how cam1 is mounted \(T_cn_cnm1 is missing\)"):
        read_camera_file(path, sensor="rig")

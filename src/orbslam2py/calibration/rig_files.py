# SPDX-License-Identifier: BSD-3-Clause
"""Files of calibrated rigs: settings of a raw pair, and Kalibr's camchain of any number."""

from __future__ import annotations

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.calibration.rig import RigCalibration
from orbslam2py.errors import SettingsError
from orbslam2py.settings.camera_model import CameraModel
from orbslam2py.settings.defaults import USUAL_CLOSE_FACTOR
from orbslam2py.settings.fisheye import TYPES
from orbslam2py.settings.groups import usual_n_features

#: Camera and distortion model of Kalibr, by our names; and the parameters that it writes before fx.
_KALIBR = {
    "pinhole": ("pinhole", "none", ()),
    "radtan4": ("pinhole", "radtan", ()),
    "kannala_brandt": ("pinhole", "equidistant", ()),
    "fov": ("pinhole", "fov", ()),
    "double_sphere": ("ds", "none", ("xi", "alpha")),
    "eucm": ("eucm", "none", ("alpha", "beta")),
    "mei": ("omni", "radtan", ("xi",)),
}


def left_first(rig: RigCalibration) -> tuple[RigCalibration, bool]:
    """Bring the left camera of a pair to the front; tell whether the order has changed."""
    if rig.positions[1, 0] >= 0:
        return rig, False
    return rig.reordered((1, 0)), True


def pair_settings_text(rig: RigCalibration, *, fps: float, n_features: int | None = None) -> str:
    """Settings of a raw stereo pair with the keys of ORB-SLAM3 1.0.

    Parameters
    ----------
    rig
        Two cameras with images of one size, the left one first.
    fps
        Frames per second.
    n_features
        Features per image; by default 1000, or 2000 for images above 0.6 megapixels.

    Raises
    ------
    SettingsError
        If the images of the cameras have different sizes.
    """
    cameras = [one.camera for one in rig.cameras]
    (width, height), other = cameras[0].image_size, cameras[1].image_size
    if other != (width, height):
        raise SettingsError(
            f"the cameras have images of {width} x {height} and {other[0]} x {other[1]}, and the "
            "settings of a pair are for one size; calibrate both at the same resolution"
        )
    T_c1_c2 = np.linalg.inv(rig.T_c0[1])
    features = usual_n_features(width, height) if n_features is None else n_features
    lines = [
        "%YAML:1.0",
        f"# Calibrated from {rig.n_moments} sets of images of the board {rig.cameras[0].board}, "
        f"reprojection error {rig.rms:.3f} pixels (RMS)",
        "",
        'File.version: "1.0"',
        f'Camera.type: "{TYPES.get(cameras[0].name, "PinHole")}"',
        f"Camera.width: {width}",
        f"Camera.height: {height}",
        f"Camera.fps: {float(fps)!r}",
        "Camera.RGB: 0",
    ]
    for number, camera in enumerate(cameras, start=1):
        lines += ["", f"# Camera {number}: pixels"]
        lines += [
            f"Camera{number}.{name}: {value!r}"
            for name, value in zip(camera.parameter_names, camera.parameters, strict=True)
        ]
    lines += [
        "",
        "# Points of camera 2 to camera 1, metres",
        "Stereo.T_c1_c2: !!opencv-matrix",
        "   rows: 4",
        "   cols: 4",
        "   dt: d",
        f"   data: [{_rows(np.asarray(T_c1_c2))}]",
        f"Stereo.ThDepth: {USUAL_CLOSE_FACTOR!r}",
        "",
        "# ORB features",
        f"ORBextractor.nFeatures: {features}",
        "ORBextractor.scaleFactor: 1.2",
        "ORBextractor.nLevels: 8",
        "ORBextractor.iniThFAST: 20",
        "ORBextractor.minThFAST: 7",
    ]
    return "\n".join(lines) + "\n"


def _rows(T: FloatArray) -> str:
    return ",\n      ".join(", ".join(repr(float(value)) for value in row) for row in T)


def camchain_text(rig: RigCalibration) -> str:
    """Kalibr's camchain: every camera with its lens, and its pose to the camera before it.

    Raises
    ------
    SettingsError
        If Kalibr has no such lens.
    """
    lines: list[str] = []
    for number, (one, T) in enumerate(zip(rig.cameras, rig.T_c0, strict=True)):
        lines += [f"cam{number}:", *_kalibr_lines(one.camera)]
        if number:
            T_cn_cnm1 = T @ np.linalg.inv(rig.T_c0[number - 1])
            lines.append("  T_cn_cnm1:")
            lines += [f"  - [{', '.join(repr(float(v)) for v in row)}]" for row in T_cn_cnm1]
        lines.append(f"  rostopic: /cam{number}/image_raw")
    return "\n".join(lines) + "\n"


def check_camchain(family: str) -> None:
    """Raise `SettingsError` unless a camchain can hold such lenses."""
    if family not in _KALIBR:
        raise SettingsError(
            f"a camchain of Kalibr cannot hold a lens of the model {family}; give --model with one "
            f"of {', '.join(_KALIBR)}"
        )


def _kalibr_lines(camera: CameraModel) -> list[str]:
    check_camchain(camera.name)
    model, distortion, before = _KALIBR[camera.name]
    values = dict(zip(camera.parameter_names, camera.parameters, strict=True))
    intrinsics = [*before, "fx", "fy", "cx", "cy"]
    rest = [name for name in camera.parameter_names if name not in intrinsics]
    numbers = ", ".join(repr(values[name]) for name in intrinsics)
    coefficients = ", ".join(repr(values[name]) for name in rest)
    return [
        f"  camera_model: {model}",
        f"  distortion_model: {distortion}",
        f"  intrinsics: [{numbers}]",
        f"  distortion_coeffs: [{coefficients}]",
        f"  resolution: [{camera.image_size[0]}, {camera.image_size[1]}]",
    ]

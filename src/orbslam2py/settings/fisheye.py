# SPDX-License-Identifier: BSD-3-Clause
"""Lens models of settings beyond the pinhole: names, parameters, and other programs' names.

Fisheye models, and OpenCV's thin prism: their keypoints are pixels of the unrectified images.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

from orbslam2py._arguments import float_of, is_number, number_of, shown
from orbslam2py.errors import SettingsError

#: Pinhole with OpenCV's k1, k2, p1, p2, k3, k4, k5, k6.
PINHOLE = "pinhole"

#: Lens parameters of each fisheye model, in the order of `CameraModel` after fx, fy, cx, cy.
LENS_PARAMETERS: dict[str, tuple[str, ...]] = {
    "kannala_brandt": ("k1", "k2", "k3", "k4"),
    "double_sphere": ("xi", "alpha"),
    "eucm": ("alpha", "beta"),
    "mei": ("xi", "k1", "k2", "p1", "p2"),
    "fov": ("omega",),
    "thin_prism": ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4"),
}
#: Names of the parameters, and the parameters that only fisheye models have.
ALL_PARAMETERS = tuple(dict.fromkeys(name for names in LENS_PARAMETERS.values() for name in names))
FISHEYE_PARAMETERS = ("xi", "alpha", "beta", "omega", "s1", "s2", "s3", "s4")

#: ``Camera.type`` of settings files.
TYPES = {
    "kannala_brandt": "KannalaBrandt8",
    "double_sphere": "DoubleSphere",
    "eucm": "EUCM",
    "mei": "Mei",
    "fov": "FOV",
    "thin_prism": "ThinPrism",
}

#: Names of other programs, without signs between words, in lower case.
_NAMES = {
    "kannala_brandt": (
        "kannalabrandt kannalabrandt4 kannalabrandt8 kb kb4 kb8 equidistant equi fisheye "
        "opencvfisheye pinholeequi distortionkannalabrandt4"
    ),
    "double_sphere": "doublesphere ds",
    "eucm": "eucm extendedunified",
    "mei": "mei omni unifiedomnidirectional omniradtan",
    "fov": "fov pinholefov atan",
    "thin_prism": "thinprism",
}
_MODELS = {name: model for model, names in _NAMES.items() for name in names.split()}


def needs_right_camera() -> str:
    """Say what settings of a fisheye pair need."""
    return (
        "a stereo pair of fisheye cameras needs both cameras and their relative pose: "
        "Camera2.fx, fy, cx, cy with the lens, and Stereo.T_c1_c2 (from camera 2 to camera 1, "
        "in metres); 'orbslam2py import-camera --sensor stereo' makes such settings of a "
        "calibration of both, and --sensor mono uses one camera alone"
    )


def plain_name(name: object) -> str:
    """Return a name in lower case, without signs between words."""
    return re.sub(r"[^a-z0-9]", "", str(name).lower())


def fisheye_model(name: object) -> str | None:
    """Return our fisheye model for another program's name: a key of `LENS_PARAMETERS`, or None."""
    return _MODELS.get(plain_name(name))


def checked_model(model: object) -> str:
    """Return the name of a model: "pinhole", or a fisheye model by any of its names.

    Raises
    ------
    SettingsError
        If the model is unknown.
    """
    if model == PINHOLE:
        return PINHOLE
    known = fisheye_model(model) if isinstance(model, str) else None
    if known is None:
        raise SettingsError(
            f"the camera model is {shown(model)}; give pinhole (with OpenCV's k1 to k6), or a "
            f"fisheye model: {', '.join(LENS_PARAMETERS)}"
        )
    return known


def checked_lens(model: str, lens: object) -> tuple[float, ...]:
    """Return the lens parameters of a model; their ranges are checked elsewhere.

    Raises
    ------
    SettingsError
        If they are no numbers, or not those of the model.
    """
    names = LENS_PARAMETERS.get(model, ())
    wanted = f"give {', '.join(names)}" if names else "leave it out, or name a fisheye model"
    if isinstance(lens, str | bytes) or not isinstance(lens, Iterable):
        raise SettingsError(f"the lens of a {model} camera is {shown(lens)}; {wanted}")
    values = list(lens)
    if len(values) != len(names):
        raise SettingsError(
            f"a {model} camera has {number_of(len(names), 'lens parameter')}, got {len(values)}; "
            f"{wanted}"
        )
    for name, value in zip(names, values, strict=True):
        if not is_number(value):
            raise SettingsError(f"{name} of the {model} lens is {shown(value)}; give a number")
    return tuple(float_of(value) for value in values)

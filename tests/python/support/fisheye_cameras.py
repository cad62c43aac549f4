# SPDX-License-Identifier: BSD-3-Clause
"""Fisheye cameras in the files of many programs: always the same focal lengths and centre."""

from __future__ import annotations

import json

from support import foreign_cameras as files
from support import other_settings
from support.foreign_cameras import CX, CY, FX, FY

KB = (0.02, -0.01, 0.004, -0.001)
KB_NAMED = dict(zip(("k1", "k2", "k3", "k4"), KB, strict=True))
DS, EUCM, MEI, FOV = (-0.2, 0.6), (0.55, 1.1), (1.2, -0.1, 0.02, 0.001, -0.0005), (0.9,)
DS_NAMED = dict(zip(("xi", "alpha"), DS, strict=True))
EUCM_NAMED = dict(zip(("alpha", "beta"), EUCM, strict=True))
MEI_NAMED = dict(zip(("xi", "k1", "k2", "p1", "p2"), MEI, strict=True))


def kalibr(camera: str, distortion: str, leading: tuple[float, ...], *coefficients: float) -> str:
    """A camchain of one camera; the parameters of the model lead."""
    return (
        f"cam0:\n  camera_model: {camera}\n  distortion_model: {distortion}\n"
        f"  distortion_coeffs: {list(coefficients)}\n"
        f"  intrinsics: {[*leading, FX, FY, CX, CY]}\n  resolution: [640, 480]\n"
    )


def listed(values: dict[str, float], indent: str = "  ") -> str:
    return "".join(f"{indent}{name}: {value}\n" for name, value in values.items())


def vins(model: str, **groups: dict[str, float]) -> str:
    text = f"%YAML:1.0\n---\nmodel_type: {model}\nimage_width: 640\nimage_height: 480\n"
    return text + "".join(f"{name}:\n{listed(values, '   ')}" for name, values in groups.items())


#: Of the first pixel's corner, as COLMAP and nerfstudio count.
COLMAP = f"{FX} {FY} {CX + 0.5} {CY + 0.5}"
COLMAP_ONE_F = f"{FX} {CX + 0.5} {CY + 0.5}"
NERFSTUDIO = {**files.NERFSTUDIO_NUMBERS, **KB_NAMED, "frames": [files.FRAME]}
VINS_KB = vins(
    "KANNALA_BRANDT",
    projection_parameters={
        **dict(zip(("k2", "k3", "k4", "k5"), KB, strict=True)),
        **{"mu": FX, "mv": FY, "u0": CX, "v0": CY},
    },
)
VINS_MEI = vins(
    "MEI",
    mirror_parameters={"xi": MEI[0]},
    distortion_parameters=dict(zip(("k1", "k2", "p1", "p2"), MEI[1:], strict=True)),
    projection_parameters={"gamma1": FX, "gamma2": FY, "u0": CX, "v0": CY},
)
FCA_HEAD = files.FCA.partition("  k1")[0]
STELLA = files.STELLA.replace("perspective", "fisheye")
STELLA = (
    STELLA.partition("  k1")[0]
    + listed(KB_NAMED)
    + "  fps: 20.0"
    + STELLA.partition("fps: 20.0")[2]
)
ROS = files.ROS1.replace("plumb_bob", "equidistant").replace(str(list(files.D)), str(list(KB)))

#: Text, model and lens parameters by a name that begins with the format.
FILES: dict[str, tuple[str, str, tuple[float, ...]]] = {
    "kalibr equi": (kalibr("pinhole", "equidistant", (), *KB), "kannala_brandt", KB),
    "kalibr ds": (kalibr("ds", "none", DS), "double_sphere", DS),
    "kalibr eucm": (kalibr("eucm", "none", EUCM), "eucm", EUCM),
    "kalibr omni": (kalibr("omni", "radtan", MEI[:1], *MEI[1:]), "mei", MEI),
    "kalibr omni alone": (kalibr("omni", "none", MEI[:1]), "mei", (MEI[0], 0, 0, 0, 0)),
    "kalibr fov": (kalibr("pinhole", "fov", (), *FOV), "fov", FOV),
    "basalt kb4": (files.basalt("kb4", files.NUMBERS | KB_NAMED), "kannala_brandt", KB),
    "basalt ds": (files.basalt("ds", files.NUMBERS | DS_NAMED), "double_sphere", DS),
    "basalt eucm": (files.basalt("eucm", files.NUMBERS | EUCM_NAMED), "eucm", EUCM),
    "basalt ucm": (files.basalt("ucm", files.NUMBERS | {"alpha": 0.5}), "eucm", (0.5, 1.0)),
    "basalt fov": (files.basalt("fov", files.NUMBERS | {"w": 0.9}), "fov", FOV),
    "ros": (ROS, "kannala_brandt", KB),
    "ros, RealSense": (ROS.replace("-0.001]", "-0.001, 0.0]"), "kannala_brandt", KB),
    "euroc": (
        files.EUROC.replace("radial-tangential", "equidistant").replace(
            str(list(files.D[:4])), str(list(KB))
        ),
        "kannala_brandt",
        KB,
    ),
    "opencv": (
        "fisheye_model: 1\nimage_width: 640\nimage_height: 480\n"
        + files.matrix("camera_matrix", files.ROWS)
        + files.matrix("distortion_coefficients", KB, 1),
        "kannala_brandt",
        KB,
    ),
    "opencv, named": (
        "distortion_model: fisheye\nimage_width: 640\nimage_height: 480\n"
        + files.matrix("K", files.ROWS)
        + files.matrix("D", KB, 4),
        "kannala_brandt",
        KB,
    ),
    "colmap": (
        f"1 OPENCV_FISHEYE 640 480 {COLMAP} 0.02 -0.01 0.004 -0.001\n",
        "kannala_brandt",
        KB,
    ),
    "colmap radial": (
        f"1 RADIAL_FISHEYE 640 480 {COLMAP_ONE_F} 0.02 -0.01\n",
        "kannala_brandt",
        (0.02, -0.01, 0, 0),
    ),
    "colmap simple": (
        f"1 SIMPLE_RADIAL_FISHEYE 640 480 {COLMAP_ONE_F} 0.02\n",
        "kannala_brandt",
        (0.02, 0, 0, 0),
    ),
    "colmap fov": (f"1 FOV 640 480 {COLMAP} 0.9\n", "fov", FOV),
    "nerfstudio": (
        json.dumps({"camera_model": "OPENCV_FISHEYE", **NERFSTUDIO}),
        "kannala_brandt",
        KB,
    ),
    "nerfstudio, instant-ngp": (
        json.dumps({"is_fisheye": True, **NERFSTUDIO}),
        "kannala_brandt",
        KB,
    ),
    "stella": (STELLA, "kannala_brandt", KB),
    "vins kannala": (VINS_KB, "kannala_brandt", KB),
    "vins mei": (VINS_MEI, "mei", MEI),
    "oak": (
        json.dumps({"cameraData": [files.oak_camera(0, -1, 0.0, 1, KB)]}),
        "kannala_brandt",
        KB,
    ),
    "fca kannala": (FCA_HEAD + listed(KB_NAMED), "kannala_brandt", KB),
    "fca ds": (FCA_HEAD + listed(DS_NAMED), "double_sphere", DS),
    "fca eucm": (FCA_HEAD + listed(EUCM_NAMED), "eucm", EUCM),
    "fca ucm": (FCA_HEAD + "  alpha: 0.5\n", "eucm", (0.5, 1.0)),
    "numbers": (
        json.dumps(
            {**files.NUMBERS, "model": "fisheye", "coeffs": KB, "width": 640, "height": 480}
        ),
        "kannala_brandt",
        KB,
    ),
    "numbers by names": (
        json.dumps({**files.NUMBERS, **MEI_NAMED, "width": 640, "height": 480}),
        "mei",
        MEI,
    ),
    "numbers, RealSense": (
        files.REALSENSE.replace("inverse_brown_conrady", "kannala_brandt4").replace(
            "[0, 0, 0, 0, 0]", str([*KB, 0])
        ),
        "kannala_brandt",
        KB,
    ),
}

# ---- settings files ------------------------------------------------------------------------------
PINHOLE_LENS = "".join(line for line in other_settings.FIRST.splitlines(True) if line[8:9] in "kp")


def orb_slam3(text: str, lens: dict[str, float], model: str = "KannalaBrandt8") -> str:
    """A settings file of ORB-SLAM3 1.0 with another lens."""
    assert PINHOLE_LENS in text
    named = "".join(f"Camera1.{name}: {value}\n" for name, value in lens.items())
    return text.replace("PinHole", model).replace(PINHOLE_LENS, named)


MONO = orb_slam3(other_settings.MONO_V1, KB_NAMED)
RGBD = orb_slam3(other_settings.RGBD_V1, KB_NAMED)
PAIR = orb_slam3(other_settings.PAIR_V1, KB_NAMED)


def older(text: str) -> str:
    """The same file in the keys of ORB-SLAM2 and ORB-SLAM3 0.x."""
    return text.replace("Camera1.", "Camera.")

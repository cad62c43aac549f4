# SPDX-License-Identifier: BSD-3-Clause
"""Calibrations that stereo cameras bring with them: OAK (DepthAI) and ZED."""

from __future__ import annotations

import configparser
import re
from collections.abc import Mapping
from typing import Any

import cv2
import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.calibration.camera_model import (
    checked_camera_matrix,
    checked_numbers,
    checked_size,
    kannala_brandt_numbers,
    opencv_coefficients,
    pinhole_matrix,
    pose_of_parts,
)
from orbslam2py.calibration.foreign_cameras import (
    NO_DISTORTION,
    CalibrationSource,
    CameraFile,
    ForeignCamera,
    both_ways,
)
from orbslam2py.calibration.lenses import PINHOLE, lens_of
from orbslam2py.errors import SettingsError
from orbslam2py.trajectory.rotations import inverse_poses

_METRES_PER_CENTIMETRE, _METRES_PER_MILLIMETRE = 0.01, 0.001

# ---- OAK -----------------------------------------------------------------------------------------
#: By the number of ``cameraType``.
_OAK_LENSES = {"0": PINHOLE, "1": "kannala_brandt", "2": "equirectangular", "3": "polynomial"}


def read_oak(source: CalibrationSource) -> CameraFile:
    """Read the cameras of all sockets; each has the position of another one, in centimetres."""
    cameras: dict[int, Mapping[str, Any]] = {}
    listed = source.value("cameraData")
    for entry in listed if isinstance(listed, list) else [listed]:
        if not (isinstance(entry, list) and len(entry) == 2 and isinstance(entry[0], int)):
            raise SettingsError(
                f"{source.path}: cameraData must list [socket, values]; read the calibration from "
                "the camera again"
            )
        values = source.mapping(entry[1], f"socket {entry[0]}")
        if values.get("width"):  # sockets without a camera are listed, too
            cameras[entry[0]] = values
    if not cameras:
        raise SettingsError(
            f"{source.path}: cameraData lists no camera; read the calibration from the camera again"
        )
    places = _places(source, cameras)
    found = tuple(_oak_camera(source, n, v, places.get(n)) for n, v in cameras.items())
    return CameraFile(
        found, prefix="socket ", pairs=_pairs(source, sorted(cameras)), place_key="extrinsics"
    )


def _pairs(source: CalibrationSource, sockets: list[int]) -> tuple[tuple[int, int], ...]:
    """Find the pair that the file names, or that of the sockets 1 (left) and 2 (right)."""
    named = source.values.get("stereoRectificationData")
    if isinstance(named, Mapping):
        pair = [named.get("leftCameraSocket"), named.get("rightCameraSocket")]
        if all(isinstance(one, int) and one in sockets for one in pair) and pair[0] != pair[1]:
            return both_ways([int(str(one)) for one in pair])
    if {1, 2} <= set(sockets):
        return both_ways([1, 2])
    return both_ways(sockets) if len(sockets) == 2 else ()


def _places(
    source: CalibrationSource, cameras: Mapping[int, Mapping[str, Any]]
) -> dict[int, FloatArray]:
    """Chain the relative poses of the cameras, beginning at the lowest socket."""
    links: dict[tuple[int, int], FloatArray] = {}
    for socket, values in cameras.items():
        given = values.get("extrinsics")
        if not isinstance(given, Mapping) or given.get("toCameraSocket") not in list(cameras):
            continue
        where = f"socket {socket}: extrinsics"
        t = source.mapping(source.value("translation", given, f"{where}."), f"{where}.translation")
        other = int(given["toCameraSocket"])
        T = pose_of_parts(
            source.path,
            where,
            source.value("rotationMatrix", given, f"{where}."),
            [source.value(axis, t, f"{where}.translation.") for axis in "xyz"],
        )
        T[:3, 3] *= _METRES_PER_CENTIMETRE
        links[socket, other], links[other, socket] = T, inverse_poses(T[None])[0]
    places = {min(cameras): np.eye(4)}
    for _ in cameras:
        for (known, new), T in links.items():
            if known in places and new not in places:
                places[new] = T @ places[known]
    return places


def _oak_camera(
    source: CalibrationSource, socket: int, values: Mapping[str, Any], T: FloatArray | None
) -> ForeignCamera:
    name = f"socket {socket}"
    path = f"{source.path}: {name}"
    sides = [source.value(side, values, f"{name}: ") for side in ("width", "height")]
    size = checked_size(path, sides)
    kind = values.get("cameraType", 0)
    lens = _OAK_LENSES.get(str(kind)) or lens_of(path, "cameraType", kind)
    K, D = None, NO_DISTORTION
    numbers: tuple[float, ...] = ()
    if lens in (PINHOLE, "kannala_brandt"):
        matrix = source.value("intrinsicMatrix", values, f"{name}: ")
        K = checked_camera_matrix(path, matrix, "intrinsicMatrix")
        given = values.get("distortionCoeff", [])
        if lens == PINHOLE:
            D = opencv_coefficients(path, given, K, size)
        else:
            numbers = kannala_brandt_numbers(path, "distortionCoeff", given)
    return ForeignCamera(name, socket, K, D, size, lens, T, lens_numbers=numbers)


# ---- ZED -----------------------------------------------------------------------------------------
#: Sizes of the images by the names of the resolutions.
_ZED_SIZES = {
    "4K": (3840, 2160),
    "QHDPLUS": (3200, 1800),
    "2K": (2208, 1242),
    "FHD": (1920, 1080),
    "FHD1200": (1920, 1200),
    "HD": (1280, 720),
    "HD1200": (1920, 1200),
    "SVGA": (960, 600),
    "VGA": (672, 376),
}
_EIGHT = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")


def read_zed(source: CalibrationSource) -> CameraFile:
    """Read the pair of one resolution: of the only one, or of that with the size asked for."""
    parser = configparser.ConfigParser(strict=False, interpolation=None)
    try:
        parser.read_string(source.text)
    except configparser.Error as error:
        raise SettingsError(
            f"{source.path} is damaged: {' '.join(str(error).split())}; download it again"
        ) from error
    names: list[str] = [
        match[1]
        for section in parser.sections()
        if (match := re.fullmatch(r"LEFT_CAM_(\w+)", section)) and match[1] in _ZED_SIZES
    ]
    name = _resolution(source, names)
    places = {"LEFT": np.eye(4), "RIGHT": _zed_place(source, parser, name)}
    cameras = tuple(
        _zed_camera(source, parser, i, side, name, T)
        for i, (side, T) in enumerate(places.items())
        if parser.has_section(f"{side}_CAM_{name}")
    )
    pairs = both_ways([camera.number for camera in cameras])
    return CameraFile(cameras, prefix="camera ", pairs=pairs, place_key="the section STEREO")


def _resolution(source: CalibrationSource, names: list[str]) -> str:
    there = {_ZED_SIZES[name]: name for name in names}
    listed = ", ".join(f"{width}x{height} ({name})" for (width, height), name in there.items())
    if not there:
        raise SettingsError(
            f"{source.path} has no resolution we know ({', '.join(_ZED_SIZES)}); download the "
            "calibration of the camera again"
        )
    if source.size is None and len(there) == 1:
        return names[0]
    if source.size is None:
        example = next(iter(there))
        raise SettingsError(
            f"{source.path} holds calibrations for images of {listed}; choose yours with --size "
            f"{example[0]}x{example[1]}"
        )
    if source.size not in there:
        raise SettingsError(
            f"{source.path} holds no calibration for images of {source.size[0]}x{source.size[1]}; "
            f"give --size with one there is: {listed}"
        )
    return there[source.size]


def _zed_camera(
    source: CalibrationSource,
    parser: configparser.ConfigParser,
    number: int,
    side: str,
    name: str,
    T: FloatArray | None,
) -> ForeignCamera:
    section, size = f"{side}_CAM_{name}", _ZED_SIZES[name]
    numbers = [_number(source, parser, section, key) for key in ("fx", "fy", "cx", "cy")]
    K = pinhole_matrix(source.path, section, numbers)
    lens = f"{side}_DISTO" if parser.has_section(f"{side}_DISTO") else section
    given = [_number(source, parser, lens, key, 0.0) for key in _EIGHT]
    D = opencv_coefficients(f"{source.path}: {section}", given, K, size)
    return ForeignCamera(section, number, K, D, size, T_camera_rig=T)


def _zed_place(
    source: CalibrationSource, parser: configparser.ConfigParser, name: str
) -> FloatArray | None:
    """Where the right camera stands: the distances are from the left one, in millimetres."""
    if not parser.has_section("STEREO"):
        return None
    distances = [_number(source, parser, "STEREO", "Baseline")]
    distances += [_number(source, parser, "STEREO", key, 0.0) for key in ("TY", "TZ")]
    turn = [_number(source, parser, "STEREO", f"{axis}_{name}", 0.0) for axis in ("RX", "CV", "RZ")]
    T = np.eye(4)
    T[:3, :3] = cv2.Rodrigues(np.array(turn))[0]
    T[:3, 3] = -np.array(distances) * _METRES_PER_MILLIMETRE
    return T


def _number(
    source: CalibrationSource,
    parser: configparser.ConfigParser,
    section: str,
    key: str,
    otherwise: float | None = None,
) -> float:
    given = parser.get(section, key, fallback=None)
    if given is None and otherwise is not None:
        return otherwise
    if given is None:
        raise SettingsError(
            f"{source.path}: {key} is missing in [{section}]; download the calibration again"
        )
    return float(checked_numbers(source.path, f"{key} of [{section}]", given, (1,))[0])

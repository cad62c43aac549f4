# SPDX-License-Identifier: BSD-3-Clause
"""Settings from calibration files of other programs; `settings.foreign` lists their formats."""

from __future__ import annotations

import logging
from dataclasses import replace
from enum import Enum
from pathlib import Path
from typing import Any

from orbslam2py._arguments import cannot_open, is_whole, member_of, path_of, shown
from orbslam2py.calibration.foreign_cameras import CalibrationSource, CameraFile, ForeignCamera
from orbslam2py.calibration.foreign_pairs import Pair, pair_settings, raw_camera
from orbslam2py.calibration.foreign_rigs import rig_settings
from orbslam2py.calibration.formats import READERS
from orbslam2py.calibration.lenses import require_supported
from orbslam2py.calibration.unknown_files import refuse_unknown
from orbslam2py.errors import SettingsError
from orbslam2py.settings import CameraSettings, OrbSettings, Sensor, Settings, settings_for_camera
from orbslam2py.settings.defaults import ASSUMED_DEPTH_FACTOR
from orbslam2py.settings.fisheye import needs_right_camera
from orbslam2py.settings.foreign import FOREIGN_FORMATS, FORMATS, recognise_camera_file
from orbslam2py.settings.pair_views import is_likely_baseline

_log = logging.getLogger(__name__)

_RATE = 30.0


class CameraFileFormat(str, Enum):
    """Formats of calibration files; `orbslam2py.settings.foreign.FORMATS` describes them."""

    AUTO = "auto"
    OPENCV = "opencv"
    KALIBR = "kalibr"
    ROS = "ros"
    COLMAP = "colmap"
    KITTI = "kitti"
    OST = "ost"
    EUROC = "euroc"
    VINS = "vins"
    STELLA_VSLAM = "stella_vslam"
    OAK = "oak"
    ZED = "zed"
    BASALT = "basalt"
    NERFSTUDIO = "nerfstudio"
    OPEN3D = "open3d"
    REPLICA = "replica"
    RECORD3D = "record3d"
    POLYCAM = "polycam"
    FCA = "fca"
    WOODSCAPE = "woodscape"
    ARIA = "aria"
    REALSENSE = "realsense"
    NUMBERS = "numbers"

    def __str__(self) -> str:
        return self.value


def read_camera_file(
    path: str | Path,
    file_format: CameraFileFormat | str = CameraFileFormat.AUTO,
    *,
    camera: int | None = None,
    right: str | Path | None = None,
    size: tuple[int, int] | None = None,
    sensor: Sensor | str | None = None,
    baseline: float | None = None,
    depth_factor: float | None = None,
    fps: float | None = None,
    n_features: int | None = None,
) -> Settings:
    """Make settings of another program's calibration file.

    Parameters
    ----------
    path
        The file.
    file_format
        Who wrote it, also as text (``"kalibr"``); by default recognised by its content.
    camera
        Number of the camera: ``cam0``, ``cam1`` ... of Kalibr, ``CAMERA_ID`` of COLMAP, ``P0`` to
        ``P3`` of KITTI, the socket of OAK; 0 is the left one of OpenCV and ZED. With `sensor`
        stereo it is the left camera of the pair. By default the only one; of a file with a pair the
        pair.
    right
        ROS and EuRoC: the file of the right camera of a pair; `path` is the left one's.
    size
        Width and height of the images [pixels], for a file that does not contain them, or that
        holds calibrations of several sizes (ZED).
    sensor
        What the settings are for; by default a single camera or the pair, as the file is.
    baseline, depth_factor
        As for `orbslam2py.settings.settings_for_camera`. A pair has its baseline from the file;
        only if that is in another unit than metres, `baseline` replaces it.
    fps, n_features
        Frames per second and ORB features per image. By default that of the file, or 30 (KITTI:
        10), and 1000 or, above 0.6 megapixels and for KITTI, 2000.

    Returns
    -------
    Settings
        For a single camera, an RGB-D camera, or a stereo pair with its rectification if it is raw.

    Raises
    ------
    SettingsError
        If the file cannot be read or understood, or has a camera model that is not supported; also
        for the name of a format that there is not.
    """
    path = path_of(path, "the calibration file", SettingsError)
    named = "the format of the calibration file"
    file_format = member_of(CameraFileFormat, file_format, named, SettingsError)
    sensor = None if sensor is None else Sensor(sensor)
    size = None if size is None else _checked_size(size)
    source = _open(path, size)
    if file_format is CameraFileFormat.AUTO:
        known = recognise_camera_file(source.text)
        file_format = CameraFileFormat(known or refuse_unknown(source))
    file = _sized(source, READERS[file_format.value](source))
    if file.note:
        _log.info("%s: %s", path, file.note)
    if sensor is Sensor.RIG:
        not_of_rigs = {"--right": right, "--camera": camera, "--baseline": baseline}
        return _rig_of(path, file, not_of_rigs, fps, depth_factor, n_features)
    if right is None:
        chosen = _choose(path, file, camera, sensor)
    else:
        chosen = _pair_of_files(source, file, file_format, right, camera, sensor)
    if fps is not None:
        CameraSettings(1.0, 1.0, 0.0, 0.0, fps=fps)  # a wrong rate is not the file's fault
    rate = fps if fps is not None else file.fps or _RATE
    what = f"{path} is {FOREIGN_FORMATS[file_format.value]}"
    try:
        settings = _settings_of(what, file, chosen, sensor, rate)
    except SettingsError as error:
        raise SettingsError(_named(path, str(error))) from error
    n_features = file.n_features if n_features is None else n_features
    if n_features is not None:
        settings = replace(settings, orb=OrbSettings(n_features=n_features))
    if sensor is Sensor.RGBD and depth_factor is None:
        depth_factor = file.depth_factor
        if depth_factor is None:
            _log.info(
                "%s does not say the units of the depth images; %s", path, ASSUMED_DEPTH_FACTOR
            )
    if sensor is Sensor.STEREO and settings.camera.is_fisheye and settings.right is None:
        raise SettingsError(f"{path}: {needs_right_camera()}")
    return _made_for(path, settings, sensor, baseline, depth_factor)


def _rig_of(
    path: Path,
    file: CameraFile,
    not_of_rigs: dict[str, Any],
    fps: float | None,
    depth_factor: float | None,
    n_features: int | None,
) -> Settings:
    for option, given in not_of_rigs.items():
        if given is not None:
            raise SettingsError(f"a rig has all cameras of the file; leave {option} out")
    settings = rig_settings(path, file, fps if fps is not None else file.fps or _RATE)
    n_features = file.n_features if n_features is None else n_features
    if n_features is not None:
        settings = replace(settings, orb=OrbSettings(n_features=n_features))
    if depth_factor is not None:
        assert settings.depth is not None
        settings = replace(settings, depth=replace(settings.depth, raw_per_metre=depth_factor))
    return settings


def _named(path: Path, message: str) -> str:
    return message if str(path) in message else f"{path}: {message}"


def _open(path: Path, size: tuple[int, int] | None) -> CalibrationSource:
    try:
        text = path.read_text(encoding="utf-8-sig", errors="replace")
    except OSError as error:
        raise SettingsError(cannot_open(path, error)) from error
    return CalibrationSource(path, text, size)


def _checked_size(size: tuple[int, int]) -> tuple[int, int]:
    if (
        not isinstance(size, tuple | list)
        or len(size) != 2
        or not all(is_whole(side) and side >= 1 for side in size)
    ):
        given = " x ".join(map(str, size)) if isinstance(size, tuple) else shown(size)
        raise SettingsError(f"size is {given}; give width and height in pixels, 1 or more")
    return int(size[0]), int(size[1])


def _sized(source: CalibrationSource, file: CameraFile) -> CameraFile:
    """Give cameras of unknown size the one that the user names."""
    size = source.size
    if size is None:
        return file
    for camera in file.cameras:
        if camera.size is not None and camera.size != size:
            width, height = camera.size
            raise SettingsError(
                f"{source.path} is for images of {width} x {height} pixels, not {size[0]} x "
                f"{size[1]}; leave --size out, and give images of that size or calibrate the "
                "camera at the size of yours"
            )
    return replace(file, cameras=tuple(replace(camera, size=size) for camera in file.cameras))


# ---- which camera --------------------------------------------------------------------------------
def _choose(
    path: Path, file: CameraFile, number: int | None, sensor: Sensor | None
) -> ForeignCamera | Pair:
    """Choose the camera, or the pair if none else is wanted."""
    cameras = {camera.number: camera for camera in file.cameras}
    names = ", ".join(camera.name for camera in file.cameras)
    if number is not None and file.prefix is None:
        raise SettingsError(f"{path} holds one camera, and no camera {number}; leave out --camera")
    if number is not None and number not in cameras:
        raise SettingsError(
            f"{path} has no {file.prefix}{number}; give --camera with one there is: {names}"
        )
    alone = sensor is not None and sensor is not Sensor.STEREO
    if file.pairs and not alone and (number is None or sensor is Sensor.STEREO):
        left, right = _numbers_of_pair(path, file, number)
        _tell_rest(path, file, (left, right))
        remedy = f"take one of them with --camera {left}"
        if sensor is Sensor.STEREO:
            remedy += " --sensor mono"
        return Pair(str(path), file, cameras[left], cameras[right], remedy)
    if number is not None:
        return cameras[number]
    if len(cameras) > 1 and not file.pairs:
        raise SettingsError(
            f"{path} lists {len(cameras)} cameras ({names}); choose one with --camera"
        )
    first = file.pairs[0][0] if file.pairs else file.cameras[0].number
    _tell_rest(path, file, (first,))
    return cameras[first]


def _numbers_of_pair(path: Path, file: CameraFile, number: int | None) -> tuple[int, int]:
    if number is None:
        return file.pairs[0]
    for pair in file.pairs:
        if pair[0] == number:
            return pair
    there = ", ".join(f"--camera {left} (with {file.prefix}{right})" for left, right in file.pairs)
    raise SettingsError(
        f"{path} has no right camera for {file.prefix}{number}, which stereo needs; give one of "
        f"{there}"
    )


def _tell_rest(path: Path, file: CameraFile, used: tuple[int, ...]) -> None:
    """Say which cameras of a file are left out."""
    rest = [camera for camera in file.cameras if camera.number not in used]
    if not rest:
        return
    names = {camera.number: camera.name for camera in file.cameras}
    _log.info(
        "%s holds %d cameras; the settings are of %s, not of %s (--camera %d)",
        path,
        len(file.cameras),
        " and ".join(names[number] for number in used),
        ", ".join(camera.name for camera in rest),
        rest[0].number,
    )


def _pair_of_files(
    source: CalibrationSource,
    file: CameraFile,
    file_format: CameraFileFormat,
    right: str | Path,
    camera: int | None,
    sensor: Sensor | None,
) -> Pair:
    path = source.path
    kinds = [one.name for one in FORMATS if one.pair == "right"]
    if file_format.value not in kinds:
        raise SettingsError(
            f"a file of the right camera goes with {', '.join(kinds)} files, {path} is not one; "
            "leave out --right"
        )
    if camera is not None:
        raise SettingsError(f"{path} holds one camera, and no camera {camera}; leave out --camera")
    if sensor is not None and sensor is not Sensor.STEREO:
        raise SettingsError(f"{path} and {right} are a pair; leave --right out for {sensor}")
    right = path_of(right, "the file of the right camera", SettingsError)
    second = _open(right, source.size)
    other = _sized(second, READERS[file_format.value](second))
    for where, one in ((path, file), (right, other)):
        if len(one.cameras) != 1:
            raise SettingsError(f"{where} holds a pair already; leave out --right")
    left = replace(file.cameras[0], name=str(path))
    return Pair(
        f"{path} and {right}",
        file,
        left,
        replace(other.cameras[0], name=str(right)),
        "leave out --right for the first one alone",
    )


# ---- settings ------------------------------------------------------------------------------------
def _settings_of(
    what: str, file: CameraFile, chosen: ForeignCamera | Pair, sensor: Sensor | None, fps: float
) -> Settings:
    if isinstance(chosen, Pair):
        for one in (chosen.left, chosen.right):
            where = f"{what}: {_called(file, one)}"
            require_supported(where, one.lens)
        return pair_settings(chosen, fps)
    where = f"{what}: {_called(file, chosen)}"
    require_supported(where, chosen.lens)
    return settings_for_camera(raw_camera(chosen, fps, rgb=file.rgb), Sensor.MONOCULAR)


def _called(file: CameraFile, camera: ForeignCamera) -> str:
    """Name of a camera in messages."""
    if file.prefix is None:
        return "its camera"
    return f"{file.prefix}{camera.name}" if camera.name.isdecimal() else camera.name


def _made_for(
    path: Path,
    settings: Settings,
    sensor: Sensor | None,
    baseline: float | None,
    depth_factor: float | None,
) -> Settings:
    sensor = sensor or settings.sensor
    if settings.sensor is Sensor.STEREO and sensor is Sensor.STEREO and depth_factor is None:
        return _with_baseline(path, settings, baseline)
    return settings_for_camera(
        settings.camera, sensor, baseline=baseline, depth_factor=depth_factor, orb=settings.orb
    )


def _with_baseline(path: Path, settings: Settings, baseline: float | None) -> Settings:
    """Set the baseline of a pair right whose file is in another unit than metres."""
    found = settings.baseline
    likely = is_likely_baseline(found)
    if baseline is None:
        if not likely:
            _log.warning(
                "%s gives a baseline of %.4g m; if it is in another unit, give the distance of the "
                "two cameras in metres with --baseline",
                path,
                found,
            )
        return settings
    if likely:
        raise SettingsError(f"{path} contains the baseline, {found:.4g} m; leave --baseline out")
    if settings.right is not None:
        T = settings.right.T_left_right.copy()
        T[:3, 3] *= baseline / found
        return replace(settings, right=replace(settings.right, T_left_right=T))
    bf = settings_for_camera(settings.camera, Sensor.STEREO, baseline=baseline).camera.bf
    pair = settings.rectification
    if pair is not None:
        P = pair.right.P.copy()
        P[0, 3] = -bf
        pair = replace(pair, right=replace(pair.right, P=P))
    return replace(settings, camera=replace(settings.camera, bf=bf), rectification=pair)

# SPDX-License-Identifier: BSD-3-Clause
"""Which streams of a RealSense camera are opened, and the settings that its calibration gives."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pyrealsense2 as rs

from orbslam2py._arrays import FloatArray
from orbslam2py.datasets.bags.calibration import (
    CameraInfo,
    settings_of_camera,
    settings_of_pair,
)
from orbslam2py.errors import DatasetError
from orbslam2py.live.device import Request, Stream
from orbslam2py.settings import ImuSettings, Sensor, Settings, imu_noise

#: Default size and rate: all cameras of the D400 series have them.
_SIZE, _RATE = (848, 480), 30
#: Rates of gyro and accelerometer nearest to these are taken, Hz.
_GYRO_RATE, _ACCEL_RATE = 200, 250
#: The chip of the D435i and D455, whose noise is taken: the camera does not give its own.
_CHIP = "bmi055"

#: Streams that are opened for a sensor: our stream, the stream of the SDK, its index and formats.
_Wanted = tuple[tuple[Stream, Any, int, tuple[Any, ...]], ...]
_INFRARED = (rs.format.y8,)
_COLOUR = (rs.format.bgr8, rs.format.rgb8)
_STREAMS: dict[Sensor, tuple[_Wanted, ...]] = {
    Sensor.STEREO: (
        (
            ("left", rs.stream.infrared, 1, _INFRARED),
            ("right", rs.stream.infrared, 2, _INFRARED),
        ),
    ),
    Sensor.RGBD: (
        (
            ("image", rs.stream.color, 0, _COLOUR),
            ("depth", rs.stream.depth, 0, (rs.format.z16,)),
        ),
    ),
    Sensor.MONOCULAR: (
        (("image", rs.stream.infrared, 1, _INFRARED),),
        (("image", rs.stream.color, 0, _COLOUR),),
    ),
}


@dataclass(frozen=True)
class Profile:
    """A stream that is opened.

    Attributes
    ----------
    stream
        Our name of it; None for gyro and accelerometer.
    sensor
        Part of the camera that delivers it.
    profile
        Its mode, as the SDK has it.
    """

    stream: Stream | None
    sensor: Any
    profile: Any


@dataclass(frozen=True)
class Plan:
    """Streams that are opened for a request.

    Attributes
    ----------
    kind
        Sensor for which the images are used.
    images
        Streams of images.
    motion
        Gyro and accelerometer; empty if they are not wanted.
    """

    kind: Sensor
    images: tuple[Profile, ...]
    motion: tuple[Profile, ...]

    def settings(self, name: str) -> Settings:
        """Make settings of the factory calibration."""
        first = self.images[0].profile.as_video_stream_profile()
        fps = float(first.fps())
        infos = [_info(name, one) for one in self.images]
        if self.kind is Sensor.STEREO:
            right = self.images[1].profile.as_video_stream_profile()
            T = _transform(first.get_extrinsics_to(right))
            settings = settings_of_pair(infos[0], infos[1], fps, rectified=False, T_right_left=T)
        else:
            factor = None
            if self.kind is Sensor.RGBD:
                scale = self.images[1].sensor.as_depth_sensor().get_depth_scale()
                factor = round(1 / scale, 3)
            settings = settings_of_camera(
                infos[0], self.kind, fps, rectified=False, depth_factor=factor
            )
        return replace(settings, camera=replace(settings.camera, rgb=False))

    def imu_settings(self) -> ImuSettings | None:
        """Return where the IMU is, with the noise of the chip that these cameras have."""
        if not self.motion:
            return None
        gyro = self.motion[0].profile
        noise = imu_noise(_CHIP)
        return ImuSettings(
            noise.gyro_noise,
            noise.accel_noise,
            noise.gyro_walk,
            noise.accel_walk,
            T_ci=_transform(gyro.get_extrinsics_to(self.images[0].profile)),
            rate=float(gyro.fps()),
        )


def make_plan(device: Any, name: str, request: Request) -> Plan:
    """Choose the streams for a request.

    Parameters
    ----------
    device
        The camera, as the SDK has it.
    name
        Name of the camera for messages.
    request
        Sensor, size, rate, and whether the IMU is wanted.

    Raises
    ------
    DatasetError
        If the camera has no such streams, with those that it has.
    """
    offered = [(s, p) for s in device.query_sensors() for p in s.get_stream_profiles()]
    wanted = (request.sensor,) if request.sensor else (Sensor.STEREO, Sensor.RGBD, Sensor.MONOCULAR)
    for kind in wanted:
        for streams in _STREAMS[kind]:
            images = _choose_images(streams, offered, request)
            if images is not None:
                motion = _choose_motion(name, offered) if request.imu else ()
                return Plan(kind, images, motion)
    asked = " or ".join(map(str, wanted))
    if request.size is not None:
        asked += " with {} x {} pixels".format(*request.size)
    if request.fps is not None:
        asked += f" at {request.fps:g} frames per second"
    modes = "".join(f"\n  {mode}" for mode in list_modes(device))
    raise DatasetError(f"{name} has no images for {asked}; it has:{modes}")


def list_modes(device: Any) -> list[str]:
    """List the streams of a camera with their sizes and rates."""
    rates: dict[str, set[int]] = {}
    for sensor in device.query_sensors():
        for profile in sensor.get_stream_profiles():
            what = profile.stream_name().lower()
            if profile.is_video_stream_profile():
                video = profile.as_video_stream_profile()
                known = (*_INFRARED, *_COLOUR, rs.format.z16)
                if profile.format() not in known:
                    continue
                what += f" {video.width()} x {video.height()}"
            rates.setdefault(what, set()).add(profile.fps())
    shown = {what: ", ".join(map(str, sorted(fps, reverse=True))) for what, fps in rates.items()}
    return [f"{what}, {fps} {'fps' if ' x ' in what else 'Hz'}" for what, fps in shown.items()]


def _choose_images(
    streams: _Wanted, offered: list[tuple[Any, Any]], request: Request
) -> tuple[Profile, ...] | None:
    """Choose modes of one size and rate; None if there are none."""
    found = [_matching(wanted, offered, request) for wanted in streams]
    common = set.intersection(*(set(modes) for modes in found))
    if not common:  # colour and depth may have different sizes
        rates = set.intersection(*({mode[2] for mode in modes} for modes in found))
        if not rates:
            return None
        rate = min(rates, key=lambda fps: _rank((*_SIZE, fps), request))
        keys = [
            min((m for m in modes if m[2] == rate), key=lambda m: _rank(m, request))
            for modes in found
        ]
    else:
        keys = [min(common, key=lambda mode: _rank(mode, request))] * len(found)
    return tuple(
        Profile(wanted[0], *modes[key])
        for wanted, modes, key in zip(streams, found, keys, strict=True)
    )


_Mode = tuple[int, int, int]


def _matching(
    wanted: tuple[Stream, Any, int, tuple[Any, ...]],
    offered: list[tuple[Any, Any]],
    request: Request,
) -> dict[_Mode, tuple[Any, Any]]:
    """Modes of a stream that fit the request, by width, height and rate."""
    stream, kind, index, formats = wanted
    found: dict[_Mode, tuple[Any, Any]] = {}
    for form in formats:
        for sensor, profile in offered:
            if (profile.stream_type(), profile.format()) != (kind, form):
                continue
            video = profile.as_video_stream_profile()
            mode = (video.width(), video.height(), profile.fps())
            # Depth is registered to the images: its own size does not matter.
            sized = stream == "depth" or request.size in (None, mode[:2])
            rated = request.fps in (None, mode[2])
            if profile.stream_index() == index and sized and rated:
                found.setdefault(mode, (sensor, profile))
    return found


def _rank(mode: _Mode, request: Request) -> tuple[float, float]:
    """Sort key of modes, the best first: the usual size and rate."""
    width, height = request.size or _SIZE
    away = abs(mode[0] - width) + abs(mode[1] - height)
    return away, abs(mode[2] - (request.fps or _RATE))


def _choose_motion(name: str, offered: list[tuple[Any, Any]]) -> tuple[Profile, ...]:
    chosen = []
    for kind, rate in ((rs.stream.gyro, _GYRO_RATE), (rs.stream.accel, _ACCEL_RATE)):
        fitting = [(s, p) for s, p in offered if p.stream_type() == kind]
        if not fitting:
            raise DatasetError(f"{name} has no IMU; leave out --imu")
        best = min(fitting, key=lambda pair: abs(pair[1].fps() - rate))
        chosen.append(Profile(None, *best))
    return tuple(chosen)


def _info(name: str, one: Profile) -> CameraInfo:
    intrinsics = one.profile.as_video_stream_profile().get_intrinsics()
    message = SimpleNamespace(
        k=[intrinsics.fx, 0, intrinsics.ppx, 0, intrinsics.fy, intrinsics.ppy, 0, 0, 1],
        d=list(intrinsics.coeffs),
        r=[],
        p=np.zeros(12),
        width=intrinsics.width,
        height=intrinsics.height,
        distortion_model=str(intrinsics.model).rpartition(".")[2],
    )
    info = CameraInfo.of(message, f"{name} ({one.stream})")
    if info is None:
        raise DatasetError(
            f"{name} has no calibration of its {one.stream} images; give --settings with a file"
        )
    return info


def _transform(extrinsics: Any) -> FloatArray:
    """Read the transform (4, 4); the SDK has rotations column by column."""
    T = np.eye(4)
    T[:3, :3] = np.reshape(extrinsics.rotation, (3, 3)).T
    T[:3, 3] = extrinsics.translation
    return T

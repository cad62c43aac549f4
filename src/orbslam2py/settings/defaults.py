# SPDX-License-Identifier: BSD-3-Clause
"""Usual values for all settings that are not the camera itself."""

from __future__ import annotations

from dataclasses import replace

from orbslam2py._arguments import finite_number, shown
from orbslam2py.errors import SettingsError
from orbslam2py.settings.fisheye import needs_right_camera
from orbslam2py.settings.groups import (
    CameraSettings,
    DepthSettings,
    OrbSettings,
    usual_n_features,
)
from orbslam2py.settings.sensor import Sensor
from orbslam2py.settings.settings import Settings

__all__ = ["settings_for_camera", "usual_n_features"]

#: Of the pair that an RGB-D camera counts as, though it has none [m]: as in the files for TUM.
USUAL_BASELINE = 0.075
#: Points nearer than this many baselines are close: 3 m for the baseline above.
USUAL_CLOSE_FACTOR = 40.0
#: Raw units per metre: millimetres.
USUAL_DEPTH_FACTOR = 1000.0
#: Shown to users of these default units.
ASSUMED_DEPTH_FACTOR = (
    f"{USUAL_DEPTH_FACTOR:g} units per metre (millimetres) are assumed; if they are others, give "
    "--depth-factor"
)


def settings_for_camera(
    camera: CameraSettings,
    sensor: Sensor | str,
    *,
    baseline: float | None = None,
    depth_factor: float | None = None,
    orb: OrbSettings | None = None,
) -> Settings:
    """Make complete settings of a camera, with usual values for all unknown ones.

    Parameters
    ----------
    camera
        The camera; its ``bf`` is used if there is no `baseline`.
    sensor
        The sensor.
    baseline
        Distance of the two cameras of a pair [m]. For RGB-D the equivalent baseline: points nearer
        than 40 baselines are close; by default 0.075 m, which gives 3 m.
    depth_factor
        RGB-D: units of the depth images per metre; by default 1000 (millimetres).
    orb
        The extraction; by default 1000 features, or 2000 above 0.6 megapixels.

    Raises
    ------
    SettingsError
        If a number is out of range or does not fit the sensor, the baseline of a pair is missing,
        or a pair is not rectified.
    """
    sensor = Sensor(sensor)
    if not isinstance(camera, CameraSettings):
        raise SettingsError(f"camera is {shown(camera)}; give CameraSettings(fx, fy, cx, cy)")
    if orb is not None and not isinstance(orb, OrbSettings):
        raise SettingsError(f"orb is {shown(orb)}; give OrbSettings(...), or None for the usual")
    _check(camera, sensor, baseline, depth_factor)
    bf = 0.0
    if sensor.has_depth:
        usual = camera.bf or USUAL_BASELINE * camera.fx
        bf = usual if baseline is None else baseline * camera.fx
    depth = None
    if sensor is Sensor.STEREO:
        depth = DepthSettings(USUAL_CLOSE_FACTOR)
    elif sensor is Sensor.RGBD:
        raw_per_metre = USUAL_DEPTH_FACTOR if depth_factor is None else depth_factor
        depth = DepthSettings(USUAL_CLOSE_FACTOR, raw_per_metre)
    return Settings(
        sensor=sensor,
        camera=replace(camera, bf=bf),
        orb=orb or OrbSettings(n_features=usual_n_features(camera.width, camera.height)),
        depth=depth,
    )


def _check(
    camera: CameraSettings, sensor: Sensor, baseline: float | None, depth_factor: float | None
) -> None:
    if baseline is not None and not sensor.has_depth:
        raise SettingsError(f"a baseline goes with stereo and rgbd; leave it out for {sensor}")
    if depth_factor is not None and sensor is not Sensor.RGBD:
        raise SettingsError(f"a depth factor goes with rgbd; leave it out for {sensor}")
    if baseline is not None:
        metres = "the distance of the two cameras in metres, above 0"
        if finite_number(baseline, "the baseline", metres) <= 0:
            raise SettingsError(f"the baseline is {baseline:g}; give {metres}")
    if sensor is not Sensor.STEREO:
        return
    if camera.is_fisheye:
        raise SettingsError(needs_right_camera())
    if camera.is_distorted:
        raise SettingsError(
            "stereo images must be rectified, and this camera has distortion; give the calibration "
            "of both cameras to import-camera (a file that holds both, or --right with ROS)"
        )
    if baseline is None and not camera.bf:
        raise SettingsError(
            "the baseline is missing; stereo needs the distance of its two cameras in metres "
            "(--baseline 0.12)"
        )

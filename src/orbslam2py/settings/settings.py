# SPDX-License-Identifier: BSD-3-Clause
"""All settings of a camera, from a file, a built-in name or Python.

>>> settings = Settings.load("my_camera.yaml", Sensor.RGBD)  # doctest: +SKIP
>>> settings.close_depth  # doctest: +SKIP
3.0929...
"""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from orbslam2py._arguments import path_of, shown
from orbslam2py._files import atomic_write
from orbslam2py.errors import SettingsError
from orbslam2py.settings.builtin import BUILTIN_NAMES, builtin_file, is_builtin_name
from orbslam2py.settings.doubts import find_doubts
from orbslam2py.settings.fisheye import LENS_PARAMETERS, needs_right_camera
from orbslam2py.settings.groups import (
    DISTORTION_FIELDS,
    CameraSettings,
    DepthSettings,
    OrbSettings,
    StereoRectification,
    ViewerSettings,
    raise_if_any,
)
from orbslam2py.settings.reader import groups_of_text, read_groups
from orbslam2py.settings.rig import (
    USUAL_CLOSE_FACTOR,
    VIRTUAL_BASELINE,
    RigCamera,
    checked_rig,
    depth_sources,
    describe_rig,
    doubts_of_rig,
)
from orbslam2py.settings.rig_file import format_rig, read_rig_groups, rig_of_text
from orbslam2py.settings.right_camera import RightCamera, SettingsGroups
from orbslam2py.settings.sensor import Sensor
from orbslam2py.settings.writer import format_settings

_log = logging.getLogger(__name__)

_GROUPS = {
    "camera": CameraSettings,
    "orb": OrbSettings,
    "depth": DepthSettings,
    "rectification": StereoRectification,
    "viewer": ViewerSettings,
    "right": RightCamera,
}
_MAY_BE_MISSING = ("depth", "rectification", "right")


@dataclass(frozen=True)
class Settings:
    """All that the system must know about a camera before the first image.

    Attributes
    ----------
    sensor
        The sensor of the settings; may be given as text.
    camera, orb
        The camera (rectified, or the left one of a fisheye pair) and the extraction. For one camera
        `CameraSettings.bf`, which it does not have, becomes 0; for a fisheye pair it follows from
        `right`.
    depth
        For stereo and RGB-D; always None for a single camera.
    rectification
        How raw stereo pairs are rectified before they are tracked; None if they come rectified, or
        are a fisheye pair.
    viewer
        Appearance of the map view.
    right
        The right camera of a fisheye pair, whose images are matched without rectification; else
        None.
    rig
        The cameras of a rig, the first of which is the body and is also `camera`; else None.

    Raises
    ------
    SettingsError
        The message names all invalid values by the keys of the settings file.
    """

    sensor: Sensor
    camera: CameraSettings
    orb: OrbSettings = field(default_factory=OrbSettings)
    depth: DepthSettings | None = None
    rectification: StereoRectification | None = None
    viewer: ViewerSettings = field(default_factory=ViewerSettings)
    right: RightCamera | None = None
    rig: tuple[RigCamera, ...] | None = None

    if TYPE_CHECKING:  # text is taken for a sensor, which the type of the field cannot say

        def __init__(
            self,
            sensor: Sensor | str,
            camera: CameraSettings,
            orb: OrbSettings = ...,
            depth: DepthSettings | None = None,
            rectification: StereoRectification | None = None,
            viewer: ViewerSettings = ...,
            right: RightCamera | None = None,
            rig: Sequence[RigCamera] | None = None,
        ) -> None: ...

    def __post_init__(self) -> None:
        object.__setattr__(self, "sensor", Sensor(self.sensor))
        self._check_types()
        if self.sensor is Sensor.MONOCULAR:  # as a file is read: its depth is another sensor's
            if self.camera.bf:
                object.__setattr__(self, "camera", replace(self.camera, bf=0.0))
            object.__setattr__(self, "depth", None)
        self._take_baseline()
        self._take_rig()
        problems = []
        if self.sensor.has_depth:
            if not self.camera.bf > 0:
                problems.append(f"Camera.bf is {self.camera.bf:g}; {self.sensor} needs it above 0")
            if self.depth is None:
                problems.append(f"ThDepth (depth.close_factor) is missing; {self.sensor} needs it")
            elif self.sensor is Sensor.RGBD and self.depth.raw_per_metre is None:
                problems.append(
                    "DepthMapFactor (depth.raw_per_metre) is missing; rgbd needs it: 1000 for "
                    "millimetres, 5000 for TUM, 1 for metres"
                )
        if self.sensor is Sensor.STEREO and self.camera.is_fisheye and self.right is None:
            problems = [needs_right_camera()]
        raise_if_any(problems)

    def _take_baseline(self) -> None:
        """Take bf of a fisheye pair from where its right camera stands."""
        if self.right is None:
            return
        if self.sensor is not Sensor.STEREO:
            object.__setattr__(self, "right", None)
            return
        if self.rectification is not None:
            raise SettingsError(
                "rectification and right are both given; a pair is rectified, or has a right "
                "camera whose images are matched without rectification: keep one"
            )
        bf = self.right.baseline * self.camera.pixels_per_radian
        object.__setattr__(self, "camera", replace(self.camera, bf=bf))

    def _take_rig(self) -> None:
        """Take the camera of the body, and its baseline, from the rig."""
        if self.sensor is not Sensor.RIG:
            object.__setattr__(self, "rig", None)
            return
        if self.rig is None:
            raise SettingsError(
                "a rig needs its cameras: a file with Camera1.*, Camera2.*, ..., which "
                "import-camera makes of a calibration of all cameras (--sensor rig), or "
                "rig=[RigCamera(...), ...]"
            )
        rig = checked_rig(self.rig)
        object.__setattr__(self, "rig", rig)
        depth = self.depth or DepthSettings(USUAL_CLOSE_FACTOR)
        object.__setattr__(self, "depth", depth)
        if any(camera.depth for camera in rig) and depth.raw_per_metre is None:
            raise SettingsError(
                "DepthMapFactor (depth.raw_per_metre) is missing; depth images need it: 1000 for "
                "millimetres, 5000 for TUM, 1 for metres"
            )
        source = next(source for source in depth_sources(rig) if source.has_depth)
        apart = VIRTUAL_BASELINE
        if source.partner is not None:
            own = rig[depth_sources(rig).index(source)]
            apart = float(np.linalg.norm(rig[source.partner].centre - own.centre))
        camera = rig[0].camera
        bf = apart * camera.pixels_per_radian
        object.__setattr__(self, "camera", replace(camera, bf=bf))

    def _check_types(self) -> None:
        for name, kind in _GROUPS.items():
            group = getattr(self, name)
            if not (isinstance(group, kind) or (group is None and name in _MAY_BE_MISSING)):
                raise SettingsError(f"{name} is {shown(group)}; give {kind.__name__}(...)")

    @property
    def baseline(self) -> float:
        """Distance of the two cameras of the pair (virtual for RGB-D) [m]; 0 for one camera."""
        return self.camera.bf / self.camera.pixels_per_radian

    @property
    def close_depth(self) -> float:
        """Depth [m] below which one view suffices for a point; infinite for one camera."""
        if self.depth is None:
            return math.inf
        return self.baseline * self.depth.close_factor

    @property
    def max_keyframe_interval(self) -> int:
        """Most frames from one keyframe to the next: those of one second, at least 1."""
        return max(1, math.trunc(self.camera.fps))

    @property
    def depth_factor(self) -> float:
        """Raw units of the depth image per metre; 1 if it is in metres."""
        if self.depth is None or self.depth.raw_per_metre is None:
            return 1.0
        return self.depth.raw_per_metre

    def doubts(self) -> list[str]:
        """Return values that are allowed but probably wrong, such as a baseline in millimetres."""
        doubts = find_doubts(self.sensor, self._groups())
        return doubts if self.rig is None else doubts + doubts_of_rig(self.rig)

    def check_for(self, sensor: Sensor | str) -> None:
        """Raise `SettingsError` unless these settings are for this sensor."""
        sensor = Sensor(sensor)
        if self.sensor is not sensor:
            raise SettingsError(
                f"these settings are for {self.sensor}, not for {sensor}; make or load them for "
                f"{sensor}, or open the images for {self.sensor}"
            )

    @classmethod
    def load(
        cls, path: str | PathLike[str], sensor: Sensor | str, *, allow_unknown: bool = False
    ) -> Settings:
        """Read a settings file of ORB-SLAM2, 3 or stella_vslam, or built-in settings by name.

        Logs the `doubts` of a file as warnings.

        Parameters
        ----------
        path
            The file, in OpenCV's YAML dialect, or a name such as ``tum1`` (see
            `orbslam2py.settings.BUILTIN_NAMES`).
        sensor
            The sensor: one file may serve several sensors.
        allow_unknown
            Log unknown keys as warnings instead of refusing the file.

        Raises
        ------
        SettingsError
            With a list of all errors: file, line, key, allowed values, nearest key.
        """
        settings = resolve_settings(path, sensor, allow_unknown=allow_unknown)
        if not is_builtin_name(str(path)):
            for doubt in settings.doubts():
                _log.warning("%s: %s", path, doubt)
        return settings

    def save(self, path: str | PathLike[str]) -> None:
        """Write an ORB-SLAM settings file; `load` reads equal settings from it.

        Parameters
        ----------
        path
            The file; replaced only after everything is written.

        Raises
        ------
        OSError
            If the file cannot be written; an existing file is kept then.
        """
        with atomic_write(path) as stream:
            stream.write(self.to_yaml())

    def to_yaml(self) -> str:
        """Return the text of the settings file that `save` writes."""
        if self.rig is not None:
            return format_rig(self._groups())
        return format_settings(self.sensor, self._groups())

    def _groups(self) -> SettingsGroups:
        return SettingsGroups(
            camera=self.camera,
            orb=self.orb,
            depth=self.depth,
            rectification=self.rectification,
            viewer=self.viewer,
            right=self.right,
            rig=self.rig,
        )

    @classmethod
    def from_yaml(cls, text: str, sensor: Sensor | str, *, source: str = "settings") -> Settings:
        """Read the text of a settings file, for example from `to_yaml`.

        Parameters
        ----------
        text
            In OpenCV's YAML dialect.
        sensor
            The sensor.
        source
            Its source, for messages.

        Raises
        ------
        SettingsError
            As for `load`; doubts are not logged.
        """
        sensor = Sensor(sensor)
        read = rig_of_text if sensor is Sensor.RIG else groups_of_text
        groups = read(text, Path(source), sensor, allow_unknown=False)
        return cls(sensor=sensor, **groups)

    def describe(self) -> list[str]:
        """Return these settings line by line, for a log."""
        camera, orb = self.camera, self.orb
        lines = [] if self.rig is None else describe_rig(self.rig)
        lines += [
            f"camera ({self.sensor}): fx {camera.fx:g}, fy {camera.fy:g}, cx {camera.cx:g}, "
            f"cy {camera.cy:g}, {camera.fps:g} fps, colour order {'RGB' if camera.rgb else 'BGR'}",
            _lens_line(camera),
            f"ORB: {orb.n_features} features, {orb.n_levels} levels, factor {orb.scale_factor:g}, "
            f"FAST thresholds {orb.ini_th_fast} and {orb.min_th_fast}"
            + (", coordinates of the original" if orb.original_coordinates else ""),
        ]
        if self.depth is not None:
            lines.append(
                f"baseline {self.baseline:.4g} m, points are close below {self.close_depth:.4g} m"
            )
        if self.right is not None:
            lens = _lens_line(self.right.camera)
            lines.append(f"fisheye pair, matched without rectification; right camera: {lens}")
        elif self.rectification is not None and not self.rectification.applied:
            lines.append("raw pairs are rectified before they are tracked")
        if self.sensor is Sensor.RGBD:
            lines.append(f"depth images: {self.depth_factor:g} units per metre")
        return lines


def _lens_line(camera: CameraSettings) -> str:
    """Describe the lens."""
    if camera.is_fisheye:
        named = zip(LENS_PARAMETERS[camera.model], camera.lens, strict=True)
        kind = "lens" if camera.model == "thin_prism" else "fisheye lens"
        return f"{kind} {camera.model}: {', '.join(f'{n} {value:g}' for n, value in named)}"
    if not camera.is_distorted:
        return "no distortion"
    names = ", ".join(DISTORTION_FIELDS[: len(camera.distortion)])
    return f"distortion ({names}): {', '.join(f'{value:g}' for value in camera.distortion)}"


def builtin_settings(name: str, sensor: Sensor | str) -> Settings:
    """Return the settings of a data set, as published with ORB-SLAM2 for this sensor.

    Parameters
    ----------
    name
        One of `BUILTIN_NAMES`, or a single KITTI sequence (``kitti00`` ... ``kitti12``), in any
        case.
    sensor
        The sensor: settings for stereo and mono differ.

    Raises
    ------
    SettingsError
        If there is no such name, or none for this sensor.
    """
    sensor = Sensor(sensor)
    if not isinstance(name, str):
        names = ", ".join(BUILTIN_NAMES)
        raise SettingsError(f"the name of the settings is {shown(name)}; give one of {names}")
    return _settings_of_file(builtin_file(name, sensor), sensor)


def resolve_settings(
    choice: str | PathLike[str] | Settings, sensor: Sensor | str, *, allow_unknown: bool = False
) -> Settings:
    """Return settings from the user's choice: a built-in name, a file, or finished settings.

    Their doubts are not logged here, but by the system that uses them.

    A built-in name takes precedence over a file of the same name. Any other text that looks like a
    path (it exists, has a suffix or a folder) is read as a file.

    Parameters
    ----------
    choice
        The name, the path or the settings.
    sensor
        The sensor.
    allow_unknown
        Log unknown keys as warnings instead of refusing the file.

    Raises
    ------
    SettingsError
        If it is neither a name nor a readable and correct file, or if it is for another sensor.
    """
    sensor = Sensor(sensor)
    if isinstance(choice, Settings):
        choice.check_for(sensor)
        return choice
    if not isinstance(choice, str | PathLike) or not str(choice):
        raise SettingsError(
            f"settings are {shown(choice)}; give Settings, a file, or "
            f"a built-in name ({', '.join(BUILTIN_NAMES)}); 'orbslam2py settings new' and "
            "settings_for_camera make them of the numbers of a camera"
        )
    choice = path_of(choice, "the settings file", SettingsError)
    if looks_like_path(choice) and not is_builtin_name(str(choice)):
        return _settings_of_file(Path(choice), sensor, allow_unknown=allow_unknown)
    return builtin_settings(str(choice), sensor)


def looks_like_path(choice: str | PathLike[str]) -> bool:
    """Return whether a choice exists as a file, or has a suffix or a folder."""
    path = Path(choice)
    return path.exists() or bool(path.suffix) or len(path.parts) > 1


def _settings_of_file(path: Path, sensor: Sensor, *, allow_unknown: bool = False) -> Settings:
    read = read_rig_groups if sensor is Sensor.RIG else read_groups
    return Settings(sensor=sensor, **read(path, sensor, allow_unknown=allow_unknown))

# SPDX-License-Identifier: BSD-3-Clause
"""Options of a system, beside its camera."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy.typing as npt

from orbslam2py import _core as core
from orbslam2py._arguments import choice_of, is_finite, member_of, path_of, pose_of, seed_of, shown
from orbslam2py.errors import SettingsError
from orbslam2py.maps.map_file import MapFile
from orbslam2py.maps.saved_map import SavedMap
from orbslam2py.maps.setup_check import check_camera, check_sensor, check_vocabulary
from orbslam2py.settings.imu import ImuSettings
from orbslam2py.settings.imu_files import imu_of_settings_file, read_imu_settings
from orbslam2py.settings.sensor import Sensor
from orbslam2py.settings.settings import Settings, resolve_settings
from orbslam2py.slam.config import PRESETS, Config, value_of
from orbslam2py.slam.effort import Effort
from orbslam2py.vocabulary.vocabulary import load_vocabulary, vocabulary_name

_SWITCHES = (
    *("deterministic", "wait_for_mapping", "loop_closing", "full_adjustment", "several_maps"),
    *("check_calibration", "keyframe_images", "point_patches"),
)


@dataclass(frozen=True)
class SystemOptions:
    """Options of a `System`. Each is also a keyword of its constructor, which describes them.

    Raises
    ------
    SettingsError
        If a switch is not True or False, the effort is not a name of `Effort`, the seed is no whole
        number from 0 to 2^64 - 1, the time limit is not above 0 or is used with the deterministic
        mode, `new_map_after` is no number of seconds, or an option belongs to a feature that is
        off.
    """

    deterministic: bool = False
    wait_for_mapping: bool = False
    loop_closing: bool = True
    full_adjustment: bool = True
    full_adjustment_time_limit: float | None = None
    keyframe_images: bool = False
    point_patches: bool = True
    seed: int = 0
    check_calibration: bool = True
    several_maps: bool = True
    new_map_after: float = 2.0
    effort: Effort = Effort.NORMAL
    config: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "seed", seed_of(self.seed))
        effort = member_of(Effort, self.effort, "effort", SettingsError)
        object.__setattr__(self, "effort", effort)
        object.__setattr__(self, "config", _changes_of(self.config))
        for name in _SWITCHES:
            object.__setattr__(self, name, choice_of(getattr(self, name), name))
        if not (is_finite(self.new_map_after) and self.new_map_after >= 0):
            raise SettingsError(
                "new_map_after must be a number of seconds from 0 on, got "
                f"{shown(self.new_map_after)}; to wait for the old map for ever, switch "
                "several_maps off"
            )
        self._check_time_limit()

    @property
    def full_config(self) -> Config:
        """Return the whole configuration: the preset of the effort, with the changes."""
        return Config().with_changes({**PRESETS[str(self.effort)], **self.config})

    def _check_time_limit(self) -> None:
        seconds = self.full_adjustment_time_limit
        if seconds is None:
            return
        if not (is_finite(seconds) and seconds > 0):
            raise SettingsError(
                "the time limit of the full adjustment must be more than 0 s, got "
                f"{shown(seconds)}; give seconds, or leave it out"
            )
        if self.deterministic:
            raise SettingsError(
                "deterministic mode takes no time limit for the full adjustment: the result after "
                "a given time differs from run to run; leave the limit out"
            )


def _changes_of(given: Any) -> dict[str, float | int | bool]:
    """Return changes of a configuration, given as changes or as a whole `Config`."""
    if isinstance(given, Config):
        return given.changes()
    if not isinstance(given, Mapping):
        raise SettingsError(
            f"config is {shown(given)}; give a dictionary such as {{'tracking.map_matches': 12}}"
        )
    changed = Config().with_changes(given)
    return {str(name): value_of(changed, name) for name in given}


@dataclass(frozen=True)
class Setup:
    """The parts of a system: given, or from the map that it loads."""

    sensor: Sensor
    settings: Settings
    vocabulary: core.Vocabulary
    vocabulary_name: str
    loaded: SavedMap | MapFile | None
    initial_pose: core.Pose | None
    """``T_cw`` where the camera may be in the loaded map."""
    imu: ImuSettings | None = None
    """The IMU beside the camera that is tracked, which for a rectified pair is turned."""

    @classmethod
    def of(
        cls,
        settings: Settings | str | Path | None,
        sensor: Sensor | str | None,
        vocabulary: core.Vocabulary | str | Path | None,
        map_to_load: SavedMap | MapFile | str | Path | None,
        initial_T_wc: npt.ArrayLike | None,
        allow_other: bool,
        imu: ImuSettings | str | Path | None = None,
    ) -> Setup:
        """Combine the arguments with the contents of the map; `System` describes the arguments."""
        if map_to_load is None or isinstance(map_to_load, (SavedMap, MapFile)):
            loaded = map_to_load
        else:
            loaded = MapFile(map_to_load)
        if sensor is None:
            sensor = settings.sensor if isinstance(settings, Settings) else None
            sensor = loaded.sensor if loaded is not None else sensor
        if sensor is None:
            raise SettingsError(
                "give the sensor of the images: sensor='mono', 'stereo', 'rgbd' or 'rig'"
            )
        sensor = Sensor(sensor)
        if settings is None:
            if loaded is None:
                raise SettingsError("settings are missing; give them, or a map that holds them")
            settings = loaded.settings
        if loaded is not None:
            check_sensor(loaded, sensor)
        given, settings = settings, resolve_settings(settings, sensor)
        if sensor is Sensor.RIG and imu is not None:
            raise SettingsError("a rig uses no IMU yet; leave imu out, or track one camera with it")
        if imu is None and sensor is not Sensor.RIG and not isinstance(given, Settings):
            imu = imu_of_settings_file(Path(given))
        words = (
            vocabulary if isinstance(vocabulary, core.Vocabulary) else load_vocabulary(vocabulary)
        )
        name = vocabulary_name(vocabulary)
        if loaded is not None and not allow_other:
            check_camera(loaded, settings)
            check_vocabulary(loaded, words, name)
        if loaded is None and initial_T_wc is not None:
            raise SettingsError("initial_pose says where in a loaded map the camera is; load one")
        return cls(
            sensor,
            settings,
            words,
            name,
            loaded,
            _pose_given(initial_T_wc),
            _imu_of_camera(imu, settings),
        )


def _imu_of_camera(imu: ImuSettings | str | Path | None, settings: Settings) -> ImuSettings | None:
    """Take IMU settings, or a file of them, for the camera that is tracked."""
    if imu is None:
        return None
    if not isinstance(imu, ImuSettings):
        imu = read_imu_settings(path_of(imu, "imu", SettingsError))
    rectification = settings.rectification
    if settings.sensor is Sensor.STEREO and rectification is not None:
        return imu.seen_by(rectification.left.R)
    return imu


def _pose_given(T_wc: npt.ArrayLike | None) -> core.Pose | None:
    """``T_cw`` of the pose that a user gave."""
    if T_wc is None:
        return None
    try:
        return core.Pose.from_matrix(pose_of(T_wc, "initial_pose")).inverse()
    except SettingsError as error:
        raise SettingsError(
            "initial_pose must be camera to world, a finite 4x4 matrix with a rotation (no mirror, "
            "no scale) and the last row 0 0 0 1"
        ) from error

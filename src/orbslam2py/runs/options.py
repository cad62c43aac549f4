# SPDX-License-Identifier: BSD-3-Clause
"""Options of a run."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from orbslam2py._arguments import choice_of, is_number, is_whole, shown
from orbslam2py._arrays import FloatArray
from orbslam2py.datasets.base import LiveSource, Sequence
from orbslam2py.errors import DatasetError, SettingsError
from orbslam2py.inertial.samples import ImuSamples
from orbslam2py.maps.map_file import MapFile
from orbslam2py.maps.saved_map import SavedMap
from orbslam2py.runs.feeds import is_sequence
from orbslam2py.settings.imu import ImuSettings
from orbslam2py.settings.sensor import Sensor
from orbslam2py.slam.options import SystemOptions

_SWITCHES = ("realtime", "final_adjustment", "allow_other_setup")
#: Least number of frames of each option that is one.
_LEAST = {"start": 0, "stride": 1, "max_frames": 1, "localize_after": 0}
_MAY_BE_NONE = ("max_frames", "localize_after")
_OPTION_OF = {"localize_after": "--localize"}


@dataclass(frozen=True)
class RunOptions:
    """What to run, and how.

    Raises
    ------
    SettingsError, DatasetError
        If a value is invalid, or options contradict each other.
    """

    sensor: Sensor
    """The sensor."""
    system: SystemOptions = field(default_factory=SystemOptions)
    """Options of the system. Recorded images always wait for mapping, unless `realtime` is set; a
    camera's never do."""
    realtime: bool = False
    """Follow the time stamps and drop late frames, as with a camera; otherwise every frame is
    tracked, as fast as mapping allows."""
    start: int = 0
    """Index of the first frame."""
    stride: int = 1
    """Step between the used frames: 2 uses every second one."""
    max_frames: int | None = None
    """Most frames to use."""
    localize_after: int | None = None
    """Number of frames before localization mode; 0 in a loaded map: from the first frame on."""
    final_adjustment: bool = False
    """Run full bundle adjustment of the finished map (`System.optimize`) before the results are
    written."""
    load_map: SavedMap | MapFile | None = None
    """Begin in this map."""
    initial_pose: FloatArray | None = None
    """Likely pose of the camera in the loaded map, (4, 4) camera to world."""
    allow_other_setup: bool = False
    """Load the map even if it was made with another camera or vocabulary."""
    save_map: Path | None = None
    """Save the maps in this file at the end."""
    autosave: float | None = None
    """Interval at which the maps are also saved during the run, seconds."""
    imu: bool | None = None
    """Whether the samples of an IMU go into the system; None: if the recording has samples and its
    settings are known."""
    imu_settings: ImuSettings | None = None
    """The IMU beside the unrectified (left) camera; by default those of the recording."""
    imu_samples: ImuSamples | None = None
    """Its samples; by default those of the recording."""

    if TYPE_CHECKING:  # text is taken for a sensor, which the type of the field cannot say

        def __init__(
            self,
            sensor: Sensor | str,
            system: SystemOptions = ...,
            realtime: bool = False,
            start: int = 0,
            stride: int = 1,
            max_frames: int | None = None,
            localize_after: int | None = None,
            final_adjustment: bool = False,
            load_map: SavedMap | MapFile | None = None,
            initial_pose: FloatArray | None = None,
            allow_other_setup: bool = False,
            save_map: Path | None = None,
            autosave: float | None = None,
            imu: bool | None = None,
            imu_settings: ImuSettings | None = None,
            imu_samples: ImuSamples | None = None,
        ) -> None: ...

    def __post_init__(self) -> None:
        object.__setattr__(self, "sensor", Sensor(self.sensor))
        if not isinstance(self.system, SystemOptions):
            raise SettingsError(f"system is {shown(self.system)}; give SystemOptions(...)")
        for name in _SWITCHES:
            object.__setattr__(self, name, choice_of(getattr(self, name), name))
        if self.imu is not None:
            object.__setattr__(self, "imu", choice_of(self.imu, "imu"))
        for name, kind in (("imu_settings", ImuSettings), ("imu_samples", ImuSamples)):
            given = getattr(self, name)
            if not (given is None or isinstance(given, kind)):
                raise SettingsError(f"{name} is {shown(given)}; give {kind.__name__}(...)")
        for name, least in _LEAST.items():
            object.__setattr__(self, name, _count_of(getattr(self, name), name, least))
        if self.autosave is not None and not is_number(self.autosave):
            raise SettingsError(f"autosave (--autosave) is {shown(self.autosave)}; give seconds")
        self._check_together()

    def _check_together(self) -> None:
        given = self.imu_settings is not None or self.imu_samples is not None
        if self.imu is False and given:
            raise DatasetError(
                "--no-imu leaves the IMU out, but its settings or samples are given; leave out one "
                "of them (imu, imu_settings, imu_samples)"
            )
        if self.system.deterministic and self.realtime:
            raise DatasetError(
                "--deterministic and --realtime exclude each other: dropping frames depends on "
                "time; leave one of them out"
            )
        if self.localize_after == 0 and self.load_map is None:
            raise DatasetError(
                "--localize needs a map from the beginning: load one with --load (load_map), or "
                "say after how many frames the map is fixed (localize_after)"
            )
        if self.final_adjustment and self.localize_after is not None:
            raise DatasetError(
                "--final-adjustment changes the map, but --localize keeps it unchanged; leave out "
                "one of them (final_adjustment, localize_after)"
            )
        if self.initial_pose is not None and self.load_map is None:
            raise DatasetError(
                "--initial-pose says where in a map the camera is; load one: --load (load_map)"
            )
        if self.allow_other_setup and self.load_map is None:
            raise DatasetError(
                "--allow-other-setup is about a map that is loaded: --load FILE (load_map)"
            )
        if self.autosave is not None and self.save_map is None:
            raise DatasetError("--autosave needs the file to save to: --save FILE (save_map)")
        if self.autosave is not None and not (math.isfinite(self.autosave) and self.autosave > 0):
            raise DatasetError(
                f"--autosave must be more than 0 seconds, got {self.autosave:g} (autosave)"
            )

    def n_frames(self, source: Sequence | LiveSource) -> int | None:
        """Return how many frames a run will process; None for a camera without a limit.

        Raises
        ------
        DatasetError
            If the options do not fit the source.
        """
        if is_sequence(source):
            return len(self.indices(len(source)))
        self.check_for_camera()
        return self.max_frames

    def indices(self, n_frames: int) -> list[int]:
        """Return the indices of the used frames of a sequence.

        Raises
        ------
        DatasetError
            If there are none.
        """
        indices = list(range(self.start, n_frames, self.stride))
        if not indices:
            raise DatasetError(
                f"--start {self.start} is past the end; give less than the number of frames, "
                f"{n_frames}"
            )
        return indices[: self.max_frames]

    def check_for_camera(self) -> None:
        """Check that the options fit a camera.

        Raises
        ------
        DatasetError
            The message names the option that does not.
        """
        if self.system.deterministic or self.realtime:
            name = "--deterministic" if self.system.deterministic else "--realtime"
            raise DatasetError(f"{name} is for recorded images: a camera always goes in real time")
        if self.start != 0 or self.stride != 1:
            name = "--start" if self.start != 0 else "--stride"
            raise DatasetError(f"{name} is for recorded images, not for a camera")


def _count_of(value: Any, name: str, least: int) -> int | None:
    """Convert a number of frames to int: report.json cannot hold NumPy's integers."""
    if value is None and name in _MAY_BE_NONE:
        return None
    option = _OPTION_OF.get(name) or f"--{name.replace('_', '-')}"
    told = f"{name} ({option}) is {shown(value)}; give a whole number of frames, {least} or more"
    if not is_whole(value):
        raise SettingsError(told)
    if value < least:
        raise DatasetError(told)
    return int(value)

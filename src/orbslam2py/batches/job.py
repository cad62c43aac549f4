# SPDX-License-Identifier: BSD-3-Clause
"""One run of a batch."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from orbslam2py.batches.names import key_of, label_of_parts
from orbslam2py.batches.sweep import CONFIG_NAMES
from orbslam2py.runs.options import RunOptions
from orbslam2py.settings import Sensor
from orbslam2py.settings.imu_files import imu_of_settings_file
from orbslam2py.slam.options import SystemOptions

#: Options of a run that a batch may have.
RUN_OPTIONS = ("start", "stride", "max_frames", "realtime", "final_adjustment", "imu")
SYSTEM_OPTIONS = (
    *("deterministic", "loop_closing", "full_adjustment"),
    *("full_adjustment_time_limit", "check_calibration", "several_maps", "new_map_after", "effort"),
)


@dataclass(frozen=True)
class Job:
    """One run of a batch.

    Attributes
    ----------
    path
        The sequence: a folder or a file, an archive, or an address such as ``s3://bucket/desk``.
    name
        Its name in the table.
    sensor
        ``mono``, ``stereo`` or ``rgbd``; None for the richest there are images for.
    settings
        A file or a built-in name; None: the settings of the sequence.
    topics
        Topics of a bag.
    options
        Options of the run that are not default.
    parameters
        Keys of the settings that are swept, and their values in this run.
    seed
        Seed of the run.
    label
        Name of its folder without the seed, if the usual name is also that of other runs; otherwise
        empty.
    """

    path: str
    name: str
    sensor: str | None = None
    settings: str | None = None
    topics: str | None = None
    options: tuple[tuple[str, Any], ...] = ()
    parameters: tuple[tuple[str, float], ...] = ()
    seed: int = 0
    label: str = ""

    @property
    def key(self) -> str:
        """Name of its folder."""
        return key_of(self.setting, self.seed)

    @property
    def setting(self) -> str:
        """What it has in common with the runs of other seeds."""
        return self.label or label_of(self)

    @property
    def fingerprint(self) -> str:
        """Identification of this job among others in the same folder."""
        told = dataclasses.asdict(self)
        del told["label"]  # it says nothing new, and earlier versions had none
        text = json.dumps(told, sort_keys=True, default=str)
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    def run_options(self, sensor: Sensor) -> RunOptions:
        """Return the options of the run.

        Raises
        ------
        SettingsError, DatasetError
            If they are invalid.
        """
        given = dict(self.options)
        system = SystemOptions(
            seed=self.seed,
            config={n: v for n, v in (*self.options, *self.parameters) if n in CONFIG_NAMES},
            **{name: given[name] for name in SYSTEM_OPTIONS if name in given},
        )
        imu = None
        if self.settings is not None and given.get("imu") is not False:
            imu = imu_of_settings_file(Path(self.settings))
        return RunOptions(
            sensor,
            system,
            imu_settings=imu,
            **{name: given[name] for name in RUN_OPTIONS if name in given},
        )


def label_of(job: Job, settings: str | None = None, *, exact: bool = False) -> str:
    """Describe a run without its seed.

    Parameters
    ----------
    job
        The run.
    settings
        Name of its settings; None: the name of their file without its suffix.
    exact
        Write all digits of numbers, not only six.
    """
    parts = (job.name, job.sensor or "", settings or Path(job.settings or "").stem)
    return label_of_parts(parts, (*job.options, *job.parameters), exact=exact)

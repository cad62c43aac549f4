# SPDX-License-Identifier: BSD-3-Clause
"""Settings that are attached to a bag, as ``orbslam2py run --record-input`` does."""

from __future__ import annotations

from orbslam2py.datasets.bags.bag import Bag
from orbslam2py.errors import DatasetError
from orbslam2py.settings import Sensor, Settings
from orbslam2py.settings.sensor import WITHOUT_RIG


def attached_settings(bag: Bag, sensor: Sensor) -> Settings | None:
    """Read the settings that a live run was made with.

    Parameters
    ----------
    bag
        The bag.
    sensor
        What its images are used for.

    Returns
    -------
    Settings or None
        None if none are attached.

    Raises
    ------
    DatasetError
        If they are for rectified images, and those of the sensor are not rectified.
    SettingsError
        If they are wrong.
    """
    for recorded in (sensor, *WITHOUT_RIG):
        name = f"settings.{recorded}.yaml"
        text = bag.attachment(name)
        if text is None:
            continue
        source = f"{name} in {bag.path}"
        if recorded is not sensor and Settings.from_yaml(text, recorded).rectification is not None:
            raise DatasetError(
                f"{source} is for a pair that is rectified, and {sensor} takes raw images; run "
                f"with --sensor {recorded}, or give --settings for the raw camera"
            )
        return Settings.from_yaml(text, sensor, source=source)
    return None

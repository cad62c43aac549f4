# SPDX-License-Identifier: BSD-3-Clause
"""Real sequences with each other's settings: all wrong ones are told, no right one is."""

from __future__ import annotations

from pathlib import Path

import pytest

from orbslam2py import Sensor, Settings, open_sequence
from orbslam2py.runs.calibration_watch import CalibrationWatch
from orbslam2py.settings import BUILTIN_NAMES, Misfit, builtin_settings
from orbslam2py.settings.builtin import builtin_sensors

pytestmark = pytest.mark.shared

SEQUENCES = {
    "7scenes_redkitchen_head250": (Sensor.RGBD, Sensor.MONOCULAR),
    "drone_semicircle": (Sensor.MONOCULAR,),
    "euroc_V1_01_still8": (Sensor.STEREO, Sensor.MONOCULAR),
    "kitti_03_left_head120": (Sensor.MONOCULAR,),
    "kitti_06_head51_stereo": (Sensor.STEREO, Sensor.MONOCULAR),
    "kitti_raw_0926_0001_left": (Sensor.MONOCULAR,),
}

#: Sequences and settings of the same camera.
SAME = {
    ("euroc_V1_01_still8", "euroc"),
    ("kitti_03_left_head120", "kitti03"),
    ("kitti_03_left_head120", "kitti_raw_0926_0001_left"),
    ("kitti_06_head51_stereo", "kitti04-12"),
    ("kitti_raw_0926_0001_left", "kitti03"),
    ("kitti_raw_0926_0001_left", "kitti_03_left_head120"),
}

PAIRS = [(name, sensor) for name, sensors in SEQUENCES.items() for sensor in sensors]


def candidates(folder: Path, sensor: Sensor) -> dict[str, Settings]:
    built = {n: builtin_settings(n, sensor) for n in BUILTIN_NAMES if sensor in builtin_sensors(n)}
    others = {
        name: open_sequence(folder / name, sensor).settings
        for name, sensors in SEQUENCES.items()
        if sensor in sensors
    }
    return built | others


def told(sequence: object, settings: Settings, n: int, *, known: Settings | None) -> Misfit | None:
    watch = CalibrationWatch(settings, settings.sensor, known=known)
    for index in range(n):
        watch.look(sequence.load(index))  # type: ignore[attr-defined]
    return watch.finish()


@pytest.mark.parametrize(("name", "sensor"), PAIRS)
def test_settings_of_others_are_told_at_the_first_image(
    shared_data: Path, name: str, sensor: Sensor
) -> None:
    folder = shared_data / "sequences"
    sequence = open_sequence(folder / name, sensor)
    for other, settings in candidates(folder, sensor).items():
        misfit = told(sequence, settings, 1, known=sequence.settings)
        right = other == name or (name, other) in SAME
        assert (misfit is None) == right, f"{name} with settings of {other}: {misfit}"


@pytest.mark.parametrize(("name", "sensor"), PAIRS)
def test_other_data_sets_are_told_by_the_size_alone(
    shared_data: Path, name: str, sensor: Sensor
) -> None:
    """As for images in a folder of one's own, beside which no calibration lies."""
    sequence = open_sequence(shared_data / "sequences" / name, sensor)
    height, width = sequence.load(0).image.shape[:2]
    for other in ("tum1", "kitti00-02", "kitti03", "kitti04-12", "euroc"):
        if sensor not in builtin_sensors(other):
            continue
        fits = (other == "tum1" and width == 640) or (name, other) in SAME
        misfit = told(sequence, builtin_settings(other, sensor), 1, known=None)
        assert (misfit is None) == fits, f"{name} ({width} x {height}), {other}: {misfit}"


def test_a_turning_camera_tells_its_own_focal_length(shared_data: Path) -> None:
    """Nothing lies beside these images but a depth image each."""
    sequence = open_sequence(shared_data / "sequences" / "7scenes_redkitchen_head250", "rgbd")
    right = sequence.settings
    assert told(sequence, right, 49, known=None) is None
    camera = right.camera
    for factor in (0.6, 1.7):
        changed = Settings(
            right.sensor,
            type(camera)(factor * camera.fx, factor * camera.fy, camera.cx, camera.cy, bf=40.0),
            depth=right.depth,
        )
        misfit = told(sequence, changed, 49, known=None)
        assert misfit is not None
        assert "focal length" in misfit.cause

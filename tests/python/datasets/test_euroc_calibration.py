# SPDX-License-Identifier: BSD-3-Clause
"""Focal lengths of EuRoC's ``sensor.yaml`` that no camera has."""

from __future__ import annotations

from pathlib import Path

import pytest

from orbslam2py import DatasetError, Sensor, open_sequence
from support.small_folders import write_euroc


@pytest.mark.parametrize("sensor", [Sensor.STEREO, Sensor.MONOCULAR])
@pytest.mark.parametrize(
    ("given", "told"),
    [
        ("[-40.0, 41.0, 32.0, 24.0]", "-40, 41"),
        ("[40.0, 0.0, 32.0, 24.0]", "40, 0"),
        ("[40.0, 1e6, 32.0, 24.0]", "40, 1e+06"),
    ],
)
def test_the_file_and_the_key_are_named(
    tmp_path: Path, sensor: Sensor, given: str, told: str
) -> None:
    folder = write_euroc(tmp_path / "euroc")
    for camera in ("cam0", "cam1")[: 1 + (sensor is Sensor.STEREO)]:
        path = folder / "mav0" / camera / "sensor.yaml"
        right = path.read_text()
        path.write_text(right.replace("[40.0, 41.0, 32.0, 24.0]", given))
        line = right.splitlines().index("intrinsics: [40.0, 41.0, 32.0, 24.0] #fu, fv, cu, cv") + 1
        with pytest.raises(DatasetError) as refused:
            _ = open_sequence(folder, sensor).settings
        assert str(refused.value) == (
            f"{path}:{line}: intrinsics has the focal lengths {told} (fx, fy); give numbers "
            "greater than 0 and at most 100000 pixels"
        )
        path.write_text(right)
    assert open_sequence(folder, sensor).settings.camera.fx > 0


def test_two_cameras_in_one_place(tmp_path: Path) -> None:
    """OpenCV ends with an error of its own for these."""
    folder = write_euroc(tmp_path / "euroc")
    left, right = (folder / "mav0" / camera / "sensor.yaml" for camera in ("cam0", "cam1"))
    right.write_text(left.read_text())
    with pytest.raises(DatasetError) as refused:
        _ = open_sequence(folder, Sensor.STEREO).settings
    assert str(refused.value) == (
        f"{left}: the two cameras of the pair have the same position, so they measure no depth; "
        "check where their calibration puts them, or use one of them (--sensor mono)"
    )

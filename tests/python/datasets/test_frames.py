# SPDX-License-Identifier: BSD-3-Clause
"""Sequences in a loop, and names as text wherever a kind is wanted."""

from __future__ import annotations

from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orbslam2py import DatasetError, ImageError, Sensor, Settings, SettingsError
from orbslam2py.datasets import (
    Frame,
    ImageFolder,
    Layout,
    MaskedSequence,
    VideoSequence,
    open_input,
    open_sequence,
)
from orbslam2py.settings import CameraSettings, DepthSettings, builtin_settings, resolve_settings
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from support.numbered_images import mask_image, number_of
from support.small_folders import save


def test_recorded_sequence_in_a_loop(tum: Path) -> None:
    sequence = open_sequence(tum, "rgbd")
    frames = list(sequence)
    assert [frame.index for frame in frames] == [0, 1, 2]
    assert [frame.text for frame in frames] == ["100.000000", "100.100000", "100.300000"]
    np.testing.assert_array_equal([frame.timestamp for frame in frames], sequence.timestamps)
    assert isinstance(frames[0].timestamp, float)
    for frame in frames:
        np.testing.assert_array_equal(frame.images.image, sequence.load(frame.index).image)
        assert frame.images.depth is not None
    assert len(list(sequence)) == 3, "a second loop begins anew"


@pytest.fixture
def every_kind(
    tum: Path, kitti: Path, euroc: Path, folder: Path, video: Path, tmp_path: Path
) -> list[Any]:
    """A sequence of each kind, the folder of images last."""
    save(tmp_path / "mask.png", mask_image())
    images = ImageFolder(folder, settings="tum1")
    options = SyntheticOptions(world="room", sensor="mono", frames=3, size=(64, 64))
    return [
        *(open_sequence(tum), open_sequence(kitti), open_sequence(euroc)),
        *(VideoSequence(video, settings="tum1"), MaskedSequence(images, tmp_path / "mask.png")),
        *(SyntheticSequence(options), images),
    ]


def test_every_sequence_can_be_looped_over(every_kind: list[Any]) -> None:
    for sequence in every_kind:
        first, second = islice(sequence, 2)
        assert isinstance(first, Frame)
        assert (first.index, second.index) == (0, 1)
        assert first.timestamp < second.timestamp
    images = every_kind[-1]
    assert [number_of(frame.images.image[..., ::-1]) for frame in images] == list(range(1, 13))


def test_frames_that_there_are_not(every_kind: list[Any]) -> None:
    for sequence in every_kind:
        n = len(sequence)
        for call in (sequence.load, sequence.timestamp_text):
            for wrong in ("x", None, 1.0, np.zeros(3), [0], True):
                with pytest.raises(
                    DatasetError, match=r"the index of the frame is .*; give a whole"
                ):
                    call(wrong)
            for outside in (-1, n):
                message = f"there is no frame {outside} among {n}; give a whole number from 0 to"
                with pytest.raises(IndexError, match=message):
                    call(outside)
            call(np.int64(n - 1))


def test_a_bad_image_ends_the_loop(kitti: Path) -> None:
    (kitti / "image_0" / "000001.png").write_text("no image")
    frames = iter(open_sequence(kitti))
    next(frames)
    with pytest.raises(ImageError, match=r"000001\.png"):
        next(frames)


# ---- names as text -------------------------------------------------------------------------------
@pytest.mark.parametrize("name", ["mono", "MONO", "monocular", "Monocular"])
def test_sensors_as_text(tum: Path, kitti: Path, euroc: Path, folder: Path, name: str) -> None:
    for path in (tum, kitti, euroc):
        assert open_sequence(path, name).sensor is Sensor.MONOCULAR
    assert open_input(folder, name, settings="tum1").sensor is Sensor.MONOCULAR
    assert builtin_settings("tum1", name).sensor is Sensor.MONOCULAR
    assert Settings.load("tum1", name) == builtin_settings("tum1", Sensor.MONOCULAR)
    resolve_settings(builtin_settings("tum1", name), name).check_for(name)


def test_settings_made_with_text_as_sensor() -> None:
    camera = CameraSettings(fx=500, fy=500, cx=320, cy=240, fps=30, bf=40)
    settings = Settings(sensor="RGB-D", camera=camera, depth=DepthSettings(40, 1000))  # type: ignore[arg-type]
    assert settings.sensor is Sensor.RGBD
    with pytest.raises(SettingsError, match="these settings are for rgbd, not for mono"):
        settings.check_for("mono")
    with pytest.raises(SettingsError, match="ThDepth"):
        Settings(sensor="stereo", camera=camera)  # type: ignore[arg-type]


def test_settings_for_another_sensor_than_asked_for(tum: Path) -> None:
    mono = builtin_settings("tum1", "mono")
    with pytest.raises(SettingsError, match="these settings are for mono, not for rgbd"):
        open_sequence(tum, "rgbd", settings=mono)
    assert open_sequence(tum, "rgbd", settings="tum1").settings.sensor is Sensor.RGBD


def test_names_that_are_none(tum: Path, kitti: Path) -> None:
    for path in (tum, kitti):
        with pytest.raises(
            SettingsError, match="the sensor is 'lidar'; give one of mono, stereo, rgbd"
        ):
            open_sequence(path, "lidar")
    with pytest.raises(DatasetError, match="no layout 'rosbag'; there are: tum, kitti, euroc"):
        open_sequence(tum, layout="rosbag")
    assert open_sequence(tum, layout="tum").layout is Layout.TUM

# SPDX-License-Identifier: BSD-3-Clause
"""How the runner feeds the system from cameras and with masks."""

from __future__ import annotations

import threading
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from orbslam2py import DatasetError, Sensor
from orbslam2py.datasets import Images
from orbslam2py.runs import RunOptions, SequenceRunner, SystemOptions
from orbslam2py.runs.report import make_report
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from support.cameras import Camera

pytestmark = pytest.mark.watchdog(60)


def recorded(sensor: Sensor) -> SyntheticSequence:
    return SyntheticSequence(SyntheticOptions(sensor=sensor, world="room", frames=6))


def test_camera_runs_until_stopped() -> None:
    camera, stop = Camera(recorded(Sensor.RGBD)), threading.Event()
    runner = SequenceRunner(camera, camera.settings, None, RunOptions(Sensor.RGBD))
    assert runner.result.n_frames is None
    result = runner.run(lambda row, _: stop.set() if row.index == 2 else None, stop)
    assert [row.index for row in result.rows] == [0, 1, 2]
    assert (result.n_frames, result.n_tracked, result.n_dropped) == (3, 3, 3)
    assert not result.interrupted
    assert result.error is None
    assert not camera.is_open
    assert len(result.tracked_trajectory()) == 3
    report = make_report(result, None)
    assert (report["frames"], report["tracked_fraction"], report["dropped_frames"]) == (3, 1.0, 3)


def test_camera_runs_for_so_many_frames() -> None:
    camera = Camera(recorded(Sensor.STEREO))
    result = SequenceRunner(
        camera, camera.settings, None, RunOptions(Sensor.STEREO, max_frames=2)
    ).run()
    assert (len(result.rows), result.interrupted) == (2, False)


def test_camera_that_fails_keeps_what_was_done() -> None:
    camera = Camera(recorded(Sensor.RGBD), fails=True)
    result = SequenceRunner(camera, camera.settings, None, RunOptions(Sensor.RGBD)).run()
    assert str(result.error) == "unplugged"
    assert result.n_tracked == 4
    assert not camera.is_open


@pytest.mark.parametrize(
    "options",
    [
        {"system": SystemOptions(deterministic=True)},
        {"realtime": True},
        {"start": 1},
        {"stride": 2},
    ],
    ids=lambda options: next(iter(options)),
)
def test_options_for_recordings_only(options: dict[str, Any]) -> None:
    camera = Camera(recorded(Sensor.RGBD))
    name = next(iter(options)).replace("system", "deterministic")
    with pytest.raises(DatasetError, match=f"--{name} is for recorded images"):
        SequenceRunner(camera, camera.settings, None, RunOptions(Sensor.RGBD, **options))


class Halved(SyntheticSequence):
    """Hides the left half of every image."""

    def load(self, index: int, /) -> Images:
        images = super().load(index)
        mask = np.full(images.image.shape[:2], 255, np.uint8)
        mask[:, : mask.shape[1] // 2] = 0
        return replace(images, mask=mask)


@pytest.mark.parametrize("sensor", [Sensor.STEREO, Sensor.RGBD])
def test_masks_reach_the_map(sensor: Sensor) -> None:
    options = SyntheticOptions(sensor=sensor, world="room", frames=1)
    shares = []
    for kind in (SyntheticSequence, Halved):
        sequence = kind(options)
        result = SequenceRunner(sequence, sequence.settings, None, RunOptions(sensor)).run()
        T_cw = np.linalg.inv(result.snapshot.keyframe_T_wc[0])
        points = result.snapshot.point_positions @ T_cw[:3, :3].T + T_cw[:3, 3]
        camera = sequence.settings.camera
        u = camera.fx * points[:, 0] / points[:, 2] + camera.cx
        assert len(u) > 100
        shares.append(float((u < camera.cx - 5).mean()))
    assert shares[0] > 0.2
    assert shares[1] < 0.02


@pytest.mark.parametrize("deterministic", [True, False])
@pytest.mark.parametrize("sensor", [Sensor.STEREO, Sensor.RGBD])
def test_run_that_switches(sensor: Sensor, deterministic: bool) -> None:
    options = SyntheticOptions(world="corridor", sensor=sensor, frames=50, size=(320, 240))
    sequence = SyntheticSequence(options)
    hashes: list[int] = []
    result = SequenceRunner(
        sequence,
        sequence.settings,
        None,
        RunOptions(sensor, SystemOptions(deterministic=deterministic), localize_after=25),
    ).run(lambda row, system: hashes.append(system.map_hash()))
    assert result.error is None
    assert result.n_tracked == 50
    assert len(set(hashes[25:])) == 1
    assert len(set(hashes[:25])) > 1
    assert max(result.keyframes.timestamps) < sequence.timestamps[25]


def test_report_says_how_well_patches_agree() -> None:
    sequence = SyntheticSequence(SyntheticOptions(sensor="rgbd", world="corridor", frames=30))
    options = SystemOptions(deterministic=True, effort="light")
    result = SequenceRunner(
        sequence, sequence.settings, None, RunOptions(Sensor.RGBD, system=options)
    ).run()
    found = make_report(result, None)["alignment"]
    assert found is not None
    assert 0 < found["noise_px"] < 0.5
    assert found["frames_without_features"] > 15
    pair = recorded(Sensor.STEREO)
    plain = SequenceRunner(pair, pair.settings, None, RunOptions(Sensor.STEREO)).run()
    assert make_report(plain, None)["alignment"] is None

# SPDX-License-Identifier: BSD-3-Clause
"""Images of a camera for the page of its run: few, evenly spread, also over a long run."""

from __future__ import annotations

import zipfile
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from orbslam2py import Sensor, TrackingState, run_sequence
from orbslam2py.runs import RunOptions
from orbslam2py.runs.kept_images import WIDTH, KeptImages, shrink
from orbslam2py.slam.records import Reason, TrackingRecord
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from support.cameras import Camera

pytestmark = [pytest.mark.watchdog(60), pytest.mark.page]

SEQUENCE = SyntheticSequence(SyntheticOptions(sensor=Sensor.RGBD, world="room", frames=6))
KEYFRAME = TrackingRecord(
    frame_id=0,
    timestamp=0.0,
    map_index=0,
    state=TrackingState.OK,
    reason=Reason.NONE,
    T_cw=np.eye(4),
    covariance=None,
    n_matches=100,
    n_inliers=100,
    is_keyframe=True,
    reference_keyframe=0,
)
LOST = replace(KEYFRAME, state=TrackingState.LOST, T_cw=None, is_keyframe=False)


def grey(level: int) -> np.ndarray:
    return np.full((60, 80), level, np.uint8)


def test_a_long_run_keeps_few_of_its_keyframes_evenly() -> None:
    kept = KeptImages(SEQUENCE.settings)
    for position in range(1000):
        kept.look(position, grey(position % 200), KEYFRAME)
    positions = kept.positions
    assert 30 <= len(positions) <= 65
    assert np.ptp(np.diff(positions)) == 0
    assert positions[0] == 0
    assert positions[-1] > 950
    found = kept.find(positions[3])
    assert found is not None
    assert abs(int(found.picture.mean()) - positions[3] % 200) <= 2
    assert kept.find(1) is None


def test_the_first_image_of_a_loss_is_kept_and_other_frames_are_not() -> None:
    kept = KeptImages(SEQUENCE.settings)
    tracked = replace(KEYFRAME, is_keyframe=False)
    for position, record in enumerate([KEYFRAME, tracked, LOST, LOST, tracked, LOST]):
        kept.look(position, grey(100), record)
    assert kept.positions == [0, 2, 5]


@pytest.mark.parametrize("rgb", [True, False])
def test_small_images_have_the_colours_that_files_want(rgb: bool) -> None:
    image = np.zeros((500, 1000, 4), np.uint8)
    image[..., 0 if rgb else 2] = 250  # red
    small = shrink(image, rgb=rgb)
    assert small.picture.shape == (round(500 * WIDTH / 1000), WIDTH, 3)
    assert small.picture[0, 0].tolist() == [0, 0, 250]
    assert small.scale == WIDTH / 1000


def test_the_page_of_a_camera_has_images_of_keyframes(tmp_path: Path) -> None:
    camera = Camera(SEQUENCE)
    options = RunOptions(Sensor.RGBD, max_frames=4)
    done = run_sequence(camera, options, output=tmp_path / "run")
    keyframes = done.result.keyframes.indices.tolist()
    assert keyframes
    with zipfile.ZipFile(tmp_path / "run" / "frame_images.zip") as archive:
        names = archive.namelist()
        first = cv2.imdecode(np.frombuffer(archive.read(names[0]), np.uint8), cv2.IMREAD_COLOR)
    assert {int(Path(name).stem) for name in names} >= set(keyframes)
    assert first is not None
    shown = shrink(SEQUENCE.load(0).image, rgb=SEQUENCE.settings.camera.rgb).picture
    off = np.abs(first.astype(int) - shown).max(axis=2)
    assert first.shape == shown.shape
    assert np.median(off) < 12  # the same image
    assert (off > 100).any()  # with points in it
    page = (tmp_path / "run" / "report.html").read_text()
    assert page.count('id="image-') == len(names)

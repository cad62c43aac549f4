# SPDX-License-Identifier: BSD-3-Clause
"""Recorded sequences that ``benchmarks.holding_on`` makes harder: what is told of them is true."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

import cv2
import numpy as np
import pytest
from benchmarks.holding_on import recorded
from benchmarks.holding_on.judgement import consecutive, judge
from benchmarks.holding_on.made_up import MadeUpScene
from benchmarks.holding_on.play import play
from benchmarks.holding_on.recorded import CHANGES, RecordedCase, Recording, recorded_cases
from benchmarks.holding_on.scene import Scene

from orbslam2py.settings import Sensor
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence

N = 36
OPTIONS = SyntheticOptions(
    world="corridor", sensor="rgbd", frames=N, size=(320, 240), noise=1.0, motion="stairs"
)


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Recording]:
    folder = tmp_path_factory.mktemp("shared")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ORBSLAM2PY_SHARED", str(folder))
        recorded._opened.cache_clear()
        SyntheticSequence(OPTIONS).write(folder / "data" / "sequences" / "lap")
        yield Recording("lap", ("rgbd", "mono"), 0.5, truth_jumps=(20,))
        recorded._opened.cache_clear()


def scene_of(recording: Recording, change: str, sensor: str = "rgbd", seed: int = 0) -> Scene:
    return RecordedCase(recording, change, sensor, 500, seed).scene()


@pytest.mark.parametrize("change", [change.name for change in CHANGES])
def test_each_is_a_sequence_with_its_truth(recording: Recording, change: str) -> None:
    scene = scene_of(recording, change)
    assert 0.2 * N < len(scene) <= N
    assert (np.diff(scene.timestamps) > 0).all()
    assert scene.settings.orb.n_features == 500
    assert np.isfinite(scene.truth).all()
    images = scene.load(len(scene) - 1)
    assert images.depth is not None
    assert images.depth.shape == images.image.shape[:2]
    again = scene_of(recording, change).load(len(scene) - 1)
    np.testing.assert_array_equal(images.image, again.image)


def test_which_images_are_shown(recording: Recording) -> None:
    whole = scene_of(recording, "as it is")
    third = scene_of(recording, "every third")
    assert len(third) == N // 3
    assert third.fps == pytest.approx(whole.fps / 3, rel=0.01)
    np.testing.assert_array_equal(third.load(4).image, whole.load(12).image)
    np.testing.assert_array_equal(third.truth[4], whole.truth[12])
    backwards = scene_of(recording, "backwards")
    np.testing.assert_array_equal(backwards.load(1).image, whole.load(N - 2).image)
    np.testing.assert_array_equal(backwards.truth[1], whole.truth[N - 2])
    dropped = [scene_of(recording, "three in ten dropped", seed=seed) for seed in range(20)]
    assert np.mean([len(scene) for scene in dropped]) == pytest.approx(0.7 * N, rel=0.1)
    assert len({len(scene) for scene in dropped}) > 1


def test_a_rolled_camera_sees_points_where_its_pose_says(recording: Recording) -> None:
    """Of a point in a recorded image the rolled one has the depth, where it is projected to."""
    whole, rolled = scene_of(recording, "as it is"), scene_of(recording, "rolled")
    camera = whole.settings.camera
    index = int(np.argmax(np.abs(np.sin(2 * np.pi * rolled.timestamps / 3.0))))
    depth, shown = whole.load(index).depth, rolled.load(index).depth
    assert depth is not None
    assert shown is not None
    y, x = np.mgrid[40:200:8, 60:260:8].reshape(2, -1)
    z = depth[y, x] / whole.settings.depth_factor
    rays = np.stack([(x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy, np.ones(len(x))], 1)
    T_wc = whole.truth[index]
    points = rays * z[:, None] @ T_wc[:3, :3].T + T_wc[:3, 3]
    pixels = rolled.settings.camera.project(points, np.linalg.inv(rolled.truth[index]))
    inside = ((pixels >= 0) & (pixels <= np.array(shown.shape[::-1]) - 1)).all(axis=1) & (z > 0)
    u, v = np.rint(pixels[inside]).astype(int).T
    assert inside.sum() > 100
    found = shown[v, u] / whole.settings.depth_factor
    assert np.median(np.abs(found - z[inside])) < 0.01
    turned = np.linalg.inv(whole.truth[index]) @ rolled.truth[index]
    assert np.linalg.norm(cv2.Rodrigues(turned[:3, :3])[0]) > np.radians(9)


def test_a_rolled_image_is_full(recording: Recording) -> None:
    rolled = scene_of(recording, "rolled")
    for index in range(0, N, 5):
        image = rolled.load(index).image
        assert (image.shape[1], image.shape[0]) == (
            rolled.settings.camera.width,
            rolled.settings.camera.height,
        )
        assert image.min() > 0


def test_some_images_are_dark_and_some_blurred(recording: Recording) -> None:
    whole = scene_of(recording, "as it is")

    def compared(change: str, figure) -> np.ndarray:
        scene = scene_of(recording, change)
        return np.array(
            [figure(scene.load(i).image) / figure(whole.load(i).image) for i in range(N)]
        )

    brightness = compared("darkened", np.mean)
    assert brightness[20:30] == pytest.approx(0.3, abs=0.01)
    assert brightness[:20] == pytest.approx(1)
    detail = compared("blurred", lambda image: cv2.Laplacian(image, cv2.CV_64F).std())
    smeared = np.arange(N) // 4 % 3 == 2
    assert (detail[smeared] < 0.7).all()
    assert detail[~smeared] == pytest.approx(1)


@pytest.mark.parametrize(("first", "second"), [(0, 6), (3, 12), (12, 3)])
def test_parallax_by_flow_is_that_of_the_world(
    recording: Recording, first: int, second: int
) -> None:
    by_flow = scene_of(recording, "as it is", "mono").parallax(first, second)
    true = MadeUpScene(OPTIONS, 500).parallax(first, second)
    assert np.degrees(true) > 1
    assert by_flow == pytest.approx(true, rel=0.35), np.degrees([by_flow, true])


def test_views_without_common_points_have_no_parallax(
    recording: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    empty = np.full((240, 320), 9, np.uint8)
    monkeypatch.setattr(recorded.RecordedScene, "_grey", lambda self, place: empty)
    assert scene_of(recording, "as it is", "mono").parallax(0, 5) == 0.0


def test_nothing_is_compared_across_a_jump_of_the_truth(recording: Recording) -> None:
    played = play(RecordedCase(recording, "as it is", "rgbd", 500, 0))
    frames = consecutive(played)
    assert 19 in frames
    assert 20 not in frames
    figures = judge(played)
    assert (figures.tracked, figures.wrong) == (N, 0)
    assert figures.path_compared == N - 2
    backwards = play(RecordedCase(recording, "backwards", "rgbd", 500, 0))
    assert N - 20 not in consecutive(backwards)


def test_errors_are_no_larger_than_those_of_the_truth(recording: Recording) -> None:
    exact = play(RecordedCase(recording, "as it is", "rgbd", 500, 0))
    vague = Recording("lap", ("rgbd",), 0.5, truth_deviation=(3.0, 0.2))
    figures = judge(play(RecordedCase(vague, "as it is", "rgbd", 500, 0)))
    assert figures.rotation_spread < 0.1 * judge(exact).rotation_spread
    assert figures.translation_spread < 0.1 * judge(exact).translation_spread


def test_without_truth_only_what_is_tracked_counts(recording: Recording) -> None:
    blind = Recording(recording.name, recording.sensors, recording.near, has_truth=False)
    figures = judge(play(RecordedCase(blind, "as it is", "mono", 500, 0)))
    assert figures.tracked == figures.trackable > 0.5 * N
    assert (figures.compared, figures.path_compared, figures.wrong_starts) == (0, 0, 0)
    assert np.isnan(figures.ate)
    assert figures.enough_parallax > 0


def test_every_round_plays_all_that_is_recorded(
    recording: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorded, "RECORDINGS", [recording])
    cases = list(islice(recorded_cases(["rgbd", "mono"]), 4 * len(CHANGES)))
    assert len({case.key for case in cases}) == len(cases)
    own = recorded._opened(recording.name, Sensor.RGBD).settings.orb.n_features
    assert {case.features for case in cases[: 2 * len(CHANGES)]} == {own}
    assert {case.seed for case in cases[2 * len(CHANGES) :]} == {1}

# SPDX-License-Identifier: BSD-3-Clause
"""A single camera: when its map begins, why not yet, and what hard sequences do to it."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
import pytest

from orbslam2py import Reason, System, TrackingRecord, TrackingState, Trajectory
from orbslam2py.evaluation import Alignment, evaluate_trajectory
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from orbslam2py.trajectory import write_tum

pytestmark = pytest.mark.watchdog(60)

OPTIONS = SyntheticOptions(world="corridor", sensor="mono", size=(320, 240), noise=1)
SEQUENCE = SyntheticSequence(OPTIONS)
BLACK = np.zeros((240, 320), np.uint8)
WHITE = np.full((240, 320), 255, np.uint8)


#: What may be said of two views between which nothing can be reconstructed.
UNFIT = {
    Reason.FIRST_VIEW,
    Reason.FEW_MATCHES_FIRST_VIEW,
    Reason.LOW_PARALLAX,
    Reason.AMBIGUOUS_MOTION,
    Reason.DEGENERATE_VIEWS,
    Reason.NO_THIRD_VIEW,
}


@lru_cache
def image(index: int) -> np.ndarray:
    return SEQUENCE.load(index).image


class Camera:
    """A system, and the truth of what it was shown."""

    def __init__(self) -> None:
        self.system = System(SEQUENCE.settings, "mono", deterministic=True)
        self._n_shown = 0
        self._truth: dict[float, np.ndarray] = {}

    def show(self, shown: np.ndarray, T_wc: np.ndarray | None = None) -> TrackingRecord:
        seconds = self._n_shown / 20
        self._n_shown += 1
        if T_wc is not None:
            self._truth[seconds] = T_wc
        return self.system.track_monocular(shown, seconds)

    def play(self, indices: Iterable[int]) -> list[TrackingRecord]:
        return [self.show(image(i), SEQUENCE.T_wc(i)) for i in indices]

    def ate(self) -> float:
        """Of the present map's frames [m], aligned by Sim(3)."""
        times = np.array(sorted(self._truth))
        truth = Trajectory(times, np.array([self._truth[t] for t in times]))
        estimate = self.system.trajectory()
        figures = evaluate_trajectory(estimate.select(~estimate.lost), truth, Alignment.SIM3)
        assert figures.ate is not None
        return figures.ate.rmse


def n_ok(records: Iterable[TrackingRecord]) -> int:
    return sum(r.state is TrackingState.OK for r in records)


# ---- the usual case ------------------------------------------------------------------------------
def test_a_map_begins_and_is_right() -> None:
    camera = Camera()
    records = camera.play(range(80))
    first = next(i for i, r in enumerate(records) if r.state is TrackingState.OK)
    assert 1 <= first < 15
    assert records[0].reason is Reason.FIRST_VIEW
    for record in records[:first]:
        assert record.state is TrackingState.NOT_INITIALIZED
        assert record.reason in UNFIT
        assert record.T_cw is None
    assert n_ok(records) == 80 - first
    assert records[first].is_keyframe
    assert camera.system.n_resets == 0
    assert camera.system.check_map() == []
    assert camera.ate() < 0.02


def test_unit_of_length_is_the_median_depth_of_the_first_view() -> None:
    camera = Camera()
    i = 0
    while camera.play([i])[0].state is not TrackingState.OK:
        i += 1
    snapshot = camera.system.map_snapshot()
    T_cw = np.linalg.inv(snapshot.keyframe_T_wc[0])
    depths = snapshot.point_positions @ T_cw[2, :3] + T_cw[2, 3]
    np.testing.assert_array_equal(snapshot.keyframe_T_wc[0], np.eye(4))
    assert 0.8 < np.median(depths) < 1.2


def test_deterministic_runs_are_equal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also with one thread more: the start compares motions, and mapping adjusts, in two."""
    monkeypatch.setattr("orbslam2py._cores.n_cores", lambda: 2)
    results = []
    for name, threads in (("a", "1"), ("b", "2")):
        monkeypatch.setenv("OMP_NUM_THREADS", threads)
        camera = Camera()
        camera.play(range(40))
        write_tum(tmp_path / name, camera.system.trajectory())
        results.append((camera.system.map_hash(), (tmp_path / name).read_bytes()))
    assert results[0] == results[1]
    assert results[0][1].count(b"\n") > 20


def test_mask_keeps_points_out() -> None:
    mask = np.full((240, 320), 255, np.uint8)
    mask[:, :160] = 0
    system = System(SEQUENCE.settings, "mono", deterministic=True)
    for i in range(40):
        record = system.track_monocular(image(i), i / 20, mask=mask, details=True)
        assert record.features is not None
        assert (record.features.keypoints[:, 0] > 155).all()


# ---- nothing to begin a map from -----------------------------------------------------------------
def test_a_still_camera_begins_no_map() -> None:
    camera = Camera()
    rng = np.random.default_rng(0)
    for _ in range(25):
        noisy = image(5) + rng.normal(0, 2, BLACK.shape)
        record = camera.show(np.clip(noisy, 0, 255).astype(np.uint8))
        assert record.state is TrackingState.NOT_INITIALIZED
        assert record.reason in UNFIT
    assert camera.system.n_keyframes == 0
    assert n_ok(camera.play(range(5, 45))) > 20, "it begins when the camera moves"
    assert camera.ate() < 0.02


@pytest.mark.parametrize("degrees", [0.3, 1.0, 3.0])
def test_pure_rotation_begins_no_map(degrees: float) -> None:
    camera = Camera()
    for k in range(30):
        angle, turned = np.radians(degrees * k), SEQUENCE.T_wc(5)
        turn = np.array(
            [[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]
        )
        turned[:3, :3] = turned[:3, :3] @ turn
        record = camera.show(SEQUENCE.view(turned, k).image)
        assert record.state is TrackingState.NOT_INITIALIZED
        assert record.reason in UNFIT
    assert camera.system.n_keyframes == 0
    camera.show(BLACK)  # the first view is dropped
    assert n_ok(camera.play(range(40))) > 20
    assert camera.ate() < 0.02


@pytest.mark.parametrize("spoilt", [BLACK, WHITE], ids=["black", "white"])
def test_nothing_to_see(spoilt: np.ndarray) -> None:
    camera = Camera()
    camera.play(range(2))
    for _ in range(5):
        record = camera.show(spoilt)
        assert record.state is TrackingState.NOT_INITIALIZED
        assert record.reason is Reason.TOO_FEW_KEYPOINTS
    assert n_ok(camera.play(range(2, 40))) > 20


# ---- hard stretches ------------------------------------------------------------------------------
def blurred(index: int) -> np.ndarray:
    return cv2.GaussianBlur(image(index), (0, 0), 12)


@pytest.mark.parametrize("kind", ["black", "white", "blurred"])
def test_hard_stretch(kind: str) -> None:
    camera = Camera()
    camera.play(range(60))
    assert camera.system.n_keyframes > 5
    for i in range(60, 66):
        shown = {"black": BLACK, "white": WHITE, "blurred": blurred(i)}[kind]
        record = camera.show(shown, SEQUENCE.T_wc(i))
        assert record.state is TrackingState.LOST
        assert record.reason is not Reason.NONE
        assert record.T_cw is None
    after = camera.play(range(66, 80))
    assert n_ok(after) >= len(after) - 3
    assert after[-1].map_index == 0
    assert camera.system.n_relocalizations == 1
    assert camera.ate() < 0.03
    assert camera.system.check_map() == []


def test_cut_to_another_place_and_back() -> None:
    camera = Camera()
    camera.play(range(60))
    before = camera.system.n_keyframes
    elsewhere = camera.play(range(400, 410))
    assert n_ok(elsewhere) == 0
    assert elsewhere[0].reason is not Reason.NONE
    assert all(r.reason is Reason.NOT_FOUND_IN_MAP for r in elsewhere[1:])
    assert camera.system.n_keyframes == before
    back = camera.play(range(40, 60))
    assert n_ok(back) >= 18
    assert camera.ate() < 0.03


def test_cut_soon_after_the_beginning_starts_a_new_map() -> None:
    camera = Camera()
    i = 0
    while camera.play([i])[0].state is not TrackingState.OK:
        i += 1
    assert camera.play([400])[0].state is TrackingState.LOST
    camera.show(BLACK)
    records = camera.play(range(120, 150))
    assert camera.system.n_resets >= 1
    assert records[-1].state is TrackingState.OK
    assert records[-1].map_index == camera.system.n_resets
    assert camera.ate() < 0.03
    assert len(camera.system.trajectories()) == camera.system.n_resets + 1


@pytest.mark.parametrize(("gap", "error"), [(3, 0.1), (7, 0.15)])  # of 6 and 15 m
def test_sequence_with_gaps(gap: int, error: float) -> None:
    camera = Camera()
    records = camera.play(range(0, 60 * gap, gap))
    for record in records:
        assert (record.T_cw is not None) == (record.state is TrackingState.OK)
        assert (record.reason is Reason.NONE) == (record.state is TrackingState.OK)
    assert camera.system.check_map() == []
    if len(camera.system.trajectory()) > 5:
        assert camera.ate() < error
    if gap == 3:
        assert n_ok(records) > 40


def test_a_hole_in_the_sequence() -> None:
    camera = Camera()
    camera.play(range(60))
    after = camera.play(range(72, 90))
    assert n_ok(after) > 10
    assert camera.ate() < 0.03

# SPDX-License-Identifier: BSD-3-Clause
"""Maps whose sightings are aligned to each other in the images."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest

from orbslam2py import DatasetError, ImageError, MapFileError, System, optimize_map
from orbslam2py._arrays import FloatArray
from orbslam2py.maps import MapContents, align_sightings, reprojection_errors
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from orbslam2py.trajectory import Trajectory
from support.map_invariants import check_invariants

pytestmark = pytest.mark.watchdog(60)


class Room:
    """A made-up room and the map of a run in it."""

    def __init__(self, sensor: str) -> None:
        options = SyntheticOptions(
            world="room", sensor=sensor, frames=30, size=(320, 240), fps=8, noise=2.0
        )
        self.sequence = SyntheticSequence(options)
        with System(
            self.sequence.settings, sensor, deterministic=True, config={"alignment.rgbd": False}
        ) as system:
            system.run(self.sequence)
            self.contents = system.map_contents()

    def error(self, contents: MapContents) -> float:
        """RMSE of the keyframes' positions after alignment with the truth [m]."""
        truth = self.sequence.ground_truth()
        assert isinstance(truth, Trajectory)
        keyframes = contents.keyframes
        rows = np.searchsorted(truth.timestamps, keyframes.timestamps - 1e-6)
        return _rmse(keyframes.T_wc[:, :3, 3], truth.T_wc[rows, :3, 3])


def _rmse(p: FloatArray, q: FloatArray) -> float:
    p, q = p - p.mean(0), q - q.mean(0)
    U, _, Vt = np.linalg.svd(q.T @ p)
    R = U @ np.diag([1, 1, np.linalg.det(U @ Vt)]) @ Vt
    return float(np.sqrt(((q - p @ R.T) ** 2).sum(1).mean()))


@pytest.fixture(scope="module", params=["rgbd", "stereo"])
def room(request: pytest.FixtureRequest) -> Room:
    return Room(request.param)


def test_errors_fall(room: Room) -> None:
    done: list[tuple[int, int]] = []
    aligned, record = align_sightings(
        room.contents, room.sequence, progress=lambda *count: done.append(count)
    )
    assert record.used
    assert record.n_images == record.n_keyframes == len(room.contents.keyframes)
    assert record.error_before == pytest.approx(
        np.median(reprojection_errors(room.contents)), rel=1e-3
    )
    assert record.error_after < 0.5 * record.error_before
    assert record.n_aligned > 0.8 * (record.n_observations - record.n_points)
    n_tried = record.n_aligned + sum(record.failures.values())
    assert n_tried == record.n_observations - record.n_points  # each point has a reference
    assert 0.02 < record.noise < 0.5
    plain = optimize_map(room.contents)[0]
    assert room.error(aligned) < 1.02 * min(room.error(room.contents), room.error(plain))
    assert done == [(i, 4 * record.n_images) for i in range(1, 4 * record.n_images + 1)]


def test_the_map_keeps_its_keypoints(room: Room) -> None:
    aligned, _ = align_sightings(room.contents, room.sequence, rounds=1)
    check_invariants(aligned)
    moved = {"keyframes.rotations", "keyframes.translations"}
    moved |= {f"points.{name}" for name in ("positions", "mean_directions")}
    moved |= {f"points.{name}" for name in ("min_distance", "max_distance", "descriptors")}
    for (name, new), (_, old) in zip(aligned.arrays(), room.contents.arrays(), strict=True):
        if name not in moved:
            np.testing.assert_array_equal(new, old, err_msg=name)
    np.testing.assert_allclose(aligned.keyframes.T_wc[0], room.contents.keyframes.T_wc[0])


def test_the_same_map_gives_the_same_bytes(room: Room) -> None:
    first, second = (align_sightings(room.contents, room.sequence, rounds=1) for _ in range(2))
    assert first[0].first_difference(second[0]) is None
    assert first[1].n_aligned == second[1].n_aligned


def test_right_columns_are_aligned_in_stereo(room: Room) -> None:
    _, record = align_sightings(room.contents, room.sequence, rounds=1)
    n_with_depth = int((room.contents.keyframes.depth[room.contents.observed_keypoints] > 0).sum())
    if room.sequence.sensor.value == "stereo":
        assert record.n_right_aligned > 0.8 * n_with_depth
    else:
        assert record.n_right_aligned == sum(record.right_failures.values()) == 0


def test_keyframes_without_images_keep_their_sightings(
    room: Room, caplog: pytest.LogCaptureFixture
) -> None:
    times = room.contents.keyframes.timestamps
    some = _with(room, timestamps=np.where(room.sequence.timestamps >= times[-1] - 1e-6, 1e6, 0))
    some.timestamps = np.sort(np.append(room.sequence.timestamps[:-1], 1e6))
    missing = np.isin(np.round(times, 6), np.round(some.timestamps, 6), invert=True).sum()
    _, record = align_sightings(room.contents, some, rounds=1)
    assert record.n_images == record.n_keyframes - missing
    assert ("have no image in the sequence" in caplog.text) == (missing > 0)


# ---- wrong input ---------------------------------------------------------------------------------
def _with(room: Room, **changes: object) -> SimpleNamespace:
    same = {
        "settings": room.sequence.settings,
        "timestamps": room.sequence.timestamps,
        "load": room.sequence.load,
    }
    return SimpleNamespace(**{**same, **changes})


def _loading(room: Room, change: Callable[..., object]) -> SimpleNamespace:
    def load(index: int) -> SimpleNamespace:
        images = room.sequence.load(index)
        return SimpleNamespace(image=change(images.image), right=images.right)

    return _with(room, load=load)


def test_images_of_another_time(room: Room) -> None:
    later = _with(room, timestamps=room.sequence.timestamps + 1000)
    with pytest.raises(DatasetError, match="give the sequence that the map was made of"):
        align_sightings(room.contents, later)


def test_images_of_another_place(room: Room) -> None:
    options = SyntheticOptions(
        world="corridor", sensor="mono", frames=30, size=(320, 240), fps=8, seed=5
    )
    other = SyntheticSequence(options)
    with pytest.raises(DatasetError, match="they do not show the map; give the"):
        align_sightings(room.contents, _with(room, load=other.load))


def test_images_of_another_size(room: Room) -> None:
    small = _loading(room, lambda image: image[:120, :160])
    with pytest.raises(
        ImageError, match=r"keyframe 0 has 160 x 120 pixels, but its camera has 320 x 240; give"
    ):
        align_sightings(room.contents, small)


def test_images_that_are_none(room: Room) -> None:
    with pytest.raises(ImageError, match="the image of keyframe 0 is None"):
        align_sightings(room.contents, _loading(room, lambda _: None))


@pytest.mark.parametrize("rounds", [0, -1, 1.5, "two"])
def test_rounds_that_are_none(room: Room, rounds: object) -> None:
    with pytest.raises(MapFileError, match=r"rounds is .*give a whole number of at least 1"):
        align_sightings(room.contents, room.sequence, rounds=rounds)  # type: ignore[arg-type]


def test_a_map_that_is_none(room: Room) -> None:
    with pytest.raises(MapFileError, match=r"the map is 'a\.orbmap'"):
        align_sightings("a.orbmap", room.sequence)  # type: ignore[arg-type]

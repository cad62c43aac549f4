# SPDX-License-Identifier: BSD-3-Clause
"""A lost camera begins another map, and maps that meet become one."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

import orbslam2py as orb
from orbslam2py.evaluation import align
from support.cut_sequences import FPS, Cut, corridor, cut, settings_of, track

#: A lap is 376 frames. The camera is covered for three seconds and set down elsewhere; after a
#: while it comes to where it began.
KIDNAPPED = range(100), 60, range(250, 450)


@dataclass
class _Followed:
    """A commit that says that one keyframe was only moved along."""

    made: Any
    n_followed_keyframes: int = 1

    def __getattr__(self, name: str) -> Any:
        return getattr(self.made, name)


@dataclass
class Tracked:
    """A run over a cut sequence and what was told of it."""

    slam: orb.System
    sequence: Cut
    events: list[object] = field(default_factory=list)
    records: list[orb.TrackingRecord] = field(default_factory=list)

    def told(self, kind: type) -> list:
        return [event for event in self.events if isinstance(event, kind)]


def run(sequence: Cut, sensor: str, **options: object) -> Tracked:
    tracked = Tracked(None, sequence)  # type: ignore[arg-type]
    tell = tracked.events.append
    callbacks = orb.Callbacks(on_map_started=tell, on_maps_merged=tell, on_map_change=tell)
    given = {"deterministic": True, "full_adjustment": False, **options}
    with orb.System(settings_of(sequence), sensor, callbacks=callbacks, **given) as slam:
        tracked.slam = slam
        tracked.records = track(slam, sequence)
        slam.wait_until_idle()
    assert slam.check_map() == []
    return tracked


def error_of(path: orb.Trajectory, sequence: Cut, *, monocular: bool = False) -> float:
    """Root mean square distance from the truth, metres."""
    path = path.select(~path.lost)
    indices = np.rint(path.timestamps * FPS).astype(int)
    truth = np.array([sequence.T_wc(int(i))[:3, 3] for i in indices])
    moved = align(path.positions, truth, with_scale=monocular).apply(path.positions)
    return float(np.sqrt(((moved - truth) ** 2).sum(1).mean()))


@pytest.fixture(scope="module")
def kidnapped() -> Tracked:
    return run(cut(corridor("rgbd"), *KIDNAPPED), "rgbd")


def test_a_covered_camera_set_down_elsewhere_ends_in_one_map(kidnapped: Tracked) -> None:
    (first, second) = kidnapped.told(orb.MapStarted)
    assert (first.map_index, second.map_index) == (0, 1)
    assert 160 <= second.frame_id < 165, "with the first image that can begin a map"
    (merged,) = kidnapped.told(orb.MapsMerged)
    assert (merged.map_index, merged.merged_map) == (0, 1)
    assert merged.scale == 1
    assert kidnapped.slam.merges == [merged]
    causes = [changed.cause for changed in kidnapped.told(orb.MapChanged)]
    assert causes == [orb.MapChangeCause.MERGE]
    (there,) = kidnapped.slam.maps
    assert (there.map_index, there.active) == (0, True)
    assert there.n_keyframes == kidnapped.slam.n_keyframes


def test_every_frame_that_saw_something_has_a_pose_in_the_common_map(kidnapped: Tracked) -> None:
    whole, gone = kidnapped.slam.trajectories()
    assert len(gone) == 0
    assert kidnapped.slam.trajectory().timestamps.tolist() == whole.timestamps.tolist()
    seen = [i for i, index in enumerate(kidnapped.sequence.order) if index is not None]
    found = np.rint(whole.timestamps[~whole.lost] * FPS).astype(int)
    assert len(found) >= 0.98 * len(seen)
    assert error_of(whole, kidnapped.sequence) < 0.1


def test_records_tell_the_map_that_their_pose_is_in(kidnapped: Tracked) -> None:
    numbers = [record.map_index for record in kidnapped.records if record.T_cw is not None]
    changes = np.flatnonzero(np.diff(numbers))
    assert np.diff(numbers)[changes].tolist() == [1, -1]
    (merged,) = kidnapped.told(orb.MapsMerged)
    back = next(r for r in kidnapped.records[170:] if r.map_index == 0)
    assert back.timestamp >= merged.current_timestamp


def test_runs_with_merges_give_the_same_bytes(kidnapped: Tracked) -> None:
    again = run(kidnapped.sequence, "rgbd")
    assert again.slam.map_hash() == kidnapped.slam.map_hash()
    for mine, theirs in zip(again.records, kidnapped.records, strict=True):
        assert (mine.map_index, mine.state) == (theirs.map_index, theirs.state)
        assert (mine.T_cw is None) == (theirs.T_cw is None)
        assert mine.T_cw is None or mine.T_cw.tobytes() == theirs.T_cw.tobytes()


def test_with_one_map_the_rest_is_not_mapped() -> None:
    alone = run(cut(corridor("rgbd"), range(100), 60, range(250, 290)), "rgbd", several_maps=False)
    assert len(alone.slam.maps) == 1
    assert alone.told(orb.MapsMerged) == []
    assert all(record.T_cw is None for record in alone.records[160:200])


def test_the_resting_map_is_kept_while_they_have_not_met() -> None:
    sequence = cut(corridor("rgbd"), range(100), 60, range(200, 260))
    tracked = run(sequence, "rgbd")
    old, young = tracked.slam.maps
    assert (old.active, young.active) == (False, True)
    assert old.n_keyframes > 5
    first, second = tracked.slam.trajectories()
    assert error_of(first, sequence) < 0.1
    assert error_of(second, sequence) < 0.1
    # Each is relative to its own first keyframe.
    assert np.allclose(second.T_wc[~second.lost][0], np.eye(4), atol=0.05)
    assert tracked.slam.map_snapshot(0).keyframe_ids.max() < min(
        tracked.slam.map_snapshot(1).keyframe_ids
    )
    snapshots = tracked.slam.map_snapshots()
    assert [one.map_index for one in snapshots] == [0, 1]
    assert tracked.slam.map_snapshot().map_index == 1, "the active one"
    for one, there in zip(snapshots, (old, young), strict=True):
        assert one == tracked.slam.map_snapshot(there.map_index)
        assert (len(one.keyframe_ids), len(one.point_ids)) == (
            there.n_keyframes,
            there.n_map_points,
        )


def test_found_again_in_a_resting_map_it_goes_on() -> None:
    sequence = cut(corridor("rgbd"), range(100), 60, range(200, 250), 20, range(60, 130))
    tracked = run(sequence, "rgbd", new_map_after=1.0)
    assert [event.map_index for event in tracked.told(orb.MapStarted)] == [0, 1]
    assert tracked.records[-1].map_index == 0
    assert next(iter(tracked.slam.maps)).active
    assert tracked.slam.n_relocalizations >= 1


def test_a_map_that_is_lost_when_small_is_dropped_alone() -> None:
    sequence = cut(corridor("rgbd"), range(100), 60, range(200, 208), 10, range(250, 300))
    tracked = run(sequence, "rgbd")
    numbers = [event.map_index for event in tracked.told(orb.MapStarted)]
    assert numbers == [0, 1, 2]
    assert [there.map_index for there in tracked.slam.maps] == [0, 2]
    assert tracked.slam.n_resets == 1
    _, dropped, _ = tracked.slam.trajectories()
    assert 0 < np.count_nonzero(~dropped.lost) <= 8, "nothing that was tracked is thrown away"


def test_a_map_is_not_dropped_while_its_keyframes_wait() -> None:
    sequence = cut(corridor("rgbd"), range(30))
    with orb.System(settings_of(sequence), "rgbd") as slam:
        track(slam, sequence)
        assert slam.wait_until_idle(20)
        back_end = slam.pipeline.back_end
        worker = back_end.mapping.worker
        n_keyframes = back_end.map.n_keyframes
        pause = worker.pause()
        worker.submit(0)
        with pytest.raises(orb.WorkerError, match="local mapping did not end its work"):
            back_end.drop_map(0, 0.05, keep=lambda _: pytest.fail("the map was ended"))
        assert back_end.map.n_keyframes == n_keyframes
        worker.reset()  # the job was made up
        pause.release()


def test_a_map_that_became_part_of_another_is_not_dropped() -> None:
    sequence = cut(corridor("rgbd"), range(30))
    with orb.System(settings_of(sequence), "rgbd", deterministic=True) as slam:
        track(slam, sequence)
        back_end = slam.pipeline.back_end
        n_keyframes = back_end.map.n_keyframes
        keep = lambda _: pytest.fail("the map was ended")  # noqa: E731
        assert not back_end.drop_map(1, 5.0, keep=keep)
        assert back_end.map.n_keyframes == n_keyframes > 0
        # Nor does the next image, if that map was to be given up.
        n_frames = len(slam.trajectory())
        slam.pipeline._given_up = 1
        image = sequence.load(29)
        record = slam.track_rgbd(image.image, image.depth, 30 / FPS)
        assert record.state is orb.TrackingState.OK
        assert slam.n_resets == 0
        assert len(slam.trajectory()) == n_frames + 1


def test_a_map_is_dropped_when_an_adjustment_of_it_has_ended() -> None:
    sequence = cut(corridor("rgbd"), range(30))
    with orb.System(settings_of(sequence), "rgbd") as slam:
        track(slam, sequence)
        assert slam.wait_until_idle(20)
        back_end = slam.pipeline.back_end
        adjustment = back_end.adjustment
        refining, dropped = threading.Event(), threading.Event()
        refine = adjustment._refine_newest

        def slowly(*arguments: Any) -> None:
            refining.set()
            assert not dropped.wait(0.3), "while it was at work"
            refine(*arguments)

        adjustment._refine_newest = slowly  # type: ignore[method-assign]
        # As if a keyframe had been made meanwhile.
        commit = orb._core.commit_full_bundle
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(orb._core, "commit_full_bundle", lambda *a: _Followed(commit(*a)))
            thread = threading.Thread(target=slam.optimize)
            thread.start()
            assert refining.wait(20)
            assert back_end.drop_map(0, 20.0, keep=slam.pipeline.recorder.end_map)
            dropped.set()
            thread.join(20)
        assert back_end.map.n_keyframes == 0
        adjustment.worker.raise_if_failed()


def test_patience_is_a_setting() -> None:
    sequence = cut(corridor("rgbd"), range(30), 30, range(200, 220))
    assert len(run(sequence, "rgbd", new_map_after=5.0).slam.maps) == 1
    assert len(run(sequence, "rgbd", new_map_after=0.5).slam.maps) == 2


@pytest.mark.parametrize("value", [-1.0, float("nan"), float("inf"), "soon"])
def test_impossible_patience_is_refused(value: object) -> None:
    with pytest.raises(orb.SettingsError, match="new_map_after must be a number of seconds"):
        orb.System("tum1", "rgbd", new_map_after=value)  # type: ignore[arg-type]


def test_all_maps_are_saved_and_loaded(tmp_path: pytest.TempPathFactory) -> None:
    sequence = cut(corridor("rgbd"), range(100), 60, range(200, 260))
    tracked = run(sequence, "rgbd")
    path = tmp_path / "two.orbmap"  # type: ignore[operator]
    tracked.slam.save_map(path)
    with orb.System(load_map=path, deterministic=True) as slam:
        assert slam.check_map() == []
        assert [there.n_keyframes for there in slam.maps] == [
            there.n_keyframes for there in tracked.slam.maps
        ]
        # Found in whichever map shows it.
        again = cut(corridor("rgbd"), range(210, 230))
        assert {r.map_index for r in track(slam, again) if r.T_cw is not None} == {1}


def test_a_reset_drops_all_maps() -> None:
    sequence = cut(corridor("rgbd"), range(100), 60, range(200, 240))
    with orb.System(settings_of(sequence), "rgbd", deterministic=True) as slam:
        track(slam, sequence)
        assert len(slam.maps) == 2
        slam.reset()
        track(slam, sequence, range(10))
        assert [there.map_index for there in slam.maps] == [2]
        assert len(slam.trajectories()) == 3
        assert slam.check_map() == []

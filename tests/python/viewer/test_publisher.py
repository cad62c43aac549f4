# SPDX-License-Identifier: BSD-3-Clause
"""What watchers of a running system are told, and that nobody else notices them."""

from __future__ import annotations

import logging
import threading
from typing import Any

import numpy as np
import pytest

from orbslam2py import MapChanged, Sensor, StateError, System, TrackingLost, TrackingState
from orbslam2py.datasets import Images
from orbslam2py.viewer import FrameView, Publisher
from orbslam2py.viewer.live import FRAME_RATE
from support.small_sequences import SIZE, black, images, new_system, play, track
from support.watchers import Notebook

pytestmark = pytest.mark.watchdog(60)


def watched(system: System, notebook: Notebook, n_frames: int, **options: object) -> None:
    with Publisher(system, [notebook], **options):  # type: ignore[arg-type]
        play(system, n_frames)
        system.wait_until_idle()


def test_every_frame_is_seen_with_its_record_and_pixels() -> None:
    notebook = Notebook()
    with new_system(Sensor.RGBD, deterministic=True) as system:
        watched(system, notebook, 12, every_frame=True)
        assert [view.record.frame_id for view in notebook.views] == list(range(12))
        last = notebook.views[-1]
        assert last.record.state is TrackingState.OK
        assert last.image.shape[:2] == SIZE[::-1]
        assert len(last.pixels) == len(last.features.keypoints) == len(last.matched)
        assert np.count_nonzero(last.matched) == last.record.n_inliers
        assert not last.visual_odometry.any()
        assert np.isin(last.features.map_point_ids[last.matched], last.local_points).mean() > 0.8
        assert last.start_lines is None
        assert last.queue.n_frames == 12
        assert last.queue.frames_per_second > 0
    assert notebook.n_closed == 1


def test_the_changes_add_up_to_the_map() -> None:
    notebook = Notebook()
    with new_system(Sensor.RGBD, deterministic=True) as system:
        watched(system, notebook, 20)
        snapshot = system.map_snapshot()
    keyframes: dict[int, np.ndarray] = {}
    points: dict[int, np.ndarray] = {}
    for changes in notebook.changes:
        if changes.restarted:
            keyframes, points = {}, {}
        for i in changes.keyframes_removed:
            del keyframes[int(i)]
        for i in changes.points_removed:
            del points[int(i)]
        keyframes |= {
            int(i): T
            for i, T in zip(changes.keyframes_set.ids, changes.keyframes_set.T_wc, strict=True)
        }
        points |= {
            int(i): x
            for i, x in zip(changes.points_set.ids, changes.points_set.positions, strict=True)
        }
    assert sorted(keyframes) == list(snapshot.keyframe_ids)
    assert sorted(points) == list(snapshot.point_ids)
    assert np.array_equal([points[i] for i in sorted(points)], snapshot.point_positions)


def test_frames_come_at_the_rate_and_none_of_their_records_is_lost() -> None:
    notebook = Notebook()
    with new_system(Sensor.RGBD, deterministic=True) as system:
        with Publisher(system, [notebook], frame_rate=0.001):
            track(system, 0)
            notebook.wait_for(lambda book: len(book.views) == 1)
            play(system, 5, first=1)  # shown at the end
        seen = [
            [record.frame_id for record in (*view.earlier, view.record)] for view in notebook.views
        ]
    assert seen == [[0], [1, 2, 3, 4, 5]]
    assert notebook.views[-1].queue.n_frames == 6
    assert notebook.views[-1].queue.n_not_shown == 4


def test_an_image_is_shown_though_none_comes_after_it() -> None:
    """As when a run is stepped: all of them are, at the rate of the page."""
    notebook = Notebook()
    with (
        new_system(Sensor.RGBD, deterministic=True) as system,
        Publisher(system, [notebook], frame_rate=FRAME_RATE),
    ):
        for n in range(4):
            track(system, n)
            notebook.wait_for(lambda book, n=n: len(book.views) == n + 1)
    assert [view.record.frame_id for view in notebook.views] == [0, 1, 2, 3]
    assert not any(view.earlier for view in notebook.views)


def test_a_slow_watcher_delays_nobody() -> None:
    hold = threading.Event()
    slow = Notebook(lambda view: bool(hold.wait(30)))
    with new_system(Sensor.RGBD, deterministic=True) as system:
        with Publisher(system, [slow], frame_rate=1e6):
            track(system, 0)
            slow.wait_for(lambda book: len(book.views) == 1)
            play(system, 9, first=1)
            hold.set()
        assert [view.record.frame_id for view in slow.views] == [0, 9]
        assert [record.frame_id for record in slow.views[1].earlier] == list(range(1, 9))


def test_a_watcher_that_fails_is_left_out_with_one_warning(
    caplog: pytest.LogCaptureFixture,
) -> None:
    def fail(view: FrameView) -> None:
        raise OSError(28, "No space left on device", "run.mp4")

    failing, fine = Notebook(fail), Notebook()
    with caplog.at_level(logging.WARNING), new_system(Sensor.RGBD, deterministic=True) as system:
        with Publisher(system, [failing, fine], every_frame=True):
            play(system, 5)
        assert system.state is TrackingState.OK
    assert len(failing.views) == 1
    assert len(fine.views) == 5
    assert failing.n_closed == fine.n_closed == 1
    warnings = [record.getMessage() for record in caplog.records]
    assert warnings == [
        "the notebook stopped: run.mp4: No space left on device; the run continues without it"
    ]


def test_events_are_told_and_callbacks_are_still_called() -> None:
    notebook = Notebook()
    with new_system(Sensor.RGBD, deterministic=True) as system:
        with Publisher(system, [notebook]):
            play(system, 25)
            track(system, 25, shown=black(Sensor.RGBD))
            system.reset()
            track(system, 26)
        assert {type(event) for event in notebook.events} >= {TrackingLost, MapChanged}


def test_a_single_camera_shows_what_it_starts_from() -> None:
    notebook = Notebook()
    with new_system(Sensor.MONOCULAR, deterministic=True) as system:
        watched(system, notebook, 20, every_frame=True)
    starting = [v for v in notebook.views if v.record.state is TrackingState.NOT_INITIALIZED]
    begun = [v for v in notebook.views if v.record.state is TrackingState.OK]
    assert starting
    assert begun
    assert all(view.start_lines is None for view in begun)
    lines = starting[-1].start_lines
    assert lines is not None
    assert lines.shape[1:] == (4,)
    assert len(lines) > 20
    ends = {tuple(pixel) for pixel in starting[-1].pixels}
    assert {tuple(end) for end in lines[:, 2:].astype(np.float32)} <= ends


def test_visual_odometry_is_told_from_the_map() -> None:
    notebook = Notebook()
    with (
        new_system(Sensor.RGBD, deterministic=True, config={"alignment.rgbd": False}) as system,
        Publisher(system, [notebook], every_frame=True),
    ):
        play(system, 5)
        system.localization_mode = True
        play(system, 55, first=5)
    assert not notebook.views[4].localization
    assert notebook.views[5].localization
    assert any(view.visual_odometry.any() for view in notebook.views)
    for view in notebook.views:
        assert not (view.matched & view.visual_odometry).any()


@pytest.mark.parametrize("channels", [1, 3, 4])
def test_images_are_grey_or_rgb_and_copies(channels: int) -> None:
    """The caller may use the memory of its image again."""
    shown = images(Sensor.RGBD, 0)
    grey = shown.image if shown.image.ndim == 2 else shown.image[:, :, 0]
    image = np.repeat(grey[:, :, None], channels, axis=2)
    if channels > 1:
        image[:, :, 0] = 0
    notebook = Notebook()
    with new_system(Sensor.RGBD, deterministic=True) as system:
        rgb = system.settings.camera.rgb
        with Publisher(system, [notebook], every_frame=True):
            track(system, 0, shown=Images(image, None, shown.depth))
            image[:] = 7
    seen = notebook.views[0].image
    if channels == 1:
        assert np.array_equal(seen, grey)
    else:
        assert seen.shape == (*grey.shape, 3)
        assert np.array_equal(seen[:, :, 1], grey)
        assert not seen[:, :, 0 if rgb else 2].any()


def test_watching_changes_no_byte() -> None:
    hashes = []
    for watchers in ([], [Notebook()]):
        with new_system(Sensor.RGBD, deterministic=True) as system:
            if watchers:
                watched(system, watchers[0], 40, every_frame=True)
            else:
                play(system, 40)
            hashes.append((system.map_hash(), system.trajectory().T_wc.tobytes()))
    assert hashes[0] == hashes[1]


def test_nobody_is_told_after_the_end() -> None:
    notebook = Notebook()
    with new_system(Sensor.RGBD, deterministic=True) as system:
        publisher = Publisher(system, [notebook], every_frame=True)
        play(system, 2)
        publisher.close()
        publisher.close()
        play(system, 2, first=2)
        assert system.pipeline.frame_watchers == ()
        assert system.pipeline.back_end.events.watchers == ()
    assert len(notebook.views) == 2
    assert notebook.n_closed == 1


# ---- what is none --------------------------------------------------------------------------------
class Nameless:
    """Watches, but does not say what it is called."""

    def on_frame(self, view: FrameView) -> None: ...
    def on_map(self, changes: object) -> None: ...
    def on_event(self, event: object) -> None: ...
    def close(self) -> None: ...


@pytest.mark.parametrize("watcher", [Nameless(), 3, None])
def test_what_is_no_watcher_is_refused_at_once(watcher: Any) -> None:
    with new_system(Sensor.RGBD, deterministic=True) as system:
        with pytest.raises(StateError, match="is no watcher; it needs a name"):
            Publisher(system, [watcher])
        assert system.pipeline.frame_watchers == ()


@pytest.mark.parametrize("rates", [{"frame_rate": 0}, {"map_rate": -1.0}, {"frame_rate": "a"}])
def test_rates_are_above_0(rates: dict[str, Any]) -> None:
    with (
        new_system(Sensor.RGBD, deterministic=True) as system,
        pytest.raises(StateError, match="more than 0"),
    ):
        Publisher(system, [], **rates)
    with pytest.raises(StateError, match="watches a System"):
        Publisher(None, [])  # type: ignore[arg-type]


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_nobody_waits_for_a_publisher_whose_thread_is_gone() -> None:
    class Ends(Notebook):
        def on_frame(self, view: FrameView) -> None:
            raise KeyboardInterrupt

    with new_system(Sensor.RGBD, deterministic=True) as system:
        watched(system, Ends(), 12, every_frame=True)
        assert system.n_keyframes > 0

# SPDX-License-Identifier: BSD-3-Clause
"""The live viewer in a real browser: what is seen, and what its switches do."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from orbslam2py import Sensor, System, TrackingRecord, TrackingState, Viewer
from orbslam2py._palette import KEYFRAME, LOCAL_POINTS, MAPPED
from orbslam2py.maps import load_map
from support.browser import Browser, BrowserError, Page
from support.small_sequences import new_system, play, sequence
from support.viewer_pages import (
    amount,
    click_on,
    map_part,
    open_viewer,
    picture,
    wait_until,
    wait_until_checked,
    wait_until_seen,
)

pytestmark = pytest.mark.watchdog(300)
pytest.importorskip("viser", reason="the viewer's extra is not installed")

N_FRAMES = 30


@dataclass
class Show:
    """A system with a small map, its viewer, and a page that shows it."""

    system: System
    viewer: Viewer
    page: Page
    n_played: int = 0

    def play(self, n_frames: int) -> list[TrackingRecord]:
        """Track the next frames."""
        records = play(self.system, n_frames, first=self.n_played)
        self.n_played += n_frames
        return records


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with Browser() as browser:
        yield browser


@pytest.fixture(scope="module")
def show(browser: Browser) -> Iterator[Show]:
    """One for all tests; those that only look come first."""
    with (
        new_system(Sensor.RGBD, wait_for_mapping=True) as system,
        Viewer(
            system, port=0, truth=sequence(Sensor.RGBD).ground_truth(), open_browser=False
        ) as viewer,
    ):
        page = open_viewer(browser, viewer.address)
        shown = Show(system, viewer, page)
        shown.play(N_FRAMES)
        assert system.wait_until_idle(60)
        yield shown
        page.close()


def shows_local_points(seen: np.ndarray) -> bool:
    # A few hundred pixels: how many is a matter of the keyframes, and of where the view stands.
    return amount(map_part(seen), LOCAL_POINTS) > 100


def test_image_map_cameras_and_figures_are_seen(show: Show, tmp_path: Path) -> None:
    def complete(seen: np.ndarray) -> bool:
        middle = map_part(seen)
        cameras = amount(middle, KEYFRAME, 40)
        keypoints = amount(seen[:, :430], MAPPED, 40)
        camera = amount(middle, MAPPED, tolerance=65)
        return shows_local_points(seen) and cameras > 60 and camera > 40 and keypoints > 300

    seen = wait_until_seen(show.page, complete, "points, keyframes, camera and keypoints")
    image = seen[80:380, 20:400]
    assert image.std() > 30  # a picture, and no grey rectangle
    for text in ("SLAM", f"{show.system.n_keyframes} keyframes", "from the ground truth"):
        show.page.wait_for(f"document.body.innerText.includes('{text}')", 50)
    plots = "document.querySelectorAll('.uplot canvas').length"
    assert show.page.evaluate(plots) == 2
    # The drawing library of the page speaks of itself, and of graphics that are drawn in software.
    own = [text for text in show.page.errors if "THREE.Clock" not in text and "WebGL" not in text]
    assert own == []


def test_nothing_is_asked_of_other_computers(show: Show) -> None:
    wait_until_seen(show.page, shows_local_points, "points")
    own = show.viewer.address.removeprefix("http://")
    for request in show.page.requests:
        assert request.startswith(("data:", f"blob:http://{own}/", f"http://{own}", f"ws://{own}"))
    assert own.startswith("127.0.0.1:")


def test_layers_are_switched_off_and_on(show: Show) -> None:
    wait_until_seen(show.page, shows_local_points, "local points")
    click_on(show.page, "Points of the local map")
    wait_until_seen(
        show.page, lambda seen: amount(map_part(seen), LOCAL_POINTS) < 20, "no local points"
    )
    click_on(show.page, "Points of the local map")
    wait_until_seen(show.page, shows_local_points, "local points again")


def test_optimize_is_told(show: Show) -> None:
    click_on(show.page, "Optimize")
    wait_until(lambda: len(show.system.full_adjustments) == 1, "a full adjustment")
    show.page.wait_for("document.body.innerText.includes('Optimized: ')", 50)


def test_the_map_is_saved(show: Show, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    click_on(show.page, "Save map")
    show.page.wait_for("document.body.innerText.includes('The map is in ')", 50)
    saved = list(tmp_path.glob("map-*.orbmap"))
    assert len(saved) == 1
    assert len(load_map(saved[0]).contents.keyframes.ids) == show.system.n_keyframes


#: The page shows a hand over what can be clicked.
_TOUCHED = "[...document.querySelectorAll('canvas')].some(c => c.style.cursor === 'pointer')"


def _place_of_a_keyframe(page: Page) -> tuple[float, float] | None:
    """Where the mouse is over a keyframe: in the middle below the camera that is followed."""
    seen = picture(page)[300:, 470:890].astype(int)
    rows, columns = np.nonzero(np.abs(seen - np.array(KEYFRAME)).max(axis=2) < 40)
    if not len(rows):
        return None
    # Of the colour are its edges, drawn wide; what can be clicked is between them.
    order = np.argsort(np.abs(rows - np.percentile(rows, 80)), kind="stable")
    for at in order[:: max(1, len(order) // 30)]:
        place = 470.0 + float(columns[at]), 300.0 + float(rows[at])
        page.mouse("mouseMoved", *place)
        try:
            page.wait_for(_TOUCHED, 0.5)
        except BrowserError:
            continue
        return place
    return None


def _click_on_a_keyframe(page: Page) -> bool:
    """Whether a keyframe is shown after it; not if the view has moved meanwhile."""
    place = _place_of_a_keyframe(page)
    if place is None:
        return False
    page.mouse("mousePressed", *place)
    page.mouse("mouseReleased", *place)
    click_on(page, "Keyframe")
    try:
        page.wait_for("document.body.innerText.includes('Neighbours (points shared)')", 15)
    except BrowserError:
        return False
    return True


def test_a_keyframe_that_is_clicked_is_shown(show: Show) -> None:
    wait_until_seen(show.page, lambda seen: amount(map_part(seen), KEYFRAME, 40) > 60, "keyframes")
    wait_until(lambda: _click_on_a_keyframe(show.page), "a keyframe's panel", 150)
    assert "matched to the map then" in show.page.evaluate("document.body.innerText")


# ---- what changes the system, and stops it last --------------------------------------------------
def test_browsers_that_reload_or_are_killed_change_nothing(show: Show) -> None:
    show.page.go(show.viewer.address)
    with Browser() as other:
        for _ in range(2):
            open_viewer(other, show.viewer.address)
        show.play(2)
        other.kill()
    records = show.play(4)
    assert all(record.state is TrackingState.OK for record in records)
    wait_until_seen(show.page, shows_local_points, "points")


def test_localization_mode_is_switched(show: Show) -> None:
    click_on(show.page, "Localization")
    wait_until(lambda: show.system.localization_mode, "localization mode")
    show.play(3)
    show.page.wait_for("document.body.innerText.includes('LOCALIZATION')")
    click_on(show.page, "Localization")
    wait_until(lambda: not show.system.localization_mode, "no localization mode")
    assert show.system.wait_until_idle(60)
    # And the page shows what somebody else switches.
    show.system.localization_mode = True
    show.play(3)
    wait_until_checked(show.page, "Localization")
    show.system.localization_mode = False


def test_reset_begins_a_new_map_and_the_page_goes_on(show: Show) -> None:
    click_on(show.page, "Reset")
    wait_until(show.system.pipeline.reset_requested.is_set, "the wish for a reset")
    show.play(4)
    assert show.system.n_resets == 1
    show.page.wait_for(
        f"document.body.innerText.includes('{show.system.n_keyframes} keyframe')", 60
    )
    wait_until_seen(show.page, shows_local_points, "points")


def test_stop_is_told_to_the_loop_that_reads_images(show: Show) -> None:
    assert not show.viewer.stopped.is_set()
    click_on(show.page, "Stop")
    assert show.viewer.stopped.wait(60)


def test_a_page_left_open_over_the_end_stays(browser: Browser) -> None:
    with new_system(Sensor.RGBD, wait_for_mapping=True) as system:
        viewer = Viewer(system, port=0, open_browser=False)
        page = open_viewer(browser, viewer.address)
        play(system, 5)
        viewer.close()
        play(system, 2, first=5)  # nobody looks any more
        assert system.pipeline.frame_watchers == ()
    page.wait_for("document.body.innerText.includes('Whole map')", 50)
    page.close()


def test_it_ends_by_itself_while_browsers_look(browser: Browser) -> None:
    with new_system(Sensor.RGBD, wait_for_mapping=True) as system:
        viewer = Viewer(system, port=0, open_browser=False)
        page = open_viewer(browser, viewer.address)
        play(system, 2)
        process = viewer._view._companion._process
        viewer.close()
        assert process.returncode == 0  # and was not killed for taking its time
    page.close()

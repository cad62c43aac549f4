# SPDX-License-Identifier: BSD-3-Clause
"""Maps that rest, as a viewer is told of them and shows them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from orbslam2py import System
from orbslam2py._palette import MAPS
from orbslam2py.viewer import Publisher, RestingMaps, Viewer
from orbslam2py.viewer.map_model import MapModel
from support.browser import Browser
from support.cut_sequences import Cut, corridor, cut, settings_of, track
from support.viewer_pages import amount, click_on, map_part, open_viewer, wait_until_seen
from support.watchers import Notebook

pytestmark = pytest.mark.watchdog(300)

#: A covered camera is set down elsewhere, and later where it began.
LOST, FOUND = 60, 100


@pytest.fixture(scope="module")
def sequence() -> Cut:
    return cut(corridor("rgbd"), range(40), 20, range(200, 240), range(5, 35))


@pytest.fixture
def system(sequence: Cut) -> Iterator[System]:
    options = {"deterministic": True, "full_adjustment": False, "new_map_after": 0.5}
    with System(settings_of(sequence), "rgbd", **options) as system:  # type: ignore[arg-type]
        yield system


class Atlas(Notebook):
    """Follows all maps by what it is told."""

    def __init__(self) -> None:
        super().__init__()
        self.told: list[RestingMaps] = []
        self.models: dict[int, MapModel] = {}

    def on_resting_maps(self, maps: RestingMaps) -> None:
        for number in set(self.models) - set(maps.there):
            del self.models[number]
        for changes in maps.changes:
            self.models.setdefault(changes.map_index, MapModel()).apply(changes)
        self._note(lambda: self.told.append(maps))


def test_a_watcher_knows_all_maps(system: System, sequence: Cut) -> None:
    atlas, plain = Atlas(), Notebook()
    with Publisher(system, [atlas, plain]):
        track(system, sequence, range(40))
    assert atlas.told == [], "nothing is said as long as there is one map"
    with Publisher(system, [atlas, plain]):
        track(system, sequence, range(40, FOUND))
    assert [one.map_index for one in system.maps] == [0, 1]
    assert (atlas.told[-1].active, atlas.told[-1].there) == (1, (0,))
    snapshot = system.map_snapshot(0)
    assert set(atlas.models) == {0}
    np.testing.assert_array_equal(atlas.models[0].keyframe_ids, snapshot.keyframe_ids)
    np.testing.assert_array_equal(atlas.models[0].keyframe_T_wc, snapshot.keyframe_T_wc)
    assert atlas.models[0].n_points == len(snapshot.point_ids)
    assert {changes.map_index for changes in plain.changes} == {0, 1}, "others see the active one"


def test_maps_that_change_places_are_told(system: System, sequence: Cut) -> None:
    atlas = Atlas()
    with Publisher(system, [atlas]):
        track(system, sequence)
    last = atlas.told[-1]
    assert last.active == next(one.map_index for one in system.maps if one.active)
    assert last.there == tuple(one.map_index for one in system.maps if not one.active)
    for number in last.there:
        snapshot = system.map_snapshot(number)
        np.testing.assert_array_equal(atlas.models[number].keyframe_ids, snapshot.keyframe_ids)


def test_after_a_reset_nothing_rests(system: System, sequence: Cut) -> None:
    atlas = Atlas()
    with Publisher(system, [atlas]):
        track(system, sequence, range(FOUND))
        atlas.wait_for(lambda _: bool(atlas.told))
        system.reset()
        track(system, sequence, range(FOUND, FOUND + 5))
    assert atlas.told[-1].there == ()
    assert atlas.models == {}


# ---- in a browser --------------------------------------------------------------------------------
def of_map(seen: np.ndarray, number: int) -> int:
    """Pixels of the colour of a map."""
    return amount(map_part(seen), MAPS[number], 40)  # drawn a little brighter


def test_resting_maps_lie_beside_the_active_one(system: System, sequence: Cut) -> None:
    pytest.importorskip("viser", reason="the viewer's extra is not installed")
    with Viewer(system, port=0, open_browser=False) as viewer, Browser() as browser:
        page = open_viewer(browser, viewer.address)
        track(system, sequence, range(40))
        assert "Show map" not in page.evaluate("document.body.innerText")
        track(system, sequence, range(40, FOUND))
        own, other = system.map_snapshot(1), system.map_snapshot(0)
        for text in (
            f"map 1, active: {len(own.keyframe_ids)} keyframes",
            f"map 0, rests: {len(other.keyframe_ids)} keyframes, {len(other.point_ids)} points",
            "their own world frames",
            "1 other map at rest",
        ):
            page.wait_for(f"document.body.innerText.includes({text!r})", 60)
        click_on(page, "Whole map")

        def both(seen: np.ndarray) -> bool:
            return of_map(seen, 0) > 60 and of_map(seen, 1) > 20

        wait_until_seen(page, both, "both maps, each in its colour")
        click_on(page, "Show map 0")
        wait_until_seen(page, lambda seen: of_map(seen, 0) < 10, "the active map alone")
        click_on(page, "Show map 1")
        wait_until_seen(page, lambda seen: of_map(seen, 1) < 5, "no map at all")
        click_on(page, "Show map 0")
        click_on(page, "Show map 1")
        wait_until_seen(page, both, "both maps again")
        page.close()

# SPDX-License-Identifier: BSD-3-Clause
"""What loop closing does with a keyframe, step by step, among stand-ins for the C++ steps."""

from __future__ import annotations

import contextlib
import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np
import pytest

from orbslam2py import LoopClosed, MapsMerged, Sensor, StateError, _core
from orbslam2py._worker import Worker
from orbslam2py.slam import loop_closing
from orbslam2py.slam.config import Config
from orbslam2py.slam.loop_closing import LoopClosing
from orbslam2py.slam.options import SystemOptions


@dataclass(frozen=True)
class FakeLoop:
    """A loop to a place; two places contradict each other."""

    current: int
    matched: int
    place: str = "here"
    n_inliers: int = 55
    n_matches: int = 166
    S_cm: np.ndarray = field(default_factory=lambda: np.eye(4))


class FakeMap:
    def __init__(self) -> None:
        self.maps: dict[int, int] = {}
        self.dropped: set[int] = set()
        self.dead: set[int] = set()
        self.leases: list[int] = []
        self.dies_after_lease = False
        self.big_change_index = 0
        self.calls: list[str] = []

    def begin_lease(self, keyframe: int) -> None:
        if keyframe in self.dead:
            raise StateError("dead")
        self.leases.append(keyframe)

    def end_lease(self, keyframe: int) -> bool:
        self.leases.remove(keyframe)
        return self.dies_after_lease

    def has_keyframe(self, keyframe: int) -> bool:
        return keyframe not in self.dead

    def update_connections(self, keyframe: int) -> None:
        self.calls.append("connections")

    def keyframe_timestamp(self, keyframe: int) -> float:
        return keyframe / 10

    def map_of(self, keyframe: int) -> int:
        return self.maps.get(keyframe, 0)

    def n_keyframes_of(self, map_index: int) -> int:
        return 0 if map_index in self.dropped else 5


class FakeIndex:
    def __init__(self) -> None:
        self.added: list[int] = []
        self.erased: list[int] = []

    def erase(self, keyframe: int) -> None:
        self.erased.append(keyframe)


class FakeConsistency:
    def __init__(self) -> None:
        self.n_cleared = 0
        self.consistent: deque[list[int]] = deque()

    def clear(self) -> None:
        self.n_cleared += 1

    def update(self, world: FakeMap, candidates: list[int]) -> list[int]:
        return self.consistent.popleft() if self.consistent else []


class FakeAdjustment:
    def __init__(self, calls: list[str]) -> None:
        self.calls = calls

    @contextlib.contextmanager
    def kept_away(self) -> Iterator[None]:
        self.calls.append("no adjustment")
        yield
        self.calls.append("adjustments again")

    def start(self, map_index: int) -> None:
        assert map_index == 0
        self.calls.append("start adjustment")


class Scene:
    """Loop closing with stand-ins."""

    def __init__(
        self, monkeypatch: pytest.MonkeyPatch, *, enabled: bool = True, adjust: bool = True
    ) -> None:
        self.map, self.index = FakeMap(), FakeIndex()
        self.calls = self.map.calls
        self.consistency = FakeConsistency()
        self.candidates: list[int] = [3, 4, 7]
        self.places = {3: "here", 4: "here", 7: "here"}
        self.verified: list[int] = []
        #: Of the next loops verified; 0: it is none. Then many.
        self.n_matches: deque[int] = deque()
        self.aborted = False
        #: The keyframe whose loop waits for a better one.
        self.waits: list[int] = []
        self.applied = True
        self.events: list[LoopClosed] = []
        self.merged: list[MapsMerged] = []
        self.mapping: Worker[int] = Worker("local mapping", lambda _: None, threaded=False)
        monkeypatch.setattr(loop_closing, "core", self._core())
        self.adjustment = FakeAdjustment(self.calls)
        self.closing = LoopClosing(
            self.map,  # type: ignore[arg-type]
            self.index,  # type: ignore[arg-type]
            Sensor.STEREO,
            self.mapping,
            self.adjustment,  # type: ignore[arg-type]
            SystemOptions(deterministic=True, loop_closing=enabled, full_adjustment=adjust, seed=5),
            on_loop=self.events.append,
            on_merge=self.merged.append,
            config=Config(),
        )

    def _core(self) -> SimpleNamespace:
        def index(index: FakeIndex, _map: FakeMap, keyframe: int) -> None:
            index.added.append(keyframe)

        def candidates(
            index: FakeIndex, _map: FakeMap, keyframe: int, least: float
        ) -> list[SimpleNamespace]:
            assert keyframe not in index.added, "it would find itself"
            assert least == 0.125
            return [SimpleNamespace(keyframe=k) for k in self.candidates]

        def verify(
            world: FakeMap, keyframe: int, candidate: int, options: SimpleNamespace
        ) -> FakeLoop | None:
            assert options.fix_scale
            assert options.seed == 5
            assert keyframe in world.leases
            self.verified.append(candidate)
            place = self.places.get(candidate)
            if not place:
                return None
            n_matches = self.n_matches.popleft() if self.n_matches else 166
            return FakeLoop(keyframe, candidate, place, n_matches=n_matches) if n_matches else None

        def choose(_map: FakeMap, loops: list[FakeLoop], fix_scale: bool) -> FakeLoop | None:
            return loops[0] if len({loop.place for loop in loops}) == 1 else None

        def step(name: str, result: object) -> object:
            assert self.mapping.pausing, "mapping stands still during the correction"
            self.calls.append(name)
            return result

        return SimpleNamespace(
            LoopConsistency=lambda: self.consistency,
            LoopVerificationOptions=SimpleNamespace,
            StopFlag=_core.StopFlag,
            index_keyframe=index,
            lowest_neighbour_score=lambda _map, _keyframe: 0.125,
            find_loop_candidates=candidates,
            verify_loop_candidate=verify,
            choose_loop=choose,
            plan_loop_correction=lambda _map, _loop, fix: step("plan", fix),
            optimize_essential_graph=lambda _correction, _flag: step(
                "graph", SimpleNamespace(aborted=self.aborted)
            ),
            apply_loop_correction=lambda _map, _correction: step(
                "apply",
                SimpleNamespace(
                    applied=self.applied,
                    n_fused=77,
                    translation=0.25,
                    rotation=math.pi / 180,
                    scale=1.0,
                ),
            ),
        )

    def process(self, *keyframes: int) -> None:
        for keyframe in keyframes:
            self.closing.insert_keyframe(keyframe)
        assert self.map.leases == self.waits
        assert not self.mapping.pausing


@pytest.fixture
def scene(monkeypatch: pytest.MonkeyPatch) -> Scene:
    return Scene(monkeypatch)


def test_every_keyframe_enters_the_index(scene: Scene) -> None:
    """The original's keyframe 0 never does (OD-46)."""
    scene.process(0, 1, 2)
    assert scene.index.added == [0, 1, 2]
    assert scene.closing.last_keyframe == 2


def test_the_first_keyframe_is_not_searched_for(scene: Scene) -> None:
    scene.consistency.consistent.append([3])
    scene.process(0)
    assert scene.consistency.consistent, "nobody asked"


def test_a_confirmed_loop_is_closed_and_told(scene: Scene) -> None:
    scene.consistency.consistent.append([4])
    scene.process(20)
    assert scene.calls == [
        *("no adjustment", "connections", "plan", "graph", "apply", "adjustments again"),
        "start adjustment",
    ]
    (closed,) = scene.events
    assert scene.closing.loops == [closed]
    assert not scene.merged
    assert (closed.current_keyframe, closed.matched_keyframe) == (20, 4)
    assert (closed.current_timestamp, closed.matched_timestamp) == (2.0, 0.4)
    assert (closed.n_inliers, closed.n_matches, closed.n_fused) == (55, 166, 77)
    assert closed.translation == 0.25
    assert closed.rotation_deg == pytest.approx(1.0)
    assert set(closed.milliseconds) == {"detect", "verify", "wait", "plan", "graph", "apply"}
    assert scene.closing.statistics.summary()["loop.graph"]["count"] == 1


def test_no_search_for_ten_keyframes_after_a_loop(scene: Scene) -> None:
    """In the original, chains of consistency outlive the loop and the gap (OD-97)."""
    scene.consistency.consistent.extend([[4], [4]])
    scene.process(20, 21, 29)
    assert len(scene.events) == 1
    assert scene.consistency.n_cleared == 3, "after the loop and at every keyframe of the gap"
    scene.process(30)
    assert len(scene.events) == 2


@pytest.fixture
def weak(scene: Scene) -> Scene:
    """Keyframe 20 has found a loop that few matches hold."""
    scene.candidates = [4]
    scene.consistency.consistent.extend([[4], [4]])
    scene.n_matches.extend([60, 0])
    scene.waits = [20]
    scene.process(20)
    assert scene.events == []
    return scene


def test_a_weak_loop_waits_for_a_better_one(weak: Scene) -> None:
    weak.process(21)
    weak.consistency.consistent.append([4])
    weak.waits = []
    weak.process(22)
    assert [(e.current_keyframe, e.n_matches) for e in weak.events] == [(22, 166)]


def test_at_the_end_it_is_closed(weak: Scene) -> None:
    weak.closing.end()
    assert [(e.current_keyframe, e.n_matches) for e in weak.events] == [(20, 60)]
    assert weak.map.leases == []
    assert weak.closing.last_keyframe == 20
    assert weak.closing.statistics.summary()["loop.graph"]["count"] == 1


def test_whether_one_waits_is_known(weak: Scene) -> None:
    assert weak.closing.has_loop_waiting
    weak.closing.end()
    assert not weak.closing.has_loop_waiting


def test_a_reset_forgets_it(weak: Scene) -> None:
    weak.closing.reset()
    assert weak.map.leases == []
    weak.closing.end()
    assert weak.events == []


def test_proposals_that_are_not_consistent_close_nothing(scene: Scene) -> None:
    scene.process(20)
    assert scene.verified == []
    assert scene.events == []


def test_the_other_proposals_are_asked_for_contradictions(scene: Scene) -> None:
    scene.consistency.consistent.append([4])
    scene.places[7] = "elsewhere"
    scene.process(20)
    assert scene.verified == [4, 3, 7]
    assert scene.events == []


def test_consistent_candidates_that_geometry_refuses(scene: Scene) -> None:
    scene.consistency.consistent.append([4])
    scene.places[4] = ""
    scene.process(20)
    assert scene.verified == [4], "the others alone are not enough"
    assert scene.events == []


def test_a_reset_gives_up_the_correction(scene: Scene) -> None:
    scene.consistency.consistent.append([4])
    scene.aborted = True
    scene.process(20)
    assert "apply" not in scene.calls
    assert scene.events == []


def test_a_correction_that_could_not_be_applied_is_no_loop(scene: Scene) -> None:
    scene.consistency.consistent.extend([[4], [4]])
    scene.applied = False
    scene.process(20)
    assert scene.events == []
    assert "start adjustment" not in scene.calls
    scene.applied = True
    scene.process(21)
    assert len(scene.events) == 1, "no gap after it"


def test_full_adjustment_can_be_switched_off(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = Scene(monkeypatch, adjust=False)
    scene.consistency.consistent.append([4])
    scene.process(20)
    assert len(scene.events) == 1
    assert "start adjustment" not in scene.calls


def test_switched_off_keyframes_are_indexed_only(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = Scene(monkeypatch, enabled=False)
    scene.consistency.consistent.append([4])
    scene.process(20)
    assert scene.index.added == [20]
    assert scene.events == []
    assert scene.consistency.consistent, "nobody asked"


def test_a_keyframe_that_died_in_the_queue_is_left_out(scene: Scene) -> None:
    """The original treats it like a living one (OD-96)."""
    scene.map.dead.add(20)
    scene.process(20)
    assert scene.index.added == []


def test_a_keyframe_that_dies_at_the_end_of_its_lease_leaves_the_index(scene: Scene) -> None:
    scene.map.dies_after_lease = True
    scene.process(20)
    assert scene.index.erased == [20]


def test_the_lease_ends_with_an_error_too(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr(loop_closing.core, "find_loop_candidates", fails)
    with pytest.raises(ZeroDivisionError):
        scene.closing.process(20)
    assert scene.map.leases == []


def test_reset_forgets_the_gap(scene: Scene) -> None:
    scene.consistency.consistent.extend([[4], [4]])
    scene.process(20)
    scene.closing.reset()
    assert scene.closing.last_keyframe == -1
    scene.process(5)
    assert [loop.current_keyframe for loop in scene.closing.loops] == [20, 5]


class FakeMerging:
    """Joins with the first place in another map."""

    def __init__(self, world: FakeMap, *_: object, fixes_scale: object, config: object) -> None:
        self.map = world

    def reset(self) -> None:
        pass

    def choose(self, elsewhere: list[FakeLoop], others: object) -> FakeLoop | None:
        return elsewhere[0] if elsewhere else None

    def join(self, loop: FakeLoop, *_: object) -> SimpleNamespace:
        self.map.maps.clear()
        return SimpleNamespace(map_index=0)


@pytest.fixture
def joined(monkeypatch: pytest.MonkeyPatch) -> Scene:
    """Keyframe 20 of map 1 has shown the place of keyframe 4 of map 0."""
    monkeypatch.setattr(loop_closing, "MapMerging", FakeMerging)
    scene = Scene(monkeypatch)
    scene.map.maps[20] = 1
    scene.consistency.consistent.append([4])
    scene.process(20)
    assert len(scene.merged) == 1
    assert scene.calls.count("start adjustment") == 1
    return scene


def test_a_joined_map_is_adjusted_again_when_more_of_the_seam_was_seen(joined: Scene) -> None:
    joined.process(*range(21, 30))
    assert joined.calls.count("start adjustment") == 1
    joined.process(30)
    assert joined.calls.count("start adjustment") == 2
    joined.process(*range(31, 60))
    assert joined.calls.count("start adjustment") == 2


def test_a_loop_over_the_seam_is_adjusted_once(joined: Scene) -> None:
    joined.consistency.consistent.append([4])
    joined.process(30)
    assert len(joined.events) == 1
    joined.process(*range(31, 45))
    assert joined.calls.count("start adjustment") == 2


def test_no_seam_is_adjusted_in_a_map_that_was_dropped(joined: Scene) -> None:
    joined.map.dropped.add(0)
    joined.process(30)
    joined.map.dropped.clear()
    joined.process(31)
    assert joined.calls.count("start adjustment") == 1


def test_a_reset_forgets_the_seam(joined: Scene) -> None:
    joined.closing.reset()
    joined.process(30)
    assert joined.calls.count("start adjustment") == 1


def test_an_upright_map_of_one_camera_has_a_scale() -> None:
    """With an IMU in both maps loops and merges keep the scale; without it in one they do not."""
    upright = {1: True, 2: False}
    slam_map = SimpleNamespace(
        map_of=lambda keyframe: keyframe // 10, is_upright=lambda number: upright.get(number, False)
    )
    closing = object.__new__(LoopClosing)
    closing._map = slam_map  # type: ignore[assignment]
    for has_depth, keyframes, fixed in (
        (False, (10, 11), True),
        (False, (10, 20), False),
        (False, (20, 21), False),
        (True, (20, 21), True),
    ):
        closing._has_depth = has_depth
        assert closing._fixes_scale(*keyframes) is fixed

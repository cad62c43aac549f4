# SPDX-License-Identifier: BSD-3-Clause
"""A tracker among fakes."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np

from orbslam2py import Reason, Sensor, TrackingState, _core
from orbslam2py._timing import StageTimer
from orbslam2py.slam.acceptance.multi_hypothesis_search import MultiHypothesisSearch
from orbslam2py.slam.acceptance.pose_acceptance import PoseAcceptance
from orbslam2py.slam.acceptance.pose_validator import PoseValidator
from orbslam2py.slam.config import AcceptanceConfig, Config, KeyframeConfig, TrackingConfig
from orbslam2py.slam.keyframe_decision import KeyframeDecision
from orbslam2py.slam.pose_search import LocalMapSearch, PoseSearch, RefinedPose
from orbslam2py.slam.records import TrackingResult
from orbslam2py.slam.state import State
from orbslam2py.slam.tracking import Tracking

MAX_FRAMES = 30
N_FEATURES = 1000
OUTLIERS = np.array([7, 9])


def pose(x: float) -> _core.Pose:
    return _core.Pose([0, 0, 0, 1], [x, 0, 0])


class FakeFrame:
    """Counts what is done to it."""

    def __init__(self, frame_id: int) -> None:
        self.id = frame_id
        self.timestamp = frame_id / 30
        self.features = SimpleNamespace(
            size=1000,
            depth=np.ones(1000, np.float32),
            described=False,
            frame_id=frame_id,
            id=frame_id,
        )
        self.T_cw: _core.Pose | None = None
        self.reference_keyframe = -1
        self.map_points = np.arange(100)
        self.outlier = np.zeros(100, np.uint8)
        self.close_counts = (200, 0)
        self.n_cleared = 0
        self.n_discards = 0
        self.anchor_x = 0.0
        self.big_change = 0
        self.map_index = 0

    def share_anchor(self, other: FakeFrame) -> None:
        self.anchor_x, self.big_change = other.anchor_x, other.big_change
        self.reference_keyframe = other.reference_keyframe

    def take_over(self, other: FakeFrame) -> None:
        assert other.id == self.id
        self.T_cw = other.T_cw
        self.share_anchor(other)

    def clear_associations(self) -> None:
        self.n_cleared += 1

    def discard_outliers(self) -> np.ndarray:
        self.n_discards += 1
        return OUTLIERS

    def n_associated(self) -> int:
        return 321

    def n_map_inliers(self) -> int:
        of_map = (self.map_points >= 0) & (self.map_points < _core.FIRST_TEMPORARY_POINT)
        return int(np.count_nonzero(of_map & (self.outlier == 0)))

    def n_close_tracked_untracked(self) -> tuple[int, int]:
        return self.close_counts


class FakeMap:
    def __init__(self) -> None:
        self.n_keyframes = 10
        self.n_points = 1000
        self.keyframe_x = 0.0
        self.stretched = 1.0
        self.big_change_index = 0
        self.culled: dict[int, int] = {}

        self.active_map = 0
        self.maps = [0]

    def living(self, keyframe: int) -> int:
        return self.culled.get(keyframe, keyframe)

    @property
    def n_active_keyframes(self) -> int:
        return self.n_keyframes

    def n_points_of(self, map_index: int) -> int:
        return self.n_points if map_index == self.active_map else 0

    def keyframe_pose(self, keyframe: int) -> _core.Pose:
        return pose(self.keyframe_x)

    def map_of(self, keyframe: int) -> int:
        return 0 if keyframe >= 0 else -1

    def map_of_point(self, point: int) -> int:
        return 0

    def root(self, map_index: int) -> int:
        return 0

    def begin_map(self) -> int:
        return self.active_map

    def best_neighbours(self, keyframe: int, n: int) -> np.ndarray:
        return np.array([keyframe + 1000])


class FakeWorker:
    def __init__(self) -> None:
        self.pausing = False
        self.idle = True
        self.n_waiting = 0
        self.n_interrupts = 0

    def interrupt(self) -> None:
        self.n_interrupts += 1


class FakeMapping:
    def __init__(self) -> None:
        self.worker = FakeWorker()
        self.inserted: list[int] = []

    def insert_keyframe(self, keyframe: int) -> None:
        self.inserted.append(keyframe)


@dataclass
class FakeCore:
    """The verbs tracking calls; each takes its next answer from a list, or its usual one."""

    Pose, Velocity = _core.Pose, _core.Velocity
    FIRST_TEMPORARY_POINT = _core.FIRST_TEMPORARY_POINT
    motion: deque[int] = field(default_factory=deque)
    words: deque[int] = field(default_factory=deque)
    inliers: deque[int] = field(default_factory=deque)
    n_reference: int = 100
    local_reference: int = 4
    calls: list[str] = field(default_factory=list)
    windows: list[float] = field(default_factory=list)
    forward: list[bool] = field(default_factory=list)
    reference_keyframes: list[int] = field(default_factory=list)
    radius_factors: list[float] = field(default_factory=list)
    discarded: list[np.ndarray] = field(default_factory=list)
    min_observations: list[int] = field(default_factory=list)
    start_poses: list[float] = field(default_factory=list)
    #: Ids of the frames that became keyframes.
    inserted: list[int] = field(default_factory=list)
    #: Rotation of the next small images and their correlation; none: they say nothing.
    aligned: deque[SimpleNamespace] = field(default_factory=deque)
    n_cells: int = 30
    #: Cluster-robust, of every pose.
    covariance: np.ndarray = field(default_factory=lambda: np.eye(6))
    match_error: float = 0.6
    #: Pixels that the points moved in the image since the last frame.
    displacement: float = 0.0
    #: Of what the motion model finds, in localization mode.
    n_map_points: int = 100
    #: Of the inliers, after three more frames of the present speed; how far that was.
    n_staying: int = 1000
    looked_ahead: float = 0.0
    #: What each stated covariance was made with: velocity, motion of the map, share of wrong poses.
    stated: list[tuple[Any, Any, float]] = field(default_factory=list)
    #: Points in view that are not held before the local map is matched.
    n_visible: int = 3

    @property
    def n_inserted(self) -> int:
        return len(self.inserted)

    def TrackedFrame(self, features: SimpleNamespace) -> FakeFrame:
        version = FakeFrame(features.frame_id)
        version.features = features
        return version

    def align_rotation(self, last: Any, features: Any) -> SimpleNamespace | None:
        self.calls.append("align")
        return self.aligned.popleft() if self.aligned else None

    def pose_evidence(self, frame: FakeFrame) -> tuple[int, int, float, np.ndarray]:
        return self.n_cells, 4, self.match_error, self.covariance

    def predict_pose(
        self, frame: FakeFrame, last: FakeFrame, velocity: _core.Velocity | None
    ) -> None:
        assert last.T_cw is not None
        frame.T_cw = last.T_cw
        if velocity is not None:
            frame.T_cw = velocity.over(frame.timestamp - last.timestamp) @ last.T_cw
        frame.share_anchor(last)

    def velocity_between(
        self, last: FakeFrame, frame: FakeFrame, *, consecutive: bool
    ) -> _core.Velocity | None:
        assert consecutive
        if frame.id != last.id + 1 or frame.big_change != last.big_change:
            return None
        assert last.T_cw is not None and frame.T_cw is not None
        T_cl = frame.T_cw @ last.T_cw.inverse()
        return _core.Velocity(T_cl, frame.timestamp - last.timestamp)

    def change_from_prediction(
        self, frame: FakeFrame, last: FakeFrame, velocity: _core.Velocity | None
    ) -> tuple[float, float]:
        if velocity is None or frame.T_cw is None:
            return 0.0, 0.0
        expected = FakeFrame(frame.id)
        self.predict_pose(expected, last, velocity)
        assert expected.T_cw is not None
        return frame.T_cw.difference(expected.T_cw)

    def stated_covariance(
        self,
        covariance: np.ndarray,
        factor: float,
        frame: FakeFrame,
        last: FakeFrame,
        velocity: _core.Velocity | None,
        map_motion: _core.Pose | None,
        wrong_share: float,
    ) -> np.ndarray:
        self.stated.append((velocity, map_motion, wrong_share))
        return factor * covariance

    def median_displacement(self, frame: FakeFrame, T_nw: _core.Pose) -> float:
        return self.displacement

    def count_staying(self, frame: FakeFrame, T_nw: _core.Pose) -> int:
        return self.n_staying

    def count_staying_after(
        self, frame: FakeFrame, velocity: _core.Velocity, n_intervals: float
    ) -> int:
        self.looked_ahead = n_intervals * float(velocity.step.translation[0])
        return self.n_staying

    def PointBatch(self) -> str:
        return "no points"

    def follow_map(self, world: FakeMap, frame: FakeFrame) -> tuple[str, float, _core.Pose | None]:
        assert frame.T_cw is not None
        before, big_change = frame.T_cw, frame.big_change
        frame.T_cw = before @ pose(world.keyframe_x - frame.anchor_x)
        frame.anchor_x = world.keyframe_x
        frame.big_change = world.big_change_index
        by_loop = frame.big_change != big_change
        return "points", world.stretched, None if by_loop else frame.T_cw @ before.inverse()

    def anchor_frame(self, world: FakeMap, frame: FakeFrame, keyframe: int) -> None:
        frame.anchor_x = world.keyframe_x
        frame.reference_keyframe = keyframe

    def add_temporary_points(self, last: FakeFrame, points: str) -> int:
        return 0

    def count_map_points(self, frame: FakeFrame) -> int:
        return self.n_map_points

    def discard_temporary(self, frame: FakeFrame) -> int:
        return 0

    def match_last_frame(
        self, frame: FakeFrame, last: FakeFrame, points: str, window: float, has_depth: bool
    ) -> int:
        assert points == "points"
        assert frame.T_cw is not None
        self.calls.append("motion")
        self.windows.append(window)
        self.start_poses.append(float(frame.T_cw.matrix[0, 3]))
        return self.motion.popleft() if self.motion else 50

    def match_keyframe_by_words(
        self, world: FakeMap, keyframe: int, frame: FakeFrame, ratio: float
    ) -> int:
        assert frame.features.described
        assert ratio == 0.7
        assert frame.T_cw is not None
        self.calls.append("words")
        self.reference_keyframes.append(keyframe)
        self.start_poses.append(float(frame.T_cw.matrix[0, 3]))
        return self.words.popleft() if self.words else 50

    def describe(self, frame: Any, vocabulary: str) -> None:
        assert vocabulary == "vocabulary"
        frame.described = True

    def optimize_pose(self, frame: FakeFrame) -> SimpleNamespace:
        self.calls.append("optimize")
        n = self.inliers.popleft() if self.inliers else 100
        return SimpleNamespace(n_inliers=n, covariance=np.eye(6) * n)

    def estimate_pose(self, frame: FakeFrame) -> tuple[int, np.ndarray, np.ndarray]:
        found = self.optimize_pose(frame)
        return found.n_inliers, found.covariance, frame.discard_outliers()

    def optimize_aligned(
        self, world: FakeMap, frame: FakeFrame, most: int, fewest: int
    ) -> tuple[int, int, int, np.ndarray]:
        found = self.optimize_pose(frame)
        return found.n_inliers, frame.n_associated(), frame.n_map_inliers(), found.covariance

    def pose_covariance(self, frame: FakeFrame) -> np.ndarray:
        assert frame.T_cw is not None
        return np.diag([1.0, 1, 1, 2, 2, 2])

    def select_local_map(self, world: FakeMap, frame: FakeFrame) -> SimpleNamespace:
        self.calls.append("local map")
        if self.local_reference >= 0:
            frame.reference_keyframe = self.local_reference
            frame.big_change = world.big_change_index
        return SimpleNamespace(reference_keyframe=self.local_reference, points="local points")

    def match_local_map(
        self, frame: FakeFrame, local_map: SimpleNamespace, discarded: np.ndarray, factor: float
    ) -> tuple[np.ndarray, int]:
        assert local_map.points == "local points"
        self.radius_factors.append(factor)
        self.discarded.append(discarded)
        return np.arange(self.n_visible), frame.n_associated() + self.n_visible

    def count_sightings(self, world: FakeMap, frame: FakeFrame, visible: np.ndarray) -> None:
        assert len(visible) == self.n_visible
        self.calls.append("sightings")

    def count_tracked_points(self, world: FakeMap, keyframe: int, min_observations: int) -> int:
        self.min_observations.append(min_observations)
        return self.n_reference

    def insert_keyframe(self, world: FakeMap, frame: FakeFrame, create_points: bool) -> int:
        assert frame.features.described
        assert create_points
        self.inserted.append(frame.id)
        frame.reference_keyframe = 100 + self.n_inserted
        return 100 + self.n_inserted


class FakeInitializer:
    """Refuses a given number of frames."""

    feature_factor = 1

    def __init__(self, refusals: int = 0) -> None:
        self.refusals = refusals

    def remember(self, frame: FakeFrame) -> None:
        """Frames of a young map are not needed again."""

    def remembered(self) -> list[FakeFrame]:
        return []

    def restart(self, frames: list[FakeFrame]) -> None:
        assert not frames

    def n_between(self) -> int:
        return 0

    def take_earlier(self) -> tuple[FakeFrame, ...]:
        return ()

    def reset(self) -> None:
        self.refusals = 0

    def shows_enough(self, frame: FakeFrame) -> bool:
        return bool(frame.features.size > 100)

    def lines(self) -> None:
        """None: one frame is enough."""

    def try_initialize(self, frame: FakeFrame, T_cw: _core.Pose | None = None) -> Reason:
        if self.refusals:
            self.refusals -= 1
            return Reason.TOO_FEW_KEYPOINTS
        frame.T_cw = pose(0)
        frame.reference_keyframe = 0
        return Reason.NONE


#: Whatever is found is believed.
CREDULOUS = AcceptanceConfig(
    sudden_share=0,
    weak_share=0,
    refused_share=0,
)


class NoFurtherSearch:
    """What was not found at first is not found."""

    def search_again(self, frame: FakeFrame, first: Any, state: State) -> Any:
        return first, state


class NearSearch(LocalMapSearch):
    """Matches no frame afresh, and notes which it was asked to."""

    def __init__(self, *parts: Any, **limits: Any) -> None:
        super().__init__(*parts, **limits)
        #: Ids of frames, and whether they were in doubt.
        self.looked_afresh: list[tuple[int, bool]] = []

    def rematch(self, refined: RefinedPose, *, in_doubt: bool) -> RefinedPose:
        self.looked_afresh.append((refined.frame.id, in_doubt))
        return refined


class Scene:
    """A tracker among fakes, which believes what it finds unless it is given `evidence`."""

    def __init__(
        self,
        sensor: Sensor,
        core: FakeCore,
        config: TrackingConfig | None = None,
        evidence: AcceptanceConfig | None = None,
    ) -> None:
        self.core = core
        self.map = FakeMap()
        self.mapping = FakeMapping()
        self.initializer = FakeInitializer()
        #: Track in localization mode.
        self.localize = False
        fakes: Any = self
        vocabulary: Any = "vocabulary"
        limits = config or TrackingConfig()
        self.search = search = PoseSearch(
            fakes.map, vocabulary, sensor, relocalizer=None, config=limits
        )
        self.local_map_search = NearSearch(fakes.map, sensor, limits)
        search.local_map_search = self.local_map_search
        judge = PoseValidator(search.motion_model_window, 500.0, evidence or CREDULOUS)
        again: Any = NoFurtherSearch() if evidence is None else MultiHypothesisSearch(search, judge)
        self.tracking = Tracking(
            fakes.map,
            vocabulary,
            fakes.mapping,
            initializer=fakes.initializer,
            search=search,
            acceptance=PoseAcceptance(search, judge, again),
            keyframe_decision=KeyframeDecision(
                fakes.map,
                fakes.mapping.worker,
                sensor,
                MAX_FRAMES,
                KeyframeConfig(spacing_with_depth=1),
            ),
            config=Config(),
            has_depth=sensor.has_depth,
        )
        self.frames: list[FakeFrame] = []

    def track(self, frame_id: int | None = None, **attributes: Any) -> TrackingResult:
        frame = FakeFrame(len(self.frames) if frame_id is None else frame_id)
        for name, value in attributes.items():
            setattr(frame, name, value)
        self.frames.append(frame)
        image: Any = frame
        return self.tracking.track(image, StageTimer(), localize=self.localize)

    def run(self, n: int) -> None:
        """So many frames that make no keyframe."""
        self.core.n_reference, before = 0, self.core.n_reference
        for _ in range(n):
            assert self.track().state is TrackingState.OK
        self.core.n_reference = before

    @property
    def last(self) -> FakeFrame:
        return self.frames[-1]


def lose(scene: Scene) -> TrackingResult:
    scene.core.motion.extend([0, 0])
    scene.core.words.append(0)
    return scene.track()


def every_way_ends_elsewhere(core: FakeCore) -> Callable[[FakeFrame], SimpleNamespace]:
    """A pose optimisation that ends far from where any before it did, for `core`'s."""
    original = core.optimize_pose
    places = iter(range(1000))

    def elsewhere(frame: FakeFrame) -> SimpleNamespace:
        estimate = original(frame)
        frame.T_cw = pose(100.0 * next(places))
        estimate.covariance = 1e-6 * np.eye(6)
        return estimate

    return elsewhere

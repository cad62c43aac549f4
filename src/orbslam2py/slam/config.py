# SPDX-License-Identifier: BSD-3-Clause
"""The configuration of the method: one section per stage, one number per threshold.

The defaults are the published system's unless a field says otherwise; ``docs/method`` says chapter
by chapter where each comes from. Thresholds of single steps are in their C++ files. Names with a
dot, as in ``tracking.map_matches``, reach every field from the command line, job files and Python.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

from orbslam2py._arguments import is_finite, is_whole, shown
from orbslam2py.errors import SettingsError
from orbslam2py.settings.sensor import Sensor
from orbslam2py.slam.inertial_config import InertialConfig

#: The numbers of inliers below are for images with so many features or more. Of fewer ones a share
#: is asked for: fewer points meet fewer keypoints by chance, and fewer can be found of them.
USUAL_FEATURES, LEAST_SHARE = 1000, 0.6
_INLIERS = (
    *("tracking.local_map_inliers", "tracking.scarce_inliers"),
    *("relocalization.enough", "relocalization.narrow"),
)


@dataclass(frozen=True)
class InitializationConfig:
    """Start of a map."""

    keypoints_with_depth_sensor: int = 500
    """A stereo or RGB-D frame begins a map only with more keypoints than this (ORB-SLAM2)."""
    depths: int = 100
    """Fewest keypoints with a depth in a stereo or RGB-D frame that begins a map."""
    keypoints: int = 100
    """Each of the two views of a single camera must have more keypoints than this (ORB-SLAM)."""
    matches: int = 100
    """Fewest matches between the two views of a single camera (ORB-SLAM)."""
    window: float = 100.0
    """Half width of the search window for matches from frame to frame, pixels; the second search,
    after the first found too few matches, is twice as wide."""
    displacement: float = 5.0
    """A frame is kept as a view when its keypoints moved by this median since the last view, and
    two views are reconstructed when theirs did, pixels."""
    parallax: float = 1.0
    """Smallest median parallax of the points of a first map, degrees (ORB-SLAM)."""
    third_view_share: float = 0.2
    """A third view is used when it moved by this share of the motion between the two views,
    away from both."""
    third_view_points: int = 30
    """Fewest points of the two views that a third view must see, and fewest matches of a view that
    can only confirm a motion; two thirds when no view sees so many."""
    third_view_fits: float = 0.75
    """A third view confirms a motion when it sees this share of the points where the motion
    puts them."""
    clearly_worse: float = 2.0
    """An ambiguous motion is ruled out when its mean error in third views is this factor
    larger."""
    clearly_worse_alternative: float = 1.75
    """An ambiguous motion is ruled out when its mean error in all views together is this
    factor larger."""
    same_direction: float = 20.0
    """Two motions count as one when their directions differ by less than this, degrees."""
    compare_views: bool = True
    """Begin a map only when all kept views together prefer one motion."""
    other_direction: float = 30.0
    """A motion of such a run is an alternative when its direction differs by more than this,
    degrees."""
    clearly_worse_direction: float = 1.1
    """An alternative is ruled out when its mean error in all views is this factor larger."""
    points: int = 100
    """Fewest points of a single camera's first map."""
    feature_factor: int = 2
    """Number of features while a single camera begins a map, as a multiple of the settings'
    number (ORB-SLAM)."""
    raised_feature_factor: int = 4
    """The same multiple after a long wait for a first map."""
    view_between: float = 0.9
    """A view between the first two becomes a keyframe when it finds less than this share of
    the first points."""


@dataclass(frozen=True)
class TrackingConfig:
    """Required matches and inliers of a pose, and search windows."""

    motion_model_window: float = 15.0
    """Half width of the search window around predicted keypoints, pixels at level 0
    (ORB-SLAM)."""
    motion_model_window_stereo: float = 7.0
    """The same for a stereo pair, whose prediction is more exact (ORB-SLAM2)."""
    motion_model_widening: float = 2.0
    """Factor on that window for a second search, after the first found too few matches
    (ORB-SLAM)."""
    motion_model_matches: int = 20
    """Fewest matches with the last frame (ORB-SLAM)."""
    reference_ratio: float = 0.7
    """Largest ratio of best to second best descriptor distance in matching with the
    reference keyframe (ORB-SLAM)."""
    reference_matches: int = 15
    """Fewest matches with the reference keyframe (ORB-SLAM)."""
    map_matches: int = 10
    """Fewest inliers of the first pose estimate; in localization mode fewest inliers on map
    points (ORB-SLAM)."""
    localization_matches: int = 20
    """In localization mode the motion model needs more inliers than this (ORB-SLAM2)."""
    local_map_window: float = 1.0
    """Factor on the search radius around projected points of the local map (ORB-SLAM)."""
    local_map_window_rgbd: float = 3.0
    """The same with an RGB-D camera (ORB-SLAM2)."""
    local_map_window_after_relocalization: float = 5.0
    """The same in the first frames after a relocalization (ORB-SLAM)."""
    afresh_share: float = 0.9
    """That pose is taken when it keeps this share of the inliers and differs."""
    afresh_share_in_doubt: float = 0.6
    """The same share when the first pose was uncertain."""
    frames_after_relocalization: int = 2
    """Number of frames after a relocalization with wide windows and without a motion model
    (ORB-SLAM)."""
    local_map_inliers: int = 30
    """Fewest inliers in the local map (ORB-SLAM)."""
    small_map: int = 5
    """A map with this number of keyframes or fewer is dropped when tracking is lost
    (ORB-SLAM)."""
    feature_factor: int = 2
    """Multiple of the settings' number of features for a single camera that is lost,
    localizes, or has few inliers."""
    scarce_inliers: int = 100
    """Fewer inliers than this are few."""


@dataclass(frozen=True)
class AcceptanceConfig:
    """Evidence required for a pose, and the search of other hypotheses."""

    search_again: bool = True
    """Search other hypotheses when the evidence for a pose falls."""
    robust_covariance: bool = True
    """State the cluster-robust covariance of a pose, with map motion and innovation, instead of
    that of independent pixel noise."""
    expected_error: float = 0.8
    """Median error of the matches, in standard deviations, beyond which the covariance grows
    with its square."""
    wrong_share: float = 0.02
    """With this probability the pose is assumed to be wrong by the whole innovation; the
    covariance grows accordingly."""
    sudden_share: float = 0.6
    """Other hypotheses are searched below this share of the mean inliers, or of the mean
    visibility ratio."""
    weak_share: float = 0.5
    """A pose is uncertain below this share of the mean inliers and of the mean visibility
    ratio."""
    refused_share: float = 0.3
    """A pose is rejected below this share of the mean inliers, unless a second method
    confirms it."""
    refused_inliers: int = 100
    """Only a pose with fewer inliers than this is rejected."""
    aligned_correlation: float = 0.6
    """Smallest correlation of two small images that gives a rotation (Klein and Murray 2008)."""


@dataclass(frozen=True)
class KeyframeConfig:
    """Which frames become keyframes."""

    few_keyframes: int = 2
    """A map with this number of keyframes or fewer is new; a point of its reference keyframe counts
    when as many keyframes see it (ORB-SLAM)."""
    observations: int = 3
    """In a larger map, a point of the reference keyframe counts when this number of
    keyframes see it (ORB-SLAM)."""
    share: float = 0.75
    """A frame sees new things when it tracks less than this share of its reference
    keyframe's points (ORB-SLAM2)."""
    share_of_first: float = 0.4
    """The same share while there is one keyframe (ORB-SLAM2)."""
    share_monocular: float = 0.9
    """The same share with a single camera (ORB-SLAM)."""
    weak_share: float = 0.25
    """Below this share a keyframe does not wait for mapping, with stereo and RGB-D (ORB-SLAM2)."""
    few_close_points: int = 100
    """Fewer tracked close points than this are few; a keyframe is needed if many others are
    not in the map (ORB-SLAM2)."""
    many_untracked_close_points: int = 70
    """More close points than this outside the map are many (ORB-SLAM2)."""
    kept_share: float = 0.65
    """A keyframe is needed when a frame tracks less than this share of the most inliers since the
    last keyframe, or when less than this share of its inliers stays in view, with stereo and
    RGB-D."""
    few_inliers: int = 150
    """Fewer inliers than this are few; a single camera then needs a keyframe if the view is
    new."""
    new_view: float = 5.0
    """A view is new when the inliers moved by this median since the last keyframe, rotation
    excluded, pixels."""
    inliers: int = 15
    """A keyframe needs more inliers than this (ORB-SLAM)."""
    spacing_with_depth: int = 2
    """Least number of frames from one keyframe to the next with stereo and RGB-D, unless tracking
    is weak. With a single camera it is 1."""


@dataclass(frozen=True)
class RelocalizationConfig:
    """Relocalization of a lost frame."""

    ratio: float = 0.75
    """Largest ratio of best to second best descriptor distance in matching by words
    (ORB-SLAM)."""
    matches: int = 15
    """Fewest matches by words of a candidate keyframe (ORB-SLAM)."""
    iterations: int = 5
    """RANSAC iterations of each candidate per turn (ORB-SLAM)."""
    inliers: int = 10
    """Fewest inliers of a pose that is refined with further matches (ORB-SLAM)."""
    enough: int = 50
    """Inliers of a successful relocalization (ORB-SLAM)."""
    narrow: int = 30
    """With more inliers than this, but too few, a narrow window is searched as well (ORB-SLAM). At
    the pose where tracking was just lost, or where the motion led, so many are enough."""
    wide_window: float = 10.0
    """Search radius of the first refinement, pixels at level 0 (ORB-SLAM)."""
    wide_distance: int = 100
    """Largest descriptor distance of the first refinement, bits (ORB-SLAM)."""
    narrow_window: float = 3.0
    """Search radius of the second refinement, pixels at level 0 (ORB-SLAM)."""
    narrow_distance: int = 64
    """Largest descriptor distance of the second refinement, and around a guessed pose, bits
    (ORB-SLAM)."""
    guess_window: float = 30.0
    """Search radius around the points of keyframes near a guessed pose, pixels at level 0."""
    rival_share: float = 0.6
    """A place is ambiguous when another place shows more than this share of its points."""
    common_points: int = 15
    """A relocalization is confirmed only when the next frame shares this number of points."""
    confirming_cosine: float = 0.87
    """A relocalization is confirmed only when the cosine of the rotation to the next frame
    is at least this."""


@dataclass(frozen=True)
class MappingConfig:
    """The neighbourhood of a new keyframe in local mapping."""

    neighbours: int = 10
    """Number of covisible keyframes with which points are triangulated and fused, with
    stereo and RGB-D (ORB-SLAM2)."""
    neighbours_monocular: int = 20
    """The same with a single camera (ORB-SLAM)."""
    observations: int = 3
    """A recent point seen by this number of keyframes or fewer is dropped two keyframes
    later (ORB-SLAM2)."""
    observations_monocular: int = 2
    """The same with a single camera (ORB-SLAM)."""
    adjusted_keyframes: int = 2
    """Local bundle adjustment begins with more keyframes than this (ORB-SLAM)."""


@dataclass(frozen=True)
class LoopConfig:
    """Search of loops."""

    gap: int = 10
    """Number of keyframes after a loop that are not searched for another (ORB-SLAM)."""
    firm_matches: int = 100
    """A loop with fewer matches than this waits for a better one."""


@dataclass(frozen=True)
class MergingConfig:
    """Evidence required for a merge of two maps."""

    confirmations: int = 2
    """Number of neighbours that must confirm it."""
    position: float = 0.15
    """Largest difference of a neighbour's position, in median depths of the other keyframe."""
    angle: float = 0.1
    """Largest difference of its rotation, radians."""
    log_scale: float = 0.2
    """Largest difference of its scale, as a logarithm."""
    explained: float = 0.17
    """Smallest share of visible points of the other map that the keyframe must find."""
    view_cosine: float = 0.87
    """A point is visible when the cosine of the angle to its earlier views is at least this."""


@dataclass(frozen=True)
class TrajectoryConfig:
    """How the poses of past frames are refined."""

    rematch_every_frame: bool = False
    """Match every frame with the map once more when that has settled, not only the first ones of a
    single camera's map."""


@dataclass(frozen=True)
class AlignmentConfig:
    """Which positions are measured by aligning patches of grey values."""

    rgbd: bool = True
    """Align with an RGB-D camera and 1000 features or more."""
    stereo: bool = False
    """Align with a stereo pair; helps where the rectification is exact."""
    monocular: bool = False
    """Align with a single camera; helps where the calibration is exact."""
    right_image: bool = False
    """Where stereo pairs are aligned, align the right image to the left one as well."""
    new_keyframes: bool = True
    """Align the sightings of new keyframes and new points before local bundle adjustment."""
    tracked_inliers: int = 100
    """Most inliers of a tracked frame that are aligned before its last pose optimization;
    0: none."""
    follow: bool = False
    """Where this sensor is aligned, track frames between two keyframes by patches alone and find
    features only where patches are not enough. One camera or RGB-D, without an IMU."""

    def for_sensor(self, sensor: Sensor) -> AlignmentConfig:
        """Return the values in use with a sensor."""
        on = {
            Sensor.RGBD: self.rgbd,
            Sensor.STEREO: self.stereo,
            Sensor.MONOCULAR: self.monocular,
            Sensor.RIG: False,
        }
        if not on[sensor]:
            return replace(
                self, right_image=False, new_keyframes=False, tracked_inliers=0, follow=False
            )
        stereo = sensor is Sensor.STEREO
        return replace(
            self, right_image=self.right_image and stereo, follow=self.follow and not stereo
        )

    @property
    def uses_points(self) -> bool:
        """Whether map points need a patch of their reference sighting."""
        return self.new_keyframes or self.tracked_inliers > 0


@dataclass(frozen=True)
class Config:
    """All sections of the configuration.

    Examples
    --------
    >>> config = Config().with_changes({"tracking.map_matches": 12})
    >>> config.tracking.map_matches
    12
    >>> config.changes()
    {'tracking.map_matches': 12}
    """

    initialization: InitializationConfig = field(default_factory=InitializationConfig)
    tracking: TrackingConfig = field(default_factory=TrackingConfig)
    acceptance: AcceptanceConfig = field(default_factory=AcceptanceConfig)
    keyframes: KeyframeConfig = field(default_factory=KeyframeConfig)
    relocalization: RelocalizationConfig = field(default_factory=RelocalizationConfig)
    mapping: MappingConfig = field(default_factory=MappingConfig)
    loops: LoopConfig = field(default_factory=LoopConfig)
    merging: MergingConfig = field(default_factory=MergingConfig)
    trajectory: TrajectoryConfig = field(default_factory=TrajectoryConfig)
    alignment: AlignmentConfig = field(default_factory=AlignmentConfig)
    inertial: InertialConfig = field(default_factory=InertialConfig)

    def with_changes(self, changes: Mapping[str, Any]) -> Config:
        """Return a configuration with other values.

        Parameters
        ----------
        changes : mapping
            Values by their names with a dot: ``{"tracking.map_matches": 12}``.

        Raises
        ------
        SettingsError
            If a name does not exist, or a value is not of its kind.
        """
        sections: dict[str, dict[str, Any]] = {}
        for name, value in changes.items():
            default = value_of(self, name)
            section, _, option = name.partition(".")
            sections.setdefault(section, {})[option] = _converted(name, value, default)
        # All of a section at once.
        changed = {name: replace(getattr(self, name), **new) for name, new in sections.items()}
        return replace(self, **changed)

    def changes(self) -> dict[str, float | int | bool]:
        """Return the differences from the defaults, by names with a dot."""
        usual = Config()
        return {name: value for name, value in all_values(self) if value != value_of(usual, name)}

    def for_features(self, n_features: int) -> Config:
        """Return the configuration for this number of features.

        With fewer than usual, fewer inliers are required. Sightings are not aligned then: in fast
        motion the few inliers are lost (``docs/method/alignment.md``).
        """
        share = min(1.0, max(LEAST_SHARE, n_features / USUAL_FEATURES))
        changes = {name: math.ceil(share * value_of(self, name)) for name in _INLIERS}
        aligned = self.alignment.rgbd and n_features >= USUAL_FEATURES
        return self.with_changes({**changes, "alignment.rgbd": aligned})


#: Named sets of changes to the defaults.
PRESETS: Mapping[str, Mapping[str, float | int | bool]] = {
    # Fewer keyframes.
    "fast": {
        "keyframes.spacing_with_depth": 4,
        "keyframes.share": 0.6,
        "keyframes.share_monocular": 0.8,
    },
    # Features only where patches are not enough.
    "light": {"alignment.follow": True, "alignment.monocular": True},
    "normal": {},
    "thorough": {"trajectory.rematch_every_frame": True},
}


def all_values(config: Config) -> Iterator[tuple[str, float | int | bool]]:
    """Yield every value with its name with a dot, in the order of the sections."""
    for section in fields(config):
        values = getattr(config, section.name)
        for option in fields(values):
            yield f"{section.name}.{option.name}", getattr(values, option.name)


def value_of(config: Config, name: str) -> float | int | bool:
    """Return the value with this name.

    Raises
    ------
    SettingsError
        If there is none; the message gives the nearest name.
    """
    known = dict(all_values(config))
    if name in known:
        return known[name]
    near = difflib.get_close_matches(str(name), known, 1, 0.5)
    # A field may also be named without its section.
    near = near or [full for full in known if full.partition(".")[2] == name]
    hint = f"did you mean {near[0]}?" if near else "'orbslam2py config' lists all names"
    raise SettingsError(f"the configuration has no value {shown(name)}; {hint}")


def read_change(text: str) -> tuple[str, float | int | bool]:
    """Parse a change in the notation of the command line: ``tracking.map_matches=12``.

    Raises
    ------
    SettingsError
        If it is not written so, or the name or the value is wrong.
    """
    name, equals, value = (part.strip() for part in text.partition("="))
    if not (name and equals and value):
        raise SettingsError(
            f"{shown(text)} is no change of the configuration; write NAME=VALUE, such as "
            "tracking.map_matches=12"
        )
    given: Any = {"true": True, "false": False}.get(value.lower(), value)
    if isinstance(given, str):
        try:
            given = int(value) if value.lstrip("+-").isdecimal() else float(value)
        except ValueError:
            given = value
    changed = Config().with_changes({name: given})
    return name, value_of(changed, name)


def _converted(name: str, value: Any, default: float | int | bool) -> float | int | bool:
    """Check a value against the kind of its default."""
    if isinstance(default, bool):
        if isinstance(value, bool):
            return value
        raise SettingsError(f"{name} is {shown(value)}; give true or false")
    if not is_finite(value) or value < 0:
        raise SettingsError(f"{name} is {shown(value)}; give a number from 0 on, now {default}")
    if isinstance(default, int):
        if not (is_whole(value) or float(value).is_integer()):
            raise SettingsError(f"{name} is {shown(value)}; give a whole number, now {default}")
        return int(value)
    return float(value)

# SPDX-License-Identifier: BSD-3-Clause
"""The configuration of the method: one section per stage, one number per threshold.

The defaults are the published system's unless a field says otherwise; ``docs/method`` says chapter
by chapter where each comes from. Thresholds of single steps stand beside them in C++. Names with a
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

#: Features of an image for which numbers of inliers are stated ...
USUAL_FEATURES = 1000
#: ... and the least share of them that is asked for where images have fewer.
LEAST_SHARE = 0.6


def _for_features(n_inliers: int, n_features: int) -> int:
    """Inliers that say as much of an image with fewer features.

    Fewer points meet fewer keypoints by chance, and fewer can be found of them.
    """
    share = min(1.0, max(LEAST_SHARE, n_features / USUAL_FEATURES))
    return math.ceil(share * n_inliers)


@dataclass(frozen=True)
class InitializationConfig:
    """How a map may begin."""

    keypoints_with_depth_sensor: int = 500
    """A stereo or RGB-D frame must have more keypoints than this to begin a map ..."""
    share_with_depth_sensor: float = 0.5
    """... or than this share of the settings' number of features, if that is less ..."""
    depths: int = 100
    """... and at least this many with depth, or the map would be lost at once."""
    keypoints: int = 100
    """Each of a single camera's two views must have more keypoints than this."""
    matches: int = 100
    """Fewest matches between two views of a single camera."""
    views: int = 6
    """So many views are kept ..."""
    new_view: float = 5.0
    """... each moved by a median of so many pixels against the one before."""
    distant_views: int = 3
    """So many views with fewer matches are kept beside them: they may confirm what is begun ..."""
    distant_matches: int = 30
    """... as long as they have so many."""
    window: float = 100.0
    """Half width of the search window from frame to frame, pixels ..."""
    wide_window: float = 200.0
    """... after that found too little ..."""
    narrow_window: float = 25.0
    """... and the least one, around where a view's keypoints should have moved."""
    displacement: float = 5.0
    """A view is tried when its keypoints have moved by a median of so many pixels."""
    tried_views: int = 3
    """So many of the views that have moved so far are tried with a frame, from the furthest on."""
    parallax: float = 1.0
    """Degrees of parallax that a motion chosen by third views must have."""
    third_view_share: float = 0.2
    """A third view says something if it has moved by this share of the way between the two, from
    both of them ..."""
    third_view_points: int = 30
    """... sees at least so many of the points that are placed between them ..."""
    fewer_third_view_points: int = 20
    """... or, where none does, so many ..."""
    third_view_fits: float = 0.75
    """... and agrees when it sees this share of the points where they should be."""
    clearly_worse: float = 2.0
    """Of motions that two views cannot tell apart, the others must fit third views worse than
    the right one by this factor ..."""
    clearly_worse_alternative: float = 1.75
    """... or, where they do not, all views together by this one."""
    same_direction: float = 20.0
    """Two that lead to within so many degrees of each other count as one."""
    compare_views: bool = True
    """Begin a map only when all kept views together prefer one motion."""
    further_draws: int = 5
    """So many more draws give motions that all views are asked to compare. One whose direction
    differs ..."""
    other_direction: float = 30.0
    """... by so many degrees from the best ..."""
    clearly_worse_direction: float = 1.1
    """... must fit worse by this factor, or the map waits for more parallax ..."""
    points: int = 100
    """... as it does as long as fewer points can be placed than a first map must have."""
    feature_factor: int = 2
    """Extracted features while a single camera starts, in multiples of the settings' number ..."""
    raised_feature_factor: int = 4
    """... and when it has not started ..."""
    patience: int = 10
    """... after so many frames ..."""
    patience_seconds: float = 1.0
    """... or so many seconds."""
    view_between: float = 0.9
    """Of the kept views between the two, those that find less than this share of the map's first
    points become keyframes as well."""
    remembered_frames: int = 200
    """So many frames are remembered, to be tracked in the map once it has begun ..."""
    followed_again: int = 20
    """... and so many of the last of them serve a new beginning, if the map came to nothing."""
    watched_frames: int = 60
    """In so many frames after a single camera's map began it is compared with what their matches
    say without it. If ..."""
    agreements: int = 2
    """... so many times the camera's way differs ..."""
    agreeing_direction: float = 15.0
    """... by less than so many degrees, the map is believed; if it does ..."""
    contradictions: int = 3
    """... so many times ..."""
    contradicting_direction: float = 35.0
    """... by more than so many, it is given up."""
    contradicted_maps: int = 3
    """After so many maps in a row that came to nothing by this, one is not compared."""
    settled_map: int = 10
    """With more keyframes than this a map has settled: bundle adjustment has moved its first
    points, and its first frames are looked at again ..."""
    young_frames: int = 250
    """... but no later than after so many of them."""


@dataclass(frozen=True)
class TrackingConfig:
    """When a pose is believed, and how far around a prediction is searched."""

    motion_model_window: float = 15.0
    """Half width of the search window around a predicted keypoint, pixels at level 0 ..."""
    motion_model_window_stereo: float = 7.0
    """... and for a stereo pair, whose points are predicted better."""
    motion_model_widening: float = 2.0
    """Factor on the window when it holds too few matches; it is widened once."""
    motion_model_matches: int = 20
    """Fewest matches with the last frame."""
    reference_ratio: float = 0.7
    """Best by second best descriptor distance, matching with the reference keyframe by words."""
    reference_matches: int = 15
    """Fewest matches with the reference keyframe."""
    map_matches: int = 10
    """Fewest inliers of the first pose estimate; in localization mode: of these on map points."""
    localization_matches: int = 20
    """In localization mode the motion model needs more inliers than this."""
    local_map_window: float = 1.0
    """Factor on the search radius around projected points of the local map ..."""
    local_map_window_rgbd: float = 3.0
    """... with an RGB-D camera ..."""
    local_map_window_after_relocalization: float = 5.0
    """... and in the frames right after a relocalization, with any sensor."""
    elsewhere: float = 3.0
    """A pose lies elsewhere if it is so many standard deviations of the position away."""
    afresh_window: float = 3.0
    """Matched with the local map from nothing, first by this factor on the search radius, a frame
    ..."""
    afresh_share: float = 0.9
    """... takes the pose with at least this share of the inliers that is `elsewhere` ..."""
    afresh_share_in_doubt: float = 0.6
    """... and if it was in doubt, the one with at least this share, wherever it is."""
    frames_after_relocalization: int = 2
    """How many frames that is; meanwhile there is no motion model either."""
    local_map_inliers: int = 30
    """Fewest inliers in the local map."""
    local_map_inliers_after_relocalization: int = 50
    """The same for the first second after a relocalization."""
    small_map: int = 5
    """A map with so few keyframes is given up when tracking is lost, and a new one is begun."""
    feature_factor: int = 2
    """Extracted features of a single camera in localization mode, of every second image while it is
    lost, and after a pose with fewer ..."""
    scarce_inliers: int = 100
    """... inliers than this, in multiples of the settings' number."""

    def for_features(self, n_features: int) -> TrackingConfig:
        """These limits for images with so many features: of few ones fewer are asked for."""
        after = self.local_map_inliers_after_relocalization
        return replace(
            self,
            local_map_inliers=_for_features(self.local_map_inliers, n_features),
            local_map_inliers_after_relocalization=_for_features(after, n_features),
            scarce_inliers=_for_features(self.scarce_inliers, n_features),
        )


@dataclass(frozen=True)
class AcceptanceConfig:
    """How much must speak for a pose, and where else it is looked for."""

    search_again: bool = True
    """Search other hypotheses when the evidence for a pose falls."""
    inflate_covariance: bool = True
    """State a larger covariance than that of independent pixel noise."""
    gain: float = 0.25
    """Weight of the newest frame in what is usual."""
    sudden_share: float = 0.6
    """Below this share of the usual inliers, or of the usual share of points in view, a pose is
    not believed before it was searched by other ways ..."""
    sudden_deviation: float = 2.5
    """... nor with a position so many times less certain than usual ..."""
    surprise_windows: float = 1.0
    """... nor if the camera turned otherwise than before by more than so many windows of the
    motion model, in pixels of the image."""
    weak_share: float = 0.5
    """Below this share of both, evidence is weak."""
    weak_cells: int = 4
    """With inliers in so few of the 48 cells of the image or fewer it is weak ..."""
    weak_deviation: float = 4.0
    """... and with a position this much less certain than usual."""
    weak_error: float = 1.5
    """... and with a median reprojection error so many times the usual one: a part of the image
    moves by itself, or the matches are wrong ..."""
    weak_error_spreads: float = 3.0
    """... unless errors vary as much from image to image: above the usual by so many times their
    mean deviation from it, as between images that are far apart."""
    honest_error: float = 0.8
    """Up to this median error, in standard deviations of keypoints, the stated covariance is that
    of the keypoints' noise; beyond it the standard deviations grow with the error ..."""
    doubtful_error: float = 1.3
    """... and beyond this with its square: then many matches are accidental ..."""
    largest_error: float = 10.0
    """... at most so many times, as they do for an error that is not the usual one."""
    surprise_pixels: float = 15.0
    """A camera that turned otherwise than before by so many pixels of the image is told with twice
    the variance, by twice as many ..."""
    largest_surprise: float = 2.0
    """... or more with five times; images far apart turn by any angle."""
    usual_deviation: float = 1.3
    """A position beyond so many times the usual deviation is told with as much more variance."""
    few_inliers: float = 70.0
    """So many inliers are told with twice the variance, fewer with more by the fourth power of
    their number: the fewer there are, the more of them fit by accident ..."""
    fewest_inliers: int = 30
    """... down to this number."""
    unknown_change: float = 2.0
    """So many times the variance is told where it is not known yet what is usual, as after a loss;
    then also ..."""
    few_found: float = 0.15
    """... with twice the variance where this share of the points in view is found, and with more by
    the fourth power where it is less ..."""
    fewest_found: float = 0.05
    """... down to this share."""
    visible_smear: float = 0.5
    """Pixels of smear that sharp images seem to have as well; what is beyond ..."""
    smear_of_sharpest: float = 2.0
    """... is so many times as long: a camera that goes on and on smears its sharpest images too."""
    usual_changes: float = 1.5
    """A pose farther from where the motion led than so many times what is usual ..."""
    mistaken_share: float = 0.06
    """... is told as one that is off by what is beyond it with this probability: either the camera
    changed its motion or the pose is mistaken."""
    changes_seen: int = 3
    """So many changes of motion tell what is usual ..."""
    sudden_change: float = 3.0
    """... to which one counts as at most so many times the usual."""
    slow_gain: float = 0.02
    """Weight of a frame with such an error in what error is usual: darkness may stay."""
    smear: float = 3.2
    """Pixels that an image is smeared with 0.7 of the fine detail of the sharpest ones ..."""
    fading: float = 0.995
    """... whose detail counts so many times with every further frame."""
    long_smear: float = 0.03
    """Images smeared by more than this share of the focal length begin no map of a single camera
    and do not lead back to one, and are not believed ..."""
    young_map: int = 30
    """... among so many images after it began."""
    refused_share: float = 0.3
    """A pose with less than this share of the usual inliers ..."""
    refused_inliers: int = 100
    """... and fewer than this is not believed at all, unless a second method confirms it."""
    better: float = 1.1
    """Another way to the pose wins with so many times the inliers."""
    enough_share: float = 0.75
    """With this share of the usual inliers no further way is tried."""
    aligned_correlation: float = 0.6
    """Least correlation of two small images that tells how the camera turned."""
    aligned_window: float = 15.0
    """Half width of the search window around points turned so, pixels at level 0."""
    wide_window: float = 40.0
    """The same around points predicted by the motion model, when that is doubted."""
    keyframes_around: int = 3
    """So many neighbours of the reference keyframe are matched by words."""
    same_windows: float = 0.5
    """Two ways came to the same pose if they differ by fewer windows, in pixels of the image ..."""
    same_deviations: float = 3.0
    """... and in position by fewer standard deviations, both added."""
    weak_frames: int = 2
    """After so many weak frames in a row a confirmed one may become a keyframe."""


@dataclass(frozen=True)
class KeyframeConfig:
    """Which frames become keyframes."""

    few_keyframes: int = 2
    """In a map of up to so many keyframes ..."""
    observations_of_few: int = 2
    """... a point of the reference keyframe counts when so many keyframes see it ..."""
    observations: int = 3
    """... and so many in a larger one."""
    share: float = 0.75
    """A frame that tracks less than this share of its reference's points sees new things ..."""
    share_of_first: float = 0.4
    """... while there is one keyframe only ..."""
    share_monocular: float = 0.9
    """... and with a single camera."""
    weak_share: float = 0.25
    """Below this share tracking is weak, and the mapper is not waited for (stereo, RGB-D)."""
    few_close_points: int = 100
    """With fewer close points tracked than this ..."""
    many_untracked_close_points: int = 70
    """... and more close points than this not in the map, a keyframe is needed."""
    kept_share: float = 0.65
    """A frame that tracks less than this share of the most that was tracked since the last keyframe
    leaves what that keyframe saw: another is needed (stereo, RGB-D)."""
    turn_frames: int = 3
    """Where the camera will be after so many frames of the present speed ..."""
    staying_share: float = 0.65
    """... less than this share of the inliers would still be in view: a keyframe is needed before
    the camera has turned away from them (stereo, RGB-D), if many close points are not tracked."""
    few_inliers: int = 150
    """A frame with fewer inliers than this hangs on few points, however many its reference keyframe
    has: another keyframe is made (single camera) ..."""
    new_view: float = 5.0
    """... if their median has moved by so many pixels since the last one, turns left out."""
    inliers: int = 15
    """A keyframe needs more inliers than this."""
    spacing: int = 1
    """Fewest frames from one keyframe to the next with a single camera."""
    spacing_with_depth: int = 2
    """Fewest frames from one keyframe to the next with a stereo pair or an RGB-D camera, where
    tracking is not weak."""
    queue: int = 3
    """A busy mapper is given a keyframe only if fewer than this wait (stereo, RGB-D)."""


@dataclass(frozen=True)
class RelocalizationConfig:
    """When a lost frame counts as found."""

    ratio: float = 0.75
    """Best by second best descriptor distance, matching by words."""
    matches: int = 15
    """Fewest matches by words that make a candidate."""
    thorough_ratio: float = 0.85
    """Best by second best distance, where each point is compared with every keypoint ..."""
    thorough_matches: int = 12
    """... and fewest such matches."""
    thorough_keyframes: int = 2
    """So many keyframes near the place of the loss are compared so, for `motion_frames` frames."""
    iterations: int = 5
    """RANSAC iterations that each candidate gets per turn."""
    inliers: int = 10
    """Fewest inliers of the first pose that are worth widening."""
    enough: int = 50
    """Inliers that make a success ..."""
    enough_near: int = 30
    """... and where the camera was just lost, or its motion would have led it."""
    narrow: int = 30
    """More inliers than this, but not enough, are widened once more with a narrow window."""
    wide_window: float = 10.0
    """Search radius of the first widening, pixels at level 0 ..."""
    wide_distance: int = 100
    """... and the most bits in which descriptors may differ there."""
    narrow_window: float = 3.0
    """Search radius of the second widening ..."""
    narrow_distance: int = 64
    """... and its most differing bits."""
    guess_keyframes: int = 5
    """So many keyframes nearest to a pose given by the user are tried ..."""
    guess_cosine: float = 0.5
    """... which look in nearly the same direction: least cosine of the angle ..."""
    guess_window: float = 30.0
    """... their points searched in this radius, pixels at level 0 ..."""
    guess_distance: int = 64
    """... with at most so many differing bits."""
    guessed_frames: int = 60
    """For so many frames after a loss the camera is looked for near the place of the loss ..."""
    motion_frames: int = 10
    """... and for so many where its motion would have led it; at first within `guess_window` ..."""
    widening: float = 0.25
    """... which grows by this share of itself at every failure ..."""
    widest: float = 3.0
    """... up to this multiple."""
    word_frames: int = 3
    """Lost frames, this one included, whose words name candidates."""
    word_candidates: int = 8
    """Candidates named by words that are matched with one frame ..."""
    near_candidates: int = 4
    """... and those near the place of the loss: half of each likeliest, the others in turns."""
    covisible_keyframes: int = 10
    """Near the loss: keyframes that see most of what its reference keyframe sees ..."""
    last_keyframes: int = 5
    """... and the last ones made."""
    verified_poses: int = 20
    """Poses of RANSAC that are optimised and widened for one frame."""
    rival_share: float = 0.6
    """A frame that fits elsewhere as well is believed if no other place shows more than this share
    of the points ..."""
    support_window: float = 5.0
    """... of the local map that it shows at the best one, searched in this multiple of the usual
    radius: as right after relocalization."""
    common_points: int = 15
    """The frame after one found again confirms it with so many points that both see ..."""
    confirming_cosine: float = 0.87
    """... if the camera turned by no more than this in between: cosine of the angle, 30 degrees."""

    def for_features(self, n_features: int) -> RelocalizationConfig:
        """These limits for images with so many features: of few ones fewer are asked for."""
        return replace(
            self,
            enough=_for_features(self.enough, n_features),
            enough_near=_for_features(self.enough_near, n_features),
            narrow=_for_features(self.narrow, n_features),
        )


@dataclass(frozen=True)
class BlurConfig:
    """When a frame counts as blurred."""

    frames: int = 15
    """Frames before it that it is compared with: half a second ..."""
    fewest: int = 5
    """... and how many there must be at least."""
    share: float = 0.4
    """Less than this share of their median sharpness is blur ..."""
    detail_share: float = 0.7
    """... if their fine corners by coarse ones, too, are below this share: else it is dark."""


@dataclass(frozen=True)
class MappingConfig:
    """What local mapping looks at around a new keyframe."""

    neighbours: int = 10
    """Best covisible keyframes with which points are triangulated and fused ..."""
    neighbours_monocular: int = 20
    """... and with a single camera, all of whose points come from there."""
    observations: int = 3
    """A recent point seen by so many keyframes or fewer is dropped two keyframes later ..."""
    observations_monocular: int = 2
    """... and with a single camera."""
    adjusted_keyframes: int = 2
    """Local bundle adjustment begins with more keyframes than this."""


@dataclass(frozen=True)
class LoopConfig:
    """Where loops are looked for."""

    gap: int = 10
    """Keyframes after a loop that are not searched for another one."""
    firm_matches: int = 100
    """A loop with fewer matches ..."""
    patience: int = 8
    """... waits so many keyframes for one with more."""


@dataclass(frozen=True)
class MergingConfig:
    """When two maps are believed to show the same place."""

    neighbours: int = 6
    """Neighbours of the keyframe that may confirm what it shows ..."""
    confirmations: int = 2
    """... of which so many have to."""
    far_neighbours: int = 3
    """Neighbours of the keyframe in the other map that they are compared with as well."""
    remembered: int = 10
    """Keyframes whose places in another map are kept until others confirm them."""
    position: float = 0.15
    """Median depths of the other keyframe by which a neighbour may be elsewhere than it should."""
    angle: float = 0.1
    """Radians by which it may be turned otherwise."""
    log_scale: float = 0.2
    """Logarithm of the factor by which its scale may differ."""
    explained: float = 0.17
    """Of the points that the keyframe should see over there, at least so large a share is found;
    those count ..."""
    view_cosine: float = 0.87
    """... that are seen from where they were seen before: cosine of the angle, 30 degrees."""
    places: int = 5
    """Places in the other map that are compared with the one that was found there."""


@dataclass(frozen=True)
class TrajectoryConfig:
    """How the poses of past frames are refined."""

    rematch_every_frame: bool = False
    """Match every frame with the map once more when that has settled, not only uncertain ones."""
    rematch_uncertain: bool = True
    """Match uncertain frames with the map once more when that has settled."""


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
    blur: BlurConfig = field(default_factory=BlurConfig)
    mapping: MappingConfig = field(default_factory=MappingConfig)
    loops: LoopConfig = field(default_factory=LoopConfig)
    merging: MergingConfig = field(default_factory=MergingConfig)
    trajectory: TrajectoryConfig = field(default_factory=TrajectoryConfig)

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
        """Return what differs from the defaults, by names with a dot."""
        usual = Config()
        return {name: value for name, value in all_values(self) if value != value_of(usual, name)}

    def for_features(self, n_features: int) -> Config:
        """Return the configuration for images with so many features: fewer inliers of few ones."""
        return replace(
            self,
            tracking=self.tracking.for_features(n_features),
            relocalization=self.relocalization.for_features(n_features),
        )


#: Named sets of changes to the defaults.
PRESETS: Mapping[str, Mapping[str, float | int | bool]] = {
    # Fewer keyframes.
    "fast": {
        "keyframes.spacing_with_depth": 4,
        "keyframes.share": 0.6,
        "keyframes.share_monocular": 0.8,
    },
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
        If there is none; says which name is nearest.
    """
    known = dict(all_values(config))
    if name in known:
        return known[name]
    near = difflib.get_close_matches(str(name), known, 1, 0.5)
    # A field is known by its own name as well, whatever its section.
    near = near or [full for full in known if full.partition(".")[2] == name]
    hint = f"did you mean {near[0]}?" if near else "'orbslam2py config' lists all names"
    raise SettingsError(f"the configuration has no value {shown(name)}; {hint}")


def read_change(text: str) -> tuple[str, float | int | bool]:
    """Read a change as it is written on the command line: ``tracking.map_matches=12``.

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

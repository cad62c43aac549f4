# SPDX-License-Identifier: BSD-3-Clause
"""Descriptions of the figures of report.json: those of docs/reference/files.md."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from orbslam2py._arguments import number_of
from orbslam2py.runs.report_page.round_numbers import NONE, short


@dataclass(frozen=True)
class Figure:
    """A key of report.json."""

    key: str
    name: str
    unit: str
    text: str
    """Description of the figure."""
    best: int = 0
    """1: larger is better, -1: smaller is better, 0: neither."""

    def value(self, report: dict[str, Any]) -> str:
        """Return its value as text; a dash if there is none."""
        value = report.get(self.key)
        if value is None:
            return NONE
        if self.key in _IN_WORDS:
            return _IN_WORDS[self.key](report)
        if isinstance(value, bool):
            return "yes" if value else "no"
        if isinstance(value, float):
            return short(value, 4)
        return str(value)


def compared_over(report: dict[str, Any]) -> str:
    """Return which part of the run the errors cover, such as ``over 2 of 10 frames``."""
    poses, frames = report.get("matched_poses"), report.get("frames")
    if poses is None or frames is None:
        return ""
    told = f"over {poses} of {number_of(frames, 'frame')}"
    return f"{told}, the main map only" if is_of_last_map_only(report) else told


def is_of_last_map_only(report: dict[str, Any]) -> bool:
    """Return whether frames of other maps have poses, which the errors do not cover."""
    poses = report.get("matched_of_poses")
    return poses is not None and poses < report.get("tracked", 0)


def loaded_map_words(report: dict[str, Any]) -> str:
    """Return a text: the initial map of a run."""
    entry = report["loaded_map"]
    held = (("keyframes", "keyframe"), ("map_points", "map point"), ("runs", "run"))
    parts = [number_of(entry[key], noun) for key, noun in held if key in entry]
    return f"{entry.get('file')}: {', '.join(parts)}"


def depth_words(report: dict[str, Any]) -> str:
    """Return a text: the depth of the first depth images, and the factor."""
    entry = report["depth"]
    if entry is None:
        return NONE
    return f"median {entry['median_m']:.3g} m with DepthMapFactor {entry['factor']:g}"


def relocalisations_words(report: dict[str, Any]) -> str:
    """Return a text: number of relocalizations; a loaded map begins with one."""
    count = int(report.get("relocalisations", 0))
    if not count or report.get("loaded_map") is None:
        return str(count)
    if count == 1:
        return "1, the first finding in the loaded map"
    return f"{count}, the first of them in the loaded map"


#: How a path was laid onto the truth.
ALIGNMENTS = {
    "se3": "turned and shifted",
    "sim3": "turned, shifted and scaled",
    "yaw": "turned about the vertical and shifted",
    "none": "as it is",
}

#: Figures that are written in words.
_IN_WORDS: dict[str, Callable[[dict[str, Any]], str]] = {
    "relocalisations": relocalisations_words,
    "loaded_map": loaded_map_words,
    "depth": depth_words,
    "merges": lambda report: str(len(report["merges"])),
    "ate_alignment": lambda report: ALIGNMENTS.get(report["ate_alignment"], NONE),
}

#: Group by group, in the order in which they are read.
FIGURES: dict[str, tuple[Figure, ...]] = {
    "Accuracy": (
        Figure("ate_rmse_m", "ATE, RMSE", "m",
               "absolute error: distance to the truth after alignment, root mean square", -1),
        Figure("ate_mean_m", "ATE, mean", "m", "mean distance to the truth", -1),
        Figure("ate_median_m", "ATE, median", "m", "median distance to the truth", -1),
        Figure("ate_max_m", "ATE, largest", "m", "largest distance to the truth", -1),
        Figure("ate_keyframes_rmse_m", "ATE of keyframes", "m",
               "absolute error of the keyframes alone", -1),
        Figure("ate_alignment", "alignment", "",
               "how the path was laid onto the truth; scaled only for one camera"),
        Figure("ate_scale", "scale", "", "factor of the alignment; 1 where nothing was scaled"),
        Figure("ate_scaled_rmse_m", "ATE, scaled", "m",
               "the same with a scaled path: one camera whose IMU knows metres", -1),
        Figure("ate_scaled_scale", "scale of the scaled path", "",
               "its factor: 1 where the metres of the IMU are right"),
        Figure("rpe_translation_rmse_m", "RPE, translation", "m",
               "error of the motion from one pose to the next", -1),
        Figure("rpe_rotation_rmse_deg", "RPE, rotation", "deg",
               "error of the rotation from one pose to the next", -1),
        Figure("rpe_translation_rmse_m_1s", "RPE over 1 s, translation", "m",
               "error of the motion over one second", -1),
        Figure("rpe_rotation_rmse_deg_1s", "RPE over 1 s, rotation", "deg",
               "error of the rotation over one second", -1),
        Figure("t_rel_percent", "KITTI, translation", "%",
               "KITTI's error over segments of 100 to 800 m", -1),
        Figure("r_rel_deg_per_100m", "KITTI, rotation", "deg/100 m",
               "KITTI's error of rotation over the same segments", -1),
        Figure("matched_poses", "compared poses", "",
               "poses of the main map with a true one at their time: the errors are of these"),
        Figure("matched_of_poses", "of poses", "", "poses of the main map"),
        Figure("matched_path_m", "compared path", "m",
               "length of the true path along the matched poses, without gaps"),
        Figure("true_path_m", "true path", "m", "length of the whole true path"),
        Figure("time_difference_median_s", "time stamps differ, median", "s",
               "by how much the time stamps of matched poses differ"),
        Figure("time_difference_max_s", "time stamps differ, largest", "s", "and at the most"),
    ),
    "Tracking": (
        Figure("frames", "frames", "", "images that were to be processed"),
        Figure("seen_frames", "seen frames", "", "images that were taken until the end"),
        Figure("tracked", "tracked", "", "images with a pose", 1),
        Figure("tracked_fraction", "tracked part", "", "the same as a part of all", 1),
        Figure("skipped_frames", "skipped", "",
               "images that could not be read or were refused", -1),
        Figure("dropped_frames", "dropped", "", "images for which there was no time", -1),
        Figure("lost", "losses", "", "how often tracking was lost, over all maps", -1),
        Figure("lost_frames", "lost frames", "",
               "images without a pose from then on, until the next with one", -1),
        Figure("lost_seconds", "lost time", "s", "how long that was in all", -1),
        Figure("longest_loss_seconds", "longest loss", "s", "and at the longest", -1),
        Figure("lost_at_end", "lost at the end", "",
               "whether there was no pose again until the end of the run"),
        Figure("relocalisations", "relocalisations", "",
               "how often a lost camera was found; the first finding in a loaded map counts"),
        Figure("resets", "resets", "", "how often a map was given up", -1),
        Figure("weak_frames", "weak frames", "",
               "images whose pose explains much less of what should be seen than usual", -1),
        Figure("interrupted", "interrupted", "", "whether Ctrl-C ended the run"),
        Figure("error", "error", "", "what ended the run before its end"),
    ),
    "Map": (
        Figure("keyframes", "keyframes", "", "of the main map"),
        Figure("map_points", "map points", "", "of the main map"),
        Figure("loops_closed", "loops closed", "", "over all maps"),
        Figure("merges", "maps joined", "",
               "how often a place showed that two maps are one"),
    ),
    "Speed": (
        Figure("seconds", "time", "s",
               "of the whole run, without opening the sequence and writing the files", -1),
        Figure("frames_per_second", "frames a second", "1/s", "frames by that time", 1),
        Figure("slam_frames_per_second", "frames a second, SLAM alone", "1/s",
               "frames by the time in track calls and waiting for mapping, without reading images",
               1),
        Figure("peak_memory_mb", "memory", "MB", "largest memory of the process", -1),
    ),
    "Run": (
        Figure("sequence", "sequence", "", "name of the folder, file or camera"),
        Figure("layout", "layout", "", "layout of the sequence on disk"),
        Figure("sensor", "sensor", "", "sensor of the images"),
        Figure("deterministic", "deterministic", "", "whether mapping ran inline"),
        Figure("realtime", "real time", "", "whether time stamps were followed"),
        Figure("seed", "seed", "", "of all random draws"),
        Figure("depth", "depth", "", "of the first depth images, in metres"),
        Figure("loaded_map", "loaded map", "", "what the run began in"),
        Figure("saved_map", "saved map", "", "the file that the maps were saved in"),
        Figure("started", "started", "", "date and time of the run's beginning"),
        Figure("version", "version", "", "of orbslam2py"),
    ),
}  # fmt: skip

#: Terms of the field, in plain words.
TERMS = {
    "ATE": "distance to the ground truth after the whole path was laid onto it (turned and "
    "shifted; for one camera also scaled), root mean square",
    "KITTI": "error of the motion over stretches of 100 to 800 m, in parts of their length",
    "keyframes": "the frames that the map is made of",
    "map points": "places in the world that at least two keyframes see",
    "loops closed": "how often the camera came back to a place and the drift was taken out",
}

#: Descriptions of the stages of tracking.
STAGES = {
    "extract": "extracting features",
    "stereo": "stereo matching, or depth of keypoints",
    "predict": "first pose: motion model, reference keyframe, relocalization",
    "local_map": "matching the local map, final pose",
    "keyframe": "deciding about and making a keyframe; beginning a map, or doubting a young one",
}

#: Descriptions of the stages beside tracking.
STAGES_BESIDE = {
    "mapping": "all of local mapping, for one keyframe",
    "mapping.insert": "taking the keyframe into the map's graph",
    "mapping.cull_points": "taking out new points that too few frames find",
    "mapping.new_points": "making points from matches with neighbouring keyframes",
    "mapping.fuse": "joining points that are one and the same",
    "mapping.align": "aligning the sightings of points to each other by patches",
    "mapping.local_bundle_adjustment": "refining the keyframes and points around the newest",
    "mapping.cull_keyframes": "taking out keyframes that others make superfluous",
    "loop.detect": "looking for a place seen before",
    "loop.verify": "whether the geometry agrees that it is this place",
    "loop.wait": "waiting until mapping pauses",
    "loop.plan": "where the keyframes and points around the loop belong",
    "loop.weld": "refining the map around the place where two maps were merged",
    "loop.graph": "spreading the correction over all keyframes",
    "loop.apply": "moving the map",
    "adjustment.gather": "collecting the whole map",
    "adjustment.solve": "refining all keyframes and points together",
    "adjustment.wait": "waiting until mapping pauses",
    "adjustment.commit": "moving the map",
    "adjustment.local": "refining keyframes and points that were added in between",
}

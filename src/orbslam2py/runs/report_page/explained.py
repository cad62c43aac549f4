# SPDX-License-Identifier: BSD-3-Clause
"""What the figures of report.json are, in words: those of docs/reference/files.md."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from orbslam2py.runs.report_page.round_numbers import NONE, short


@dataclass(frozen=True)
class Figure:
    """A key of report.json."""

    key: str
    name: str
    unit: str
    text: str
    """What it is."""
    best: int = 0
    """1: the larger the better, -1: the smaller the better, 0: neither."""

    def value(self, report: dict[str, Any]) -> str:
        """Write its value for reading; a dash if there is none."""
        value = report.get(self.key)
        if value is None:
            return NONE
        if isinstance(value, bool):
            return "yes" if value else "no"
        if isinstance(value, float):
            return short(value, 4)
        return str(value)


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
               "se3: turned and shifted; sim3: also scaled, for one camera"),
        Figure("ate_scale", "scale", "", "factor of the alignment; 1 with se3"),
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
        Figure("matched_poses", "compared poses", "", "poses with a true one at their time"),
        Figure("matched_of_poses", "of poses", "", "poses there were"),
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
               "how often a lost camera was found again"),
        Figure("resets", "resets", "", "how often a map was given up", -1),
        Figure("interrupted", "interrupted", "", "whether Ctrl-C ended the run"),
    ),
    "Map": (
        Figure("keyframes", "keyframes", "", "of the last map"),
        Figure("map_points", "map points", "", "of the last map"),
        Figure("loops_closed", "loops closed", "", "over all maps"),
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
        Figure("layout", "layout", "", "how the sequence lies on disk"),
        Figure("sensor", "sensor", "", "what the images come from"),
        Figure("deterministic", "deterministic", "", "whether mapping ran inline"),
        Figure("realtime", "real time", "", "whether time stamps were followed"),
        Figure("seed", "seed", "", "of all random draws"),
        Figure("started", "started", "", "date and time of the run's beginning"),
        Figure("version", "version", "", "of orbslam2py"),
    ),
}  # fmt: skip

#: What the stages of tracking are.
STAGES = {
    "extract": "extracting features",
    "stereo": "stereo matching, or depth of keypoints",
    "predict": "first pose: motion model, reference keyframe, relocalization",
    "local_map": "matching the local map, final pose",
    "keyframe": "deciding about and making a keyframe; beginning a map",
}

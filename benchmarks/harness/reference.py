# SPDX-License-Identifier: BSD-3-Clause
"""Results of the original ORB-SLAM2, and targets of this implementation.

Measured with the original at commit f2e6f51 (-O3 -march=native, OpenCV 4.6, no viewer) on two
virtual cores of a Zen 4 server; medians; vocabulary of 825 000 words (branching 10, depth 6). The
yardstick was measured on the same machine in the same minute and carries the figures to others.
"""

from __future__ import annotations

from dataclasses import dataclass

#: ``cv2.ORB_create(n, 1.2, 8).detectAndCompute`` with one thread, by image: (n, ms there).
YARDSTICK = {"tum_a": (1000, 4.1), "euroc_a": (1000, 4.2), "kitti_a": (2000, 7.8)}


@dataclass(frozen=True)
class Figure:
    """One step of the reference and the target.

    Attributes
    ----------
    name
        Of the step.
    milliseconds
        The reference's median; None where only an absolute limit is asked for.
    ratio
        Most times the reference's time; None for an absolute limit.
    limit
        Milliseconds on the reference's machine.
    yardstick
        The image whose yardstick carries the figure.
    """

    name: str
    milliseconds: float | None
    ratio: float | None = None
    limit: float | None = None
    yardstick: str = "tum_a"

    @property
    def target(self) -> float | None:
        """Most milliseconds on the reference's machine; None: no target."""
        if self.limit is not None:
            return self.limit
        if self.ratio is None or self.milliseconds is None:
            return None
        return self.ratio * self.milliseconds


EXTRACTION_STRETCH = 0.33
EXTRACTION = {
    "tum_a": Figure("extraction 640x480, 1000", 7.7, 0.5),
    "euroc_a": Figure("extraction 752x480, 1000", 9.9, 0.5, yardstick="euroc_a"),
    "kitti_a": Figure("extraction 1241x376, 2000", 13.3, 0.5, yardstick="kitti_a"),
}
STEREO = {
    "euroc": Figure("stereo matching 752x480, 1200", 7.8, 0.4),
    "kitti": Figure("stereo matching 1241x376, 2000", 12.7, 0.4),
}
POSE = {
    "poseopt_mono": Figure("pose, 200 monocular", 0.44, 0.6),
    "poseopt_stereo": Figure("pose, 350 mixed", 1.15, 0.6),
}
BUNDLE = {
    "lba_stereo": Figure("local BA, stereo", 75.0, 0.25),
    "lba_mono": Figure("local BA, monocular", 56.0, 0.25),
}
#: Sum of squared whitened residuals over the observations that the reference keeps, and the most
#: that ours may be times that.
BUNDLE_COST = {"lba_stereo": 5434.80, "lba_mono": 3771.96}
BUNDLE_COST_RATIO = 1.001
WORDS = {
    1000: Figure("words and direct index, 1000", 0.75),
    2000: Figure("words and direct index, 2000", 2.7),
}
#: 26 to 53 ms in the reference.
FUSE = Figure("fuse keyframe with neighbours", 26.0, limit=10.0)
VOCABULARY_BINARY = Figure("binary vocabulary, 10^6 words", None, limit=50.0)
VOCABULARY_TEXT = Figure("text vocabulary, 10^6 words", 6300.0, limit=4000.0)
VOCABULARY_TEXT_PEAK_MB = (413.0, 200.0)
"""The reference's peak memory and the most that ours may have."""


@dataclass(frozen=True)
class SequenceFigure:
    """A whole sequence in the reference.

    Attributes
    ----------
    name, folder, sensor
        Which.
    ate, ate_range
        RMSE [m] after SE(3) alignment over all frames, offline: median and range.
    keyframes
        Left in the map.
    track_ms
        Median and 99th percentile of tracking.
    frames_per_second
        Frames / (sum of tracking + sum of mapping time), offline.
    period_ms
        Between two images.
    """

    name: str
    folder: str
    sensor: str
    ate: float
    ate_range: tuple[float, float]
    keyframes: int
    track_ms: tuple[float, float]
    frames_per_second: float
    period_ms: float


SEQUENCES = [
    SequenceFigure(
        "redkitchen RGB-D",
        "7scenes_redkitchen_head250",
        "rgbd",
        0.0493,
        (0.0493, 0.0493),
        19,
        (12.7, 15.5),
        55.7,
        33.3,
    ),
    SequenceFigure(
        "KITTI 06 stereo",
        "kitti_06_head51_stereo",
        "stereo",
        0.0455,
        (0.0354, 0.0542),
        24,
        (35.0, 51.0),
        14.1,
        100.0,
    ),
]
#: Measured for accuracy only: the camera stands still.
STILL = SequenceFigure(
    "EuRoC still stereo",
    "euroc_V1_01_still8",
    "stereo",
    0.0008,
    (0.0008, 0.0008),
    1,
    (25.0, 32.0),
    38.7,
    50.0,
)


@dataclass(frozen=True)
class MonocularFigure:
    """A whole sequence with a single camera in the reference.

    Attributes
    ----------
    name, folder
        Which.
    keyframes_ate
        RMSE [m] after Sim(3) alignment over the keyframes, offline.
    frames_ate
        The same over all frames, as tracked.
    tracked, frames
        How many of how many frames it tracked.
    keyframes
        Left in the map.
    """

    name: str
    folder: str
    keyframes_ate: float
    frames_ate: float
    tracked: int
    frames: int
    keyframes: int


MONOCULAR = [
    MonocularFigure("redkitchen", "7scenes_redkitchen_head250", 0.0404, 0.0392, 220, 250, 31),
    MonocularFigure("KITTI 06 left", "kitti_06_head51_stereo", 0.0238, 0.069, 50, 51, 50),
    MonocularFigure("KITTI 03 left", "kitti_03_left_head120", 0.1934, 0.181, 119, 120, 90),
]
#: The most that our error may be times the reference's, and the least share of tracked frames.
MONOCULAR_ERROR_RATIO = 1.10
MONOCULAR_TRACKED_RATIO = 0.97
SEQUENCE_SPEED_RATIO = 1.5
PYTHON_SHARE = 0.03
#: Longest write sections [ms]: a local window, a whole map of 1000 keyframes.
LOCK_HOLD_MS = (2.0, 20.0)
#: Parts of closing a loop in a map of 1000 keyframes.
LOOPS = {
    "detection": Figure("detection query", None, limit=10.0),
    "verification": Figure("Sim(3) verification", None, limit=10.0),
    "correction": Figure("correction and fusion", None, limit=400.0),
    "correction_lock": Figure("correction, write lock", None, limit=LOCK_HOLD_MS[1]),
    "essential_graph": Figure("essential graph", None, limit=500.0),
    "full_adjustment": Figure("full adjustment", None, limit=15000.0),
}
#: Tracking's 99th percentile while a full adjustment runs over the one without.
ADJUSTMENT_TRACKING_RATIO = 2.0

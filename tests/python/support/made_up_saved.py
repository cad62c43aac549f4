# SPDX-License-Identifier: BSD-3-Clause
"""Map files of made-up maps: with settings, runs and images."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from orbslam2py import Sensor, Settings
from orbslam2py.maps import (
    MapContents,
    RecordedFrames,
    Run,
    SavedMap,
    VocabularyIdentity,
    save_map,
)
from orbslam2py.settings import CameraSettings, DepthSettings
from orbslam2py.settings.groups import DISTORTION_FIELDS
from support.made_up_map import BF, FX, FY, HEIGHT, LENS, WIDTH, made_up_map

FRAMES_PER_KEYFRAME = 3


def settings_of(contents: MapContents) -> Settings:
    """Settings of the camera that a made-up map has; depth makes it one with depth images."""
    cameras = contents.cameras
    lens = dict(zip(DISTORTION_FIELDS, cameras.distortion[0].tolist(), strict=True))
    depth = bool(cameras.bf[0] > 0)
    camera = CameraSettings(
        FX, FY, float(cameras.cx[0]), float(cameras.cy[0]), width=WIDTH, height=HEIGHT,
        bf=BF if depth else 0.0, **lens,
    )  # fmt: skip
    sensor = Sensor.RGBD if depth else Sensor.MONOCULAR
    return Settings(sensor, camera, depth=DepthSettings(40.0, 1000.0) if depth else None)


def recorded_frames(contents: MapContents, shift: float = 0.0) -> RecordedFrames:
    """Three frames per keyframe, each a bit further to the right; every seventh lost."""
    keyframes = contents.keyframes
    hangs_on = np.repeat(keyframes.ids, FRAMES_PER_KEYFRAME)
    n = len(hangs_on)
    T = np.zeros((n, 7))
    T[:, 3] = 1.0
    T[:, 4] = -0.01 * (np.arange(n) % FRAMES_PER_KEYFRAME)
    times = np.repeat(keyframes.timestamps, FRAMES_PER_KEYFRAME)
    times += 0.1 * (np.arange(n) % FRAMES_PER_KEYFRAME) + shift
    lost = (np.arange(n) % 7 == 6).astype(np.uint8)
    return RecordedFrames(times, np.arange(n), hangs_on, T, lost)


def made_up_saved(contents: MapContents | None = None, *, images: bool = False) -> SavedMap:
    """A map of one run."""
    if contents is None:
        contents = made_up_map(lens=LENS)
    pictures = {}
    if images:
        for number in contents.keyframes.ids.tolist():
            small = np.full((HEIGHT // 2, WIDTH // 2), 20 * number, np.uint8)
            pictures[number] = cv2.imencode(".jpg", small)[1].tobytes()
    return SavedMap(
        contents,
        settings_of(contents),
        VocabularyIdentity("small.bvoc", "0123456789abcdef"),
        runs=(Run("orbslam2py 0.1.0", "2026-01-02T03:04:05Z", frames=recorded_frames(contents)),),
        images=pictures,
    )


def map_file(folder: Path, saved: SavedMap | None = None, name: str = "a.orbmap") -> Path:
    """A file of it."""
    path = folder / name
    save_map(made_up_saved() if saved is None else saved, path)
    return path

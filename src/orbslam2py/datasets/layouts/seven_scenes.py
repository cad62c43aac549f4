# SPDX-License-Identifier: BSD-3-Clause
"""7-Scenes (Shotton et al. 2013): ``frame-000000.color.png``, ``.depth.png``, ``.pose.txt``."""

from __future__ import annotations

import logging
import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from orbslam2py.datasets.base import Layout, Stamps
from orbslam2py.datasets.images import read_depth
from orbslam2py.datasets.layouts.frames_on_disk import (
    DepthSequence,
    counted_stamps,
    known_poses,
    read_matrices,
)
from orbslam2py.settings import Settings
from orbslam2py.trajectory import Trajectory

_log = logging.getLogger(__name__)

_NAME = re.compile(r"frame-(\d+)\.color\.png")
_FPS = 30.0
#: From the page of the data set: the cameras were not calibrated.
_CAMERA = {"fx": 585.0, "fy": 585.0, "cx": 320.0, "cy": 240.0}
_SIZE = {"width": 640, "height": 480, "fps": _FPS}
_DEPTH_PER_METRE = 1000.0
#: Depth where there is none.
_NONE = 65535


class SevenScenesSequence(DepthSequence):
    """A sequence of 7-Scenes, such as ``chess/seq-01``; see `datasets.base.Sequence`.

    ``frame-000000.depth.proj.png``, which is registered to the colour camera, is preferred to
    ``frame-000000.depth.png`` of the depth camera.
    """

    layout = Layout.SEVEN_SCENES

    @staticmethod
    def recognises(folder: Path) -> bool:
        """Return whether a folder is such a sequence."""
        return any(_NAME.fullmatch(path.name) for path in folder.glob("frame-*.color.png"))

    def _list(self, folder: Path) -> tuple[list[Path], list[Path], Stamps]:
        found = {
            int(match[1]): path
            for path in folder.glob("frame-*.color.png")
            if (match := _NAME.fullmatch(path.name))
        }
        numbers = sorted(found)
        images = [found[number] for number in numbers]
        depths: list[Path] = []
        for ending in ("depth.proj.png", "depth.png"):
            depths = [_beside(path, ending) for path in images]
            if depths and depths[0].is_file():
                break
        else:
            depths = []
        if depths and depths[0].name.endswith("depth.png"):
            _log.info("%s: depth is that of the depth camera, a few pixels beside colour", folder)
        return images, depths, counted_stamps(numbers, _FPS)

    def _depth(self, path: Path) -> NDArray[np.generic]:
        depth = read_depth(path)
        return np.where(depth == _NONE, 0, depth).astype(depth.dtype)

    def ground_truth(self) -> Trajectory | None:
        """Read the pose beside each image; see `datasets.base.Sequence.ground_truth`."""
        poses = [_beside(path, "pose.txt") for path in self._images]
        if not any(path.is_file() for path in poses):
            return None
        unknown = np.full((4, 4), np.nan)
        T_wc = np.stack([read_matrices(p, 4)[0] if p.is_file() else unknown for p in poses])
        return known_poses(self.folder, self.timestamps, T_wc)

    def _from_calibration(self) -> Settings:
        return self._camera({**_CAMERA, **_SIZE}, _DEPTH_PER_METRE)


def _beside(path: Path, ending: str) -> Path:
    return path.with_name(path.name.replace("color.png", ending))

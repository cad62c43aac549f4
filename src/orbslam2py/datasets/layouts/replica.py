# SPDX-License-Identifier: BSD-3-Clause
"""Replica, as it is rendered for dense SLAM: ``results/frame000000.jpg``, ``traj.txt``."""

from __future__ import annotations

import json
import re
from pathlib import Path

from orbslam2py._arguments import cannot_open
from orbslam2py.datasets.base import Layout, Stamps
from orbslam2py.datasets.layouts.frames_on_disk import (
    DepthSequence,
    counted_stamps,
    known_poses,
    read_matrices,
)
from orbslam2py.errors import DatasetError
from orbslam2py.settings import Settings
from orbslam2py.trajectory import Trajectory

_NAME = re.compile(r"frame(\d+)\.(?:jpg|png)")
_CAMERA_FILE = "cam_params.json"
_FPS = 30.0


class ReplicaSequence(DepthSequence):
    """A rendered sequence of Replica, such as ``office0``; see `datasets.base.Sequence`.

    The camera is described in ``cam_params.json``, beside the sequences. Images are numbered, 30 a
    second: the data set has no times.
    """

    layout = Layout.REPLICA
    _missing_calibration = (
        "cam_params.json is missing; copy it from the data set into the folder or the one above, "
        "or give --settings"
    )

    @staticmethod
    def recognises(folder: Path) -> bool:
        """Return whether a folder is such a sequence."""
        results = folder / "results"
        return results.is_dir() and any(_NAME.fullmatch(p.name) for p in results.glob("frame*"))

    def _list(self, folder: Path) -> tuple[list[Path], list[Path], Stamps]:
        results = folder / "results"
        found = {int(m[1]): p for p in results.iterdir() if (m := _NAME.fullmatch(p.name))}
        numbers = sorted(found)
        images = [found[number] for number in numbers]
        depths = [
            path.with_name(path.name.replace("frame", "depth")).with_suffix(".png")
            for path in images
        ]
        there = depths if depths and depths[0].is_file() else []
        return images, there, counted_stamps(numbers, _FPS)

    def ground_truth(self) -> Trajectory | None:
        """Read ``traj.txt``; see `datasets.base.Sequence.ground_truth`."""
        path = self.folder / "traj.txt"
        if not path.is_file():
            return None
        return known_poses(path, self.timestamps, read_matrices(path, 16))

    def _from_calibration(self) -> Settings | None:
        folders = (self.folder, self.folder.resolve().parent)
        path = next((f / _CAMERA_FILE for f in folders if (f / _CAMERA_FILE).is_file()), None)
        if path is None:
            return None
        try:
            document = json.loads(path.read_text(encoding="utf-8"))
            values = document["camera"]
            numbers = {name: float(values[name]) for name in ("fx", "fy", "cx", "cy")}
            size = {"width": int(values["w"]), "height": int(values["h"]), "fps": _FPS}
            scale = float(values["scale"])
        except OSError as error:
            raise DatasetError(cannot_open(path, error)) from error
        except (ValueError, KeyError, TypeError) as error:
            raise DatasetError(
                f"{path} does not describe the camera: it needs 'camera' with w, h, fx, fy, cx, "
                "cy and scale; copy it again"
            ) from error
        return self._camera({**numbers, **size}, scale, path)

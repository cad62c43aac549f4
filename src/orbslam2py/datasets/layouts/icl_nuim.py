# SPDX-License-Identifier: BSD-3-Clause
"""ICL-NUIM (Handa et al. 2014), the PNG sequences: ``rgb``, ``depth``, ``*.gt.freiburg``."""

from __future__ import annotations

from pathlib import Path

from orbslam2py._text_lines import content_lines, number_of
from orbslam2py.datasets.base import Layout, Stamps
from orbslam2py.datasets.image_folder import image_files
from orbslam2py.datasets.layouts.frames_on_disk import DepthSequence, counted_stamps
from orbslam2py.errors import DatasetError
from orbslam2py.settings import Settings
from orbslam2py.trajectory import Trajectory, read_tum

_TRUTH = "*.gt.freiburg"
_FPS = 30.0
#: As published; the sign of fy there is that of the renderer, whose images are upright here.
_CAMERA = {"fx": 481.2, "fy": 480.0, "cx": 319.5, "cy": 239.5}
_SIZE = {"width": 640, "height": 480, "fps": _FPS}
_DEPTH_PER_METRE = 5000.0


class IclNuimSequence(DepthSequence):
    """A rendered sequence of ICL-NUIM; see `datasets.base.Sequence`.

    Images and the poses of ``*.gt.freiburg`` are numbered, 30 a second.
    """

    layout = Layout.ICL_NUIM

    @staticmethod
    def recognises(folder: Path) -> bool:
        """Return whether a folder is such a sequence."""
        return (folder / "rgb").is_dir() and any(folder.glob(_TRUTH))

    def _list(self, folder: Path) -> tuple[list[Path], list[Path], Stamps]:
        paths = {int(p.stem): p for p in image_files(folder / "rgb") if p.stem.isdecimal()}
        depth = folder / "depth"
        found = image_files(depth) if depth.is_dir() else []
        depths = {int(path.stem): path for path in found if path.stem.isdecimal()}
        numbers = sorted(set(paths) & set(depths)) if depths else sorted(paths)
        images = [paths[number] for number in numbers]
        of_images = [depths[number] for number in numbers] if depths else []
        return images, of_images, counted_stamps(numbers, _FPS)

    def ground_truth(self) -> Trajectory | None:
        """Read ``*.gt.freiburg``; see `datasets.base.Sequence.ground_truth`."""
        path = min(self.folder.glob(_TRUTH))
        for line in content_lines(path)[:1]:
            if not number_of(path, line, line.fields[0]).is_integer():
                raise DatasetError(f"{path}:{line.number}: expected the number of an image first")
        poses = read_tum(path)
        return Trajectory(poses.timestamps / _FPS, poses.T_wc)

    def _from_calibration(self) -> Settings:
        return self._camera({**_CAMERA, **_SIZE}, _DEPTH_PER_METRE)

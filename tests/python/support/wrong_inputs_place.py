# SPDX-License-Identifier: BSD-3-Clause
"""A folder with a bit of everything that the command line is given, good and bad."""

from __future__ import annotations

import hashlib
import os
import stat
from functools import cache
from pathlib import Path

import cv2
import numpy as np

from orbslam2py import Sensor
from orbslam2py.settings import CameraSettings, settings_for_camera
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from orbslam2py.trajectory import write_kitti, write_tum
from support.camera_files import KALIBR, KALIBR_PAIR, KITTI, OPENCV, ROS
from support.foreign_cameras import WRONG as WRONG_CALIBRATIONS
from support.made_up_paths import wander

SIZE = (160, 120)
FRAMES = 12
COLMAP = "# cameras\n1 PINHOLE 640 480 520 515 325 236\n2 PINHOLE 640 480 520 515 325 236\n"


def fill(place: Path) -> None:
    """Write all of it."""
    for name, sensor in (("lap", Sensor.RGBD), ("street", Sensor.STEREO)):
        options = SyntheticOptions(world="corridor", sensor=sensor, frames=FRAMES, size=SIZE)
        SyntheticSequence(options).write(place / name)
    _write_trajectories(place)
    _write_images(place)
    (place / "calibrations").mkdir()
    for name, text in (
        ("opencv.yaml", OPENCV),
        ("kalibr.yaml", KALIBR),
        ("pair.yaml", KALIBR_PAIR),
        ("ros.yaml", ROS),
        ("calib.txt", KITTI),
        ("cameras.txt", COLMAP),
        ("prose.txt", "this is a letter\nto nobody\n"),
        ("nothing.txt", ""),
        ("film.mp4", "this is no film\n" * 100),
        ("T_BS.yaml", "T_BS:\n  data: [1, 2, 3]\n"),
        *((f"calibrations/{name}", text) for name, text in WRONG_CALIBRATIONS.items()),
    ):
        (place / name).write_text(text)
    (place / "noise.bin").write_bytes(np.random.default_rng(0).bytes(3000))
    camera = CameraSettings(120, 120, 80, 60, width=SIZE[0], height=SIZE[1])
    for sensor in (Sensor.MONOCULAR, Sensor.RGBD):
        settings_for_camera(camera, sensor).save(place / f"{sensor}.yaml")
    (place / "empty").mkdir()
    (place / "results").mkdir()
    (place / "results" / "trajectory.txt").write_text("the only copy\n")
    (place / "mine.bvoc").write_text("the only copy\n")
    (place / "mine.yaml").write_text("the only copy\n")


def _write_trajectories(place: Path) -> None:
    path = wander(20)
    for name in ("a.txt", "b.txt"):
        write_tum(place / name, path)
    for name in ("rows.txt", "poses.txt"):
        write_kitti(place / name, path)
    write_kitti(place / "dense.txt", wander(60))
    stamps = [f"{t}\n" for t in path.timestamps]
    (place / "stamps.txt").write_text("".join(stamps))
    (place / "backwards.txt").write_text("".join(reversed(stamps)))
    later = "".join(f"{1e9 + i} 0 0 0 0 0 0 1\n" for i in range(20))
    (place / "later.txt").write_text(later)
    (place / "zero.txt").write_text("0 0 0 0 0 0 0 0\n1 0 0 0 0 0 0 0\n")
    (place / "nan.txt").write_text("0 0 nan 0 0 0 0 1\n")
    (place / "seven.txt").write_text("0 0 0 0 0 0 1\n")
    (place / "mirror.txt").write_text("-1 0 0 0 0 1 0 0 0 0 1 0\n" * 3)


def _write_images(place: Path) -> None:
    pixels = np.random.default_rng(1).integers(0, 256, (FRAMES, SIZE[1], SIZE[0]), np.uint8)
    for folder in ("photos", "inside/photos", "pictures"):
        (place / folder).mkdir(parents=True)
    for number, image in enumerate(pixels):
        cv2.imwrite(str(place / "photos" / f"{number:02d}.png"), image)
    for number in range(4):
        cv2.imwrite(str(place / "inside" / "photos" / f"{number}.png"), pixels[number])
        (place / "pictures" / f"{number}.png").write_text("no picture\n")
    cv2.imwrite(str(place / "mask.png"), np.full((SIZE[1], SIZE[0]), 255, np.uint8))
    cv2.imwrite(str(place / "large_mask.png"), np.full((300, 300), 255, np.uint8))
    cv2.imwrite(str(place / "colour_mask.png"), np.zeros((SIZE[1], SIZE[0], 3), np.uint8))
    cv2.imwrite(str(place / "black_mask.png"), np.zeros((SIZE[1], SIZE[0]), np.uint8))


def inventory(place: Path) -> dict[str, str]:
    """All files with their content, all folders and links."""
    found = {}
    for folder, folders, files in os.walk(place):
        for name in (*folders, *files):
            path = os.path.join(folder, name)  # noqa: PTH118 - much quicker than Path
            status = os.lstat(path)
            if stat.S_ISLNK(status.st_mode):
                content = f"link to {os.readlink(path)}"  # noqa: PTH115
            elif stat.S_ISREG(status.st_mode):
                content = _digest(path, status.st_ino, status.st_size, status.st_ctime_ns)
            else:
                content = "folder"
            found[os.path.relpath(path, place)] = content
    return found


@cache
def _digest(path: str, *_: int) -> str:
    """Of the content; whatever changes a file changes its number, size or time of change."""
    return hashlib.blake2b(Path(path).read_bytes()).hexdigest()

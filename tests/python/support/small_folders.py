# SPDX-License-Identifier: BSD-3-Clause
"""Small made-up images and calibrations, as data sets have them."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

SIZE = (48, 64)  # rows, columns


def image(seed: int, shape: tuple[int, ...] = SIZE, dtype: type = np.uint8) -> np.ndarray:
    generator = np.random.default_rng(seed)
    return generator.integers(0, np.iinfo(dtype).max, shape, dtype=dtype)


def save(path: Path, pixels: np.ndarray) -> np.ndarray:
    path.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(path), pixels)
    return pixels


P0 = "P0: 700 0 600 0 0 700 180 0 0 0 1 0"
P1 = "P1: 700 0 600 -350 0 700 180 0 0 0 1 0"

SENSOR_YAML = """\
%YAML:1.0
sensor_type: camera
comment: VI-Sensor {name} (made up)

T_BS:
  cols: 4
  rows: 4
  data: [0.0, -1.0, 0.0, {x},
         1.0, 0.0, 0.0, 0.02,
         0.0, 0.0, 1.0, 0.03,
         0.0, 0.0, 0.0, 1.0]
rate_hz: 20
resolution: [64, 48]
camera_model: pinhole
intrinsics: [40.0, 41.0, 32.0, 24.0] #fu, fv, cu, cv
distortion_model: radial-tangential
distortion_coefficients: [-0.1, 0.01, 0.0, 0.0]
"""

STAMPS = (1403715273262142976, 1403715273312143104, 1403715273362142976)


def write_tum(folder: Path) -> Path:
    """Four colour images; depth is late by 5 ms and missing for the third."""
    colour, depth = ["# colour", "# made up", "# timestamp filename"], ["# depth"]
    for k in range(4):
        stamp = f"100.{k}00000"
        save(folder / "rgb" / f"{stamp}.png", image(k, (*SIZE, 3)))
        colour.append(f"{stamp} rgb/{stamp}.png")
        if k != 2:
            late = f"100.{k}05000"
            save(folder / "depth" / f"{late}.png", image(10 + k, dtype=np.uint16))
            depth.append(f"{late} depth/{late}.png")
    (folder / "rgb.txt").write_text("\n".join(colour) + "\n")
    (folder / "depth.txt").write_text("\n".join(depth) + "\n")
    return folder


def write_kitti(folder: Path) -> Path:
    """Three pairs of images."""
    for k in range(3):
        save(folder / "image_0" / f"{k:06d}.png", image(k))
        save(folder / "image_1" / f"{k:06d}.png", image(10 + k))
    (folder / "times.txt").write_text("0.000000e+00\n1.036224e-01\n2.072343e-01\n")
    (folder / "calib.txt").write_text(f"{P0}\n{P1}\n")
    return folder


def write_euroc(folder: Path) -> Path:
    """Three pairs of images; the right camera is 10 cm to the right of the left one."""
    for number, name in enumerate(("cam0", "cam1")):
        camera = folder / "mav0" / name
        lines = ["#timestamp [ns],filename"]
        for k, stamp in enumerate(STAMPS):
            save(camera / "data" / f"{stamp}.png", image(10 * number + k))
            lines.append(f"{stamp},{stamp}.png")
        (camera / "data.csv").write_text("\r\n".join(lines) + "\r\n")
        # The camera's x axis is the body's y axis: the right camera lies at larger y.
        text = SENSOR_YAML.format(name=name, x=0.01).replace(" 0.02,", f" {0.02 + 0.1 * number},")
        (camera / "sensor.yaml").write_text(text)
    return folder

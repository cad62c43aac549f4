# SPDX-License-Identifier: BSD-3-Clause
"""Recordings as the RealSense Viewer and SDK write them, made up."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from support import bags

#: First stamp of the camera [ns]: its clock counts milliseconds, with six decimals.
CAMERA_START = 1_700_000_000_000_125_000
SENSORS = {"Depth_0": 0, "Infrared_1": 0, "Infrared_2": 0, "Color_0": 1}


def stream(name: str) -> str:
    return f"/device_0/sensor_{SENSORS[name]}/{name}"


def camera_matrix(f: float, size: tuple[int, int]) -> npt.NDArray[np.float64]:
    return np.array([[f, 0, (size[0] - 1) / 2], [0, f, (size[1] - 1) / 2], [0, 0, 1]])


def viewer_stream(
    name: str,
    images: Sequence[npt.NDArray[Any]],
    f: float,
    *,
    T_stream_reference: npt.NDArray[np.float64] | None = None,
    reference: int = 0,
    model: str = "Brown Conrady",
    D: Sequence[float] = (0, 0, 0, 0, 0),
    info: bool = True,
) -> list[bags.Made]:
    """Messages of a stream in a .bag, up to SDK 2.58: P and R are 0, frames are "0"."""
    base = stream(name)
    size = (images[0].shape[1], images[0].shape[0])
    encoding = "mono16" if images[0].dtype == np.uint16 else "mono8"
    made = [
        bags.raw_image(f"{base}/image/data", bags.START + i * bags.STEP, image, encoding, frame="0")
        for i, image in enumerate(images)
    ]
    if info:
        made.append(
            bags.camera_info(
                f"{base}/info/camera_info",
                1,
                size=size,
                K=camera_matrix(f, size),
                R=np.zeros((3, 3)),
                P=np.zeros((3, 4)),
                D=D,
                model=model,
            )
        )
    if T_stream_reference is not None:
        made.append(bags.transform(f"{base}/tf/{reference}", T_stream_reference))
    return made


def sdk_stream(
    name: str,
    images: Sequence[npt.NDArray[Any]],
    f: float,
    *,
    T_stream_reference: npt.NDArray[np.float64] | None = None,
    delay: int = 0,
    clock: str | None = "Global Time",
    without_time: Sequence[int] = (),
    units: float = 0.001,
    raw: bool = False,
    inverse_D: Sequence[float] | None = None,
) -> list[bags.Made]:
    """Messages of a stream in a .db3 of SDK 2.59: stamps are times of arrival, from 0 on."""
    base = stream(name)
    frame = name.partition("_0")[0].replace("_", "")
    size = (images[0].shape[1], images[0].shape[0])
    depth = images[0].dtype == np.uint16
    made = []
    for i, image in enumerate(images):
        arrived = delay + i * (bags.STEP + 3_000_017)
        info = bags.camera_info(
            f"{base}/image/camera_info",
            arrived,
            size=size,
            K=camera_matrix(f, size),
            D=inverse_D or (0,) * 5,
        )
        made += [info, _sdk_image(base, frame, image, arrived, raw=raw)]
        if clock is not None and i not in without_time:
            milliseconds = CAMERA_START // 10**6 + i * 50
            fields = (
                f"Frame number={i}",
                f"timestamp_domain={clock}",
                "system_time=0.000000",
                f"timestamp={milliseconds}.{CAMERA_START % 10**6:06d}",
            )
            made.append(bags.text(f"{base}/image/metadata", arrived, ";".join(fields) + ";"))
    if depth:
        made.append(
            bags.text(f"{base.rpartition('/')[0]}/option/Depth_Units/value", 0, f"{units:.6f}")
        )
    if T_stream_reference is not None:
        # The SDK writes rotations column by column.
        R = ",".join(f"{n:.6f}" for n in T_stream_reference[:3, :3].T.ravel())
        t = ",".join(f"{n:.6f}" for n in T_stream_reference[:3, 3])
        made.append(bags.text(f"{base}/tf/ref_1", 0, f"rotation={R};translation={t}"))
    if inverse_D is not None:
        made.append(bags.text(f"{base}/camera_info", 0, "width=1;model=Inverse Brown Conrady"))
    return made


def _sdk_image(
    base: str, frame: str, image: npt.NDArray[Any], arrived: int, *, raw: bool
) -> bags.Made:
    depth = image.dtype == np.uint16
    if raw:
        encoding = "16UC1" if depth else "mono8"
        return bags.raw_image(f"{base}/image/data", arrived, image, encoding, frame=frame)
    content = bags.compressed_depth(image) if depth else bags.encoded(image, ".png")
    form = "16UC1; compressedDepth png" if depth else "mono8; png compressed mono8"
    last = "compressedDepth" if depth else "compressed"
    fields = (form, np.frombuffer(content, np.uint8))
    return bags.Made(f"{base}/image/data/{last}", bags.COMPRESSED, arrived, fields, frame)


def write_sdk(path: Path, messages: Sequence[bags.Made]) -> Path:
    """Write a lone .db3 without metadata.yaml."""
    folder = bags.write(path.with_suffix(""), "rosbag2", messages)
    shutil.move(bags.file_of(folder), path.with_suffix(".db3"))
    shutil.rmtree(folder)
    return path.with_suffix(".db3")

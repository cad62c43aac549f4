# SPDX-License-Identifier: BSD-3-Clause
"""A kind of live source for tests of the command line: it delivers synthetic images."""

from __future__ import annotations

import numpy as np

from orbslam2py import Sensor
from orbslam2py.live import FoundDevice, Kind, Request, Stream
from support import small_sequences as small
from support.faulty_camera import FaultyCamera

KIND = Kind("made", "made:", "a camera that is none", "support.made_kind")
#: Frames that are delivered: the first ones come before a run begins.
N = 70


def open_device(request: Request) -> FaultyCamera:
    def image(number: int, stream: Stream) -> np.ndarray:
        images = small.images(Sensor.STEREO, number)
        return np.asarray(images.right if stream == "right" else images.image)

    streams: tuple[Stream, ...] = ("left", "right", "imu") if request.imu else ("left", "right")
    settings = small.sequence(Sensor.STEREO).settings
    return FaultyCamera(N, 10, streams=streams, settings=settings, images=image)


def find_devices() -> list[FoundDevice]:
    return [FoundDevice("made:7", "Camera that is none", ("left 320 x 240, 8 fps",))]

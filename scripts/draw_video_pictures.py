# SPDX-License-Identifier: BSD-3-Clause
"""Draw the picture of the guide to videos: one of the video of a run.

    python scripts/draw_video_pictures.py
    python scripts/draw_video_pictures.py --sequence dataset/sequences/06 --sensor stereo --at 0.9

Without a sequence everything in it is made on the spot: a camera goes once around a corridor, looks
into the dark for a moment, and closes a loop.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from orbslam2py import open_sequence
from orbslam2py.cli.watching import file_watchers
from orbslam2py.datasets import Images
from orbslam2py.runs import RunOptions, run_sequence
from orbslam2py.settings import Sensor
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence

ROOT = Path(__file__).resolve().parents[1]

#: Where in the corridor it is dark: part of the way, then images.
DARK_AT, DARK_FOR = 0.2, 5


@dataclass
class DarkForAMoment:
    """A sequence in which a few images show nothing."""

    sequence: SyntheticSequence

    def __getattr__(self, name: str) -> object:
        return getattr(self.sequence, name)

    def __len__(self) -> int:
        return len(self.sequence)

    def load(self, index: int, /) -> Images:
        """Images of a place in the sequence."""
        images = self.sequence.load(index)
        first = int(DARK_AT * len(self))
        if not first <= index < first + DARK_FOR:
            return images
        dark = np.zeros_like(images.image)
        return replace(images, image=dark, right=None if images.right is None else dark)


def corridor() -> DarkForAMoment:
    """The world of the demo."""
    options = SyntheticOptions(world="corridor", sensor="stereo", speed=1.4, noise=2)
    return DarkForAMoment(SyntheticSequence(options))


def picture_at(path: Path, share: float) -> np.ndarray:
    """A picture of a video, by its place from 0 to 1."""
    video = cv2.VideoCapture(str(path))
    last = int(video.get(cv2.CAP_PROP_FRAME_COUNT)) - 1
    found, picture = False, None
    for _ in range(round(share * last) + 1):
        found, picture = video.read()
    video.release()
    if not found:
        raise SystemExit(f"{path} cannot be read")
    return np.asarray(picture)


def main() -> None:
    """Run, and take a picture out of the video."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sequence", help="folder of a sequence [the demo's corridor]")
    parser.add_argument("--sensor", default="stereo", help="mono, stereo or rgbd [stereo]")
    parser.add_argument("--frames", type=int, help="take at most so many images")
    parser.add_argument("--at", type=float, default=0.97, help="place in the video, 0 to 1")
    parser.add_argument("--output", type=Path, default=ROOT / "docs/images/video.png")
    parser.add_argument("--video", type=Path, help="keep the video as well")
    arguments = parser.parse_args()
    sensor = Sensor(arguments.sensor)
    named = arguments.sequence
    sequence = corridor() if named is None else open_sequence(named, sensor)
    options = RunOptions(sensor, max_frames=arguments.frames)
    with tempfile.TemporaryDirectory() as folder:
        path = arguments.video or Path(folder, "run.mp4")
        with file_watchers(sequence, options, path, None) as files:
            run_sequence(sequence, options, watch=files.watch)
        picture = picture_at(path, arguments.at)
    # Without a palette: few pixels are of the colours that say what is what.
    Image.fromarray(cv2.cvtColor(picture, cv2.COLOR_BGR2RGB)).save(arguments.output, optimize=True)
    sys.stdout.write(f"{arguments.output}\n")


if __name__ == "__main__":
    main()

# SPDX-License-Identifier: BSD-3-Clause
"""Recorded sequences, made harder: fewer images, backwards, blurred, darkened, rolled."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.harness.folders import sequence_folder
from benchmarks.holding_on.flow import FlowParallax
from benchmarks.holding_on.made_up import FEATURES, with_features
from benchmarks.holding_on.scene import Floats, Integers
from orbslam2py.datasets import Images, Sequence, open_sequence
from orbslam2py.datasets.base import rate_of
from orbslam2py.settings import CameraSettings, Sensor, Settings
from orbslam2py.trajectory import Trajectory, associate, read_trajectory

_Image = NDArray[Any]


@dataclass(frozen=True)
class Recording:
    """A recorded sequence.

    Attributes
    ----------
    name
        Of its folder.
    sensors
        With which it is played.
    near
        See `Scene.near`.
    has_truth
        Whether it comes with the camera's poses, or those of the body.
    truth_jumps
        Images before which the truth jumps.
    truth_deviation
        Degrees and metres that its other motions are off by, on each axis.
    body_truth
        File with the poses of the body, which is the IMU; where the layout knows no truth.
    """

    name: str
    sensors: tuple[str, ...]
    near: float
    has_truth: bool = True
    truth_jumps: tuple[int, ...] = ()
    truth_deviation: tuple[float, float] = (0.0, 0.0)
    body_truth: str | None = None

    def truth(self, sequence: Sequence) -> Trajectory | None:
        """Poses of the camera; None if they are not known."""
        if not self.has_truth:
            return None
        if self.body_truth is None:
            return sequence.ground_truth()
        body, _ = read_trajectory(sequence_folder(self.name) / self.body_truth)
        imu = sequence.imu_settings()
        assert imu is not None
        return dataclasses.replace(body, T_wc=body.T_wc @ np.linalg.inv(imu.T_ci))


RECORDINGS = [
    # From image 121 to 122 its truth turns by 1.4 degrees, where PnP of OpenCV on depth and optical
    # flow says 0.5. Over any other four images the two differ by 0.2 degrees in the median, by 0.55
    # in one case of ten and by 1.1 at most.
    Recording("7scenes_redkitchen_head250", ("rgbd", "mono"), 0.5, True, (122,), (0.2, 0.005)),
    Recording("kitti_03_left_head120", ("mono",), 5.0),
    Recording("kitti_06_head51_stereo", ("stereo", "mono"), 5.0),
    Recording("kitti_raw_0926_0001_left", ("mono",), 5.0, has_truth=False),
    # Its truth are positions of markers on it, approximately in time.
    Recording("drone_semicircle", ("mono",), 0.5, has_truth=False),
]


# ---- which images --------------------------------------------------------------------------------
_Chosen = Callable[[int, np.random.Generator], NDArray[np.int64]]


def _every(step: int) -> _Chosen:
    return lambda n, random: np.arange(0, n, step)


_all = _every(1)


def _backwards(n: int, random: np.random.Generator) -> NDArray[np.int64]:
    return np.arange(n)[::-1]


def _dropped(n: int, random: np.random.Generator) -> NDArray[np.int64]:
    """Three in ten are missing, also several in a row."""
    kept = random.random(n) >= 0.3
    kept[0] = True
    return np.flatnonzero(kept)


# ---- what becomes of an image --------------------------------------------------------------------
class Shown:
    """Images as they are shown: the base shows them as they were recorded."""

    def __init__(self, camera: CameraSettings, shape: tuple[int, int], seed: int) -> None:
        self.camera = camera
        self.shape = shape
        self.seed = seed

    def turned(self, place: int, seconds: float) -> Floats:
        """Rotation (3, 3) from the recorded camera to the one that is shown."""
        return np.eye(3)

    def of(self, images: Images, place: int, seconds: float) -> Images:
        """What is shown instead of the images at a place in the scene."""
        return images


class Blurred(Shown):
    """Four images of every twelve are smeared by 1.5 % of their width."""

    def of(self, images: Images, place: int, seconds: float) -> Images:
        """Motion blur along a random direction."""
        if place // 4 % 3 != 2:
            return images
        angle = np.random.default_rng((self.seed, place)).uniform(0, np.pi)
        length = 0.015 * images.image.shape[1]
        size = 2 * int(np.ceil(length / 2)) + 3
        middle = np.array([size // 2, size // 2])
        half = length / 2 * np.array([np.cos(angle), np.sin(angle)])
        kernel = np.zeros((size, size), np.uint8)
        ends = [np.rint(16 * (middle + side * half)).astype(int).tolist() for side in (-1, 1)]
        cv2.line(kernel, *ends, 255, 1, cv2.LINE_AA, shift=4)
        kernel = kernel / kernel.sum()
        return _for_each(images, lambda image: cv2.filter2D(image, -1, kernel))


class Darkened(Shown):
    """Ten images of every thirty have three tenths of their brightness, from one to the next."""

    def of(self, images: Images, place: int, seconds: float) -> Images:
        """Darken, in whole grey values."""
        if place // 10 % 3 != 2:
            return images
        return _for_each(images, lambda image: cv2.convertScaleAbs(image, alpha=0.3))


class Rolled(Shown):
    """The camera sways about its axis within three seconds: 10 degrees, 3 of a wide image.

    Images are cut so that there is something everywhere.
    """

    _PERIOD = 3.0

    def __init__(self, camera: CameraSettings, shape: tuple[int, int], seed: int) -> None:
        super().__init__(camera, shape, seed)
        self._most = np.radians(10.0 if shape[1] < 2 * shape[0] else 3.0)
        self._recorded = camera.matrix
        height, width = self._cut(camera, shape)
        self.shape = height, width
        self.camera = dataclasses.replace(
            camera, cx=(width - 1) / 2, cy=(height - 1) / 2, width=width, height=height
        )

    def _cut(self, camera: CameraSettings, shape: tuple[int, int]) -> tuple[int, int]:
        """Largest image of the same form around the principal point that never leaves the old."""
        room = np.array(
            [
                min(camera.cx, shape[1] - 1 - camera.cx),
                min(camera.cy, shape[0] - 1 - camera.cy),
            ]
        )
        half = np.array([shape[1], shape[0]]) / 2
        cosine, sine = np.cos(self._most), np.sin(self._most)
        needed = np.array([[cosine, sine], [sine, cosine]]) @ half
        width, height = (2 * half * (room / needed).min()).astype(int)
        return int(height), int(width)

    def turned(self, place: int, seconds: float) -> Floats:
        """About the optical axis."""
        angle = self._most * np.sin(2 * np.pi * seconds / self._PERIOD)
        return np.asarray(cv2.Rodrigues(np.array([0.0, 0.0, angle]))[0])

    def of(self, images: Images, place: int, seconds: float) -> Images:
        """Turn, and cut."""
        size = self.shape[::-1]
        to_shown = self.camera.matrix @ self.turned(place, seconds) @ np.linalg.inv(self._recorded)

        def turn(image: _Image, flags: int = cv2.INTER_LINEAR) -> _Image:
            return cv2.warpPerspective(image, to_shown, size, flags=flags)

        depth = None if images.depth is None else turn(images.depth, cv2.INTER_NEAREST)
        return dataclasses.replace(_for_each(images, turn), depth=depth)


def _for_each(images: Images, change: Callable[[_Image], _Image]) -> Images:
    right = None if images.right is None else change(images.right)
    return dataclasses.replace(images, image=change(images.image), right=right)


@dataclass(frozen=True)
class Change:
    """How a recording is made harder.

    Attributes
    ----------
    name
        As the table shows it.
    chosen
        Which images are shown, of so many.
    shown
        What becomes of them.
    with_stereo
        Whether both cameras of a pair could have seen it.
    """

    name: str
    chosen: _Chosen = _all
    shown: type[Shown] = Shown
    with_stereo: bool = True


CHANGES = [
    Change("as it is"),
    Change("every second", _every(2)),
    Change("every third", _every(3)),
    Change("every fourth", _every(4)),
    Change("backwards", _backwards),
    Change("three in ten dropped", _dropped),
    Change("blurred", shown=Blurred),
    Change("darkened", shown=Darkened),
    Change("rolled", shown=Rolled, with_stereo=False),
]
_BY_NAME = {change.name: change for change in CHANGES}


# ---- the whole -----------------------------------------------------------------------------------
class RecordedScene:
    """A recorded sequence, changed; see `Scene`."""

    def __init__(
        self, recording: Recording, sensor: Sensor, change: Change, features: int, seed: int
    ) -> None:
        self._sequence = _opened(recording.name, sensor)
        self._recording = recording
        self.sensor, self.near = sensor, recording.near
        self.imu = self.samples = None
        degrees, metres = recording.truth_deviation
        self.truth_variance = np.repeat([np.radians(degrees) ** 2, metres**2], 3)
        random = np.random.default_rng(seed)
        self._places = change.chosen(len(self._sequence), random)
        times = self._sequence.timestamps[self._places]
        self.timestamps = times = np.abs(times - times[0])
        self.fps = rate_of(times, self._sequence.settings.camera.fps)
        shape = self._sequence.load(0).image.shape[:2]
        recorded = self._sequence.settings
        self._change = change.shown(recorded.camera, (shape[0], shape[1]), seed)
        camera = dataclasses.replace(self._change.camera, fps=self.fps)
        self.settings: Settings = with_features(
            dataclasses.replace(recorded, camera=camera), features
        )
        self._flow = FlowParallax(self._grey, recorded.camera)

    def __len__(self) -> int:
        return len(self._places)

    def load(self, index: int) -> Images:
        """Read an image, and change it."""
        images = self._sequence.load(int(self._places[index]))
        return self._change.of(images, index, float(self.timestamps[index]))

    @cached_property
    def truth(self) -> Floats:
        """Poses of the camera that is shown."""
        poses = np.full((len(self), 4, 4), np.nan)
        known = self._recording.truth(self._sequence)
        if known is None:
            return poses
        times = self._sequence.timestamps[self._places]
        for i, j in zip(*associate(times, known.timestamps), strict=True):
            turned = np.eye(4)
            turned[:3, :3] = self._change.turned(int(i), float(self.timestamps[i]))
            poses[i] = known.T_wc[j] @ turned.T
        return poses

    @property
    def truth_part(self) -> Integers:
        """Parts end where the truth jumps."""
        return np.searchsorted(self._recording.truth_jumps, self._places, side="right")

    def covered(self, index: int) -> bool:
        """Nothing is ever over the lens."""
        return False

    def parallax(self, first: int, second: int) -> float:
        """By the images as they were recorded, and all that lie between."""
        return self._flow.between(int(self._places[first]), int(self._places[second]))

    def _grey(self, place: int) -> NDArray[np.uint8]:
        image = self._sequence.load(place).image
        return image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)  # type: ignore[return-value]


@lru_cache(maxsize=16)
def _opened(name: str, sensor: Sensor) -> Sequence:
    return open_sequence(sequence_folder(name), sensor)


@dataclass(frozen=True)
class RecordedCase:
    """One run of a recorded sequence; see `Case`.

    Attributes
    ----------
    recording
        What is played.
    change
        Name of how it is made harder.
    sensor, features, seed
        Of the run; the seed is that of the change and of the system.
    """

    recording: Recording
    change: str
    sensor: str
    features: int
    seed: int

    @property
    def situation(self) -> str:
        """Of any recording: how it was changed."""
        return f"recorded, {self.change}"

    @property
    def key(self) -> str:
        """Key that identifies the run."""
        about = (self.recording.name, self.change, self.sensor, self.features, self.seed)
        return " | ".join(map(str, about))

    def scene(self) -> RecordedScene:
        """The changed sequence, to be played."""
        return RecordedScene(
            self.recording, Sensor(self.sensor), _BY_NAME[self.change], self.features, self.seed
        )

    def described(self) -> str:
        """What is played."""
        about = {"sequence": self.recording.name, "change": self.change, "sensor": self.sensor}
        return json.dumps({**about, "features": self.features, "seed": self.seed})


def recorded_cases(sensors: Collection[str]) -> Iterator[RecordedCase]:
    """Endless: every round plays all recordings in all ways.

    The first with the features of their settings, the next ones with other numbers and seeds.
    """
    seed = 0
    while True:
        for recording in RECORDINGS:
            for sensor in (s for s in recording.sensors if s in sensors):
                own = _opened(recording.name, Sensor(sensor)).settings.orb.n_features
                features = own if seed == 0 else FEATURES[(seed - 1) % len(FEATURES)]
                for change in CHANGES:
                    if change.with_stereo or sensor != Sensor.STEREO:
                        yield RecordedCase(recording, change.name, sensor, features, seed)
        seed += 1

# SPDX-License-Identifier: BSD-3-Clause
"""Made-up images of odd but right cameras, and of scenes that make tracking hard."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from orbslam2py.datasets import Images
from orbslam2py.settings import CameraSettings, Settings
from orbslam2py.synthetic import DEPTH_PER_METRE, SyntheticOptions, SyntheticSequence

N_IMAGES = 49
Grey = NDArray[np.uint8]
Depth = NDArray[np.generic]
_SEED = 5


@dataclass(frozen=True)
class Case:
    """Settings and images that belong together, or do not."""

    name: str
    settings: Settings
    images: Callable[[], Iterator[Images]]


class _OtherLens(SyntheticSequence):
    """A synthetic sequence with another focal length and principal point."""

    focal = 0.625
    centre = (0.0, 0.0)

    @property
    def camera(self) -> CameraSettings:
        camera = super().camera
        assert camera.width is not None
        assert camera.height is not None
        f = self.focal * camera.width
        return replace(
            camera,
            fx=f,
            fy=f,
            cx=camera.cx + self.centre[0] * camera.width,
            cy=camera.cy + self.centre[1] * camera.height,
            bf=camera.bf / camera.fx * f,
        )


def _sequence(
    world: str,
    sensor: str,
    size: tuple[int, int] = (320, 240),
    focal: float = 0.625,
    centre: tuple[float, float] = (0.0, 0.0),
    seed: int = 0,
    **more: float,
) -> SyntheticSequence:
    options = SyntheticOptions(
        world=world,
        sensor=sensor,
        frames=N_IMAGES,
        size=size,
        seed=seed,
        **more,  # type: ignore[arg-type]
    )
    sequence = _OtherLens(options, threads=2)
    sequence.focal, sequence.centre = focal, centre
    return sequence


def _as_it_is(name: str, sequence: SyntheticSequence) -> Case:
    return Case(name, sequence.settings, lambda: (sequence.load(i) for i in range(len(sequence))))


def _altered(
    case: Case,
    name: str,
    change: Callable[[Grey, int], Grey],
    depth: Callable[[Depth, int], Depth] = lambda depth, _: depth,
) -> Case:
    def images() -> Iterator[Images]:
        for i, one in enumerate(case.images()):
            yield Images(
                change(one.image, i),
                None if one.right is None else change(one.right, i),
                None if one.depth is None else depth(one.depth, i),
            )

    return Case(name, case.settings, images)


def cut(case: Case, name: str, part: tuple[slice, slice]) -> Case:
    """Images cut to rows and columns, with the settings that are right for them."""
    rows, columns = part
    camera = case.settings.camera
    camera = replace(
        camera,
        cx=camera.cx - columns.start,
        cy=camera.cy - rows.start,
        width=columns.stop - columns.start,
        height=rows.stop - rows.start,
    )

    def images() -> Iterator[Images]:
        for one in case.images():
            arrays = (one.image, one.right, one.depth)
            yield Images(*(None if a is None else a[part] for a in arrays))  # type: ignore[arg-type]

    return Case(name, replace(case.settings, camera=camera), images)


def _blurred(image: Grey, _: int) -> Grey:
    kernel = np.zeros((13, 13), np.float32)
    kernel[6] = 1 / 13
    return np.asarray(cv2.filter2D(image, -1, kernel), np.uint8)


def _dark(image: Grey, number: int) -> Grey:
    noise = np.random.default_rng(number).normal(0, 6, image.shape)
    return np.clip(image * 0.15 + noise, 0, 255).astype(np.uint8)


class _PassingThing:
    """A textured board over a third of the image that moves across it."""

    def __call__(self, image: Grey, number: int) -> Grey:
        side, part = self._place(image.shape, number)
        small = np.random.default_rng(_SEED).integers(0, 255, (side // 4 + 1,) * 2, np.uint8)
        board = cv2.resize(small, (side, side), interpolation=cv2.INTER_NEAREST)
        changed = image.copy()
        changed[part] = board
        return changed

    def depth(self, depth: Depth, number: int) -> Depth:
        """It is 1 m away."""
        _, part = self._place(depth.shape, number)
        changed = depth.copy()
        changed[part] = DEPTH_PER_METRE
        return changed

    def _place(self, shape: tuple[int, ...], number: int) -> tuple[int, tuple[slice, slice]]:
        height, width = shape
        side = int(0.6 * height)
        left = int((width - side) * number / N_IMAGES)
        top = (height - side) // 2 + int(4 * np.sin(number / 3))
        return side, (slice(top, top + side), slice(left, left + side))


def _rolling_shutter(world: str, seconds: float, name: str) -> Case:
    """Rows are exposed one after the other, over so many seconds, from eight poses."""
    sequence = _sequence(world, "mono")
    scene, speed = sequence._scene, sequence._speed

    def images() -> Iterator[Images]:
        for i in range(len(sequence)):
            height = sequence.options.size[1] if sequence.options.size else 480
            bounds = np.linspace(0, height, 9).astype(int)
            rows = []
            for begin, end in itertools.pairwise(bounds.tolist()):
                delay = seconds * (begin + end) / (2 * height)
                T_wc = scene.T_wc(float(sequence.timestamps[i]) + delay, speed, 0.0, 0.0)
                rows.append(sequence.view(T_wc, i).image[begin:end])
            yield Images(np.concatenate(rows))

    return Case(name, sequence.settings, images)


def right_cases() -> Iterator[Case]:
    """Calibrations that fit: no report is allowed."""
    for world in ("corridor", "room", "figure-eight", "two-rooms"):
        for sensor in ("mono", "stereo", "rgbd"):
            yield _as_it_is(f"{world}, {sensor}", _sequence(world, sensor))
    for sensor in ("mono", "stereo"):
        yield _as_it_is(f"street, {sensor}", _sequence("street", sensor, (620, 188), 0.58))
        yield _as_it_is(f"street lap, {sensor}", _sequence("street-lap", sensor, (620, 188), 0.58))
    for world in ("corridor", "room"):
        for sensor in ("mono", "rgbd"):
            yield from _odd_cameras(world, sensor)
            yield from _hard_scenes(world, sensor)
        yield _rolling_shutter(world, 0.02, f"{world}, rolling shutter of 20 ms")
    for seed in range(1, 4):
        for sensor in ("mono", "rgbd"):
            yield _as_it_is(f"room, {sensor}, seed {seed}", _sequence("room", sensor, seed=seed))


def _odd_cameras(world: str, sensor: str) -> Iterator[Case]:
    told = f"{world}, {sensor}"
    yield _as_it_is(f"{told}, upright", _sequence(world, sensor, (240, 320), 0.85))
    yield _as_it_is(f"{told}, 110 degrees wide", _sequence(world, sensor, focal=0.35))
    yield _as_it_is(f"{told}, 30 degrees wide", _sequence(world, sensor, focal=1.87))
    aside = _sequence(world, sensor, centre=(0.1, -0.1))
    yield _as_it_is(f"{told}, principal point 10 % aside", aside)
    large = _as_it_is("", _sequence(world, sensor, (400, 300)))
    yield cut(large, f"{told}, cut above and left", (slice(90, 300), slice(60, 400)))
    yield cut(large, f"{told}, cut below", (slice(0, 200), slice(0, 400)))


def _hard_scenes(world: str, sensor: str) -> Iterator[Case]:
    case, thing = _as_it_is("", _sequence(world, sensor)), _PassingThing()
    yield _altered(case, f"{world}, {sensor}, blurred over 13 pixels", _blurred)
    yield _altered(case, f"{world}, {sensor}, dark and noisy", _dark)
    yield _altered(case, f"{world}, {sensor}, a thing passes by", thing, thing.depth)


def wrong_cases() -> Iterator[Case]:
    """Calibrations that do not fit, whether the data show it or not: the camera turns in the room
    only."""
    for world in ("room", "corridor"):
        for sensor in ("mono", "stereo", "rgbd"):
            case = _as_it_is(f"{world}, {sensor}", _sequence(world, sensor))
            yield from wrong_settings(case)
    for world in ("room", "corridor"):
        yield from _wrong_pairs(_as_it_is(f"{world}, stereo", _sequence(world, "stereo")))


def wrong_settings(case: Case) -> Iterator[Case]:
    """The same images with calibrations that do not fit."""
    camera = case.settings.camera
    width, height = camera.width or 0, camera.height or 0
    for factor in (0.6, 0.75, 1.4, 1.7):
        changed = replace(camera, fx=camera.fx * factor, fy=camera.fy * factor)
        yield _with(case, f"fx times {factor}", changed)
    aside = replace(camera, cx=camera.cx + 0.15 * width, cy=camera.cy + 0.1 * height)
    yield _with(case, "principal point 15 % aside", aside)
    bent = replace(camera, k1=camera.k1 - 0.28, k2=camera.k2 + 0.07)
    yield _with(case, "EuRoC's distortion", bent)
    yield _with(case, "k1 0.2 more", replace(camera, k1=camera.k1 + 0.2))


def _with(case: Case, what: str, camera: CameraSettings) -> Case:
    return replace(
        case, name=f"{case.name}, {what}", settings=replace(case.settings, camera=camera)
    )


def _wrong_pairs(case: Case) -> Iterator[Case]:
    def exchanged() -> Iterator[Images]:
        for one in case.images():
            assert one.right is not None
            yield Images(one.right, one.image)

    def shifted() -> Iterator[Images]:
        for one in case.images():
            assert one.right is not None
            yield Images(one.image, np.roll(one.right, 4, axis=0))

    def turned() -> Iterator[Images]:
        for one in case.images():
            assert one.right is not None
            height, width = one.image.shape
            about = cv2.getRotationMatrix2D((width / 2, height / 2), 3.0, 1.0)
            yield Images(one.image, np.asarray(cv2.warpAffine(one.right, about, (width, height))))

    yield Case(f"{case.name}, left and right exchanged", case.settings, exchanged)
    yield Case(f"{case.name}, right image 4 rows lower", case.settings, shifted)
    yield Case(f"{case.name}, right image turned by 3 degrees", case.settings, turned)

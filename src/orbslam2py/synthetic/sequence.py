# SPDX-License-Identifier: BSD-3-Clause
"""Rendered sequences: textured rooms, corridors and streets with exact ground truth.

>>> options = SyntheticOptions(world="corridor", sensor="stereo", frames=100)
>>> sequence = SyntheticSequence(options)  # doctest: +SKIP
>>> left, right = sequence.load(0).image, sequence.load(0).right  # doctest: +SKIP
>>> sequence.write("corridor", "kitti")  # doctest: +SKIP

The same options give the same bytes in every run.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbslam2py import _core as core
from orbslam2py._arguments import index_of, shown
from orbslam2py._arrays import ByteArray, FloatArray, IntArray
from orbslam2py.datasets import FramesInOrder, Images, Layout
from orbslam2py.errors import SettingsError
from orbslam2py.settings import (
    CameraSettings,
    DepthSettings,
    OrbSettings,
    RigCamera,
    Sensor,
    Settings,
)
from orbslam2py.synthetic import lens
from orbslam2py.synthetic.files import write_sequence
from orbslam2py.synthetic.imu import SyntheticImu
from orbslam2py.synthetic.lens_pair import LensPair, lens_pair_of
from orbslam2py.synthetic.motions import Motion, SyntheticMotion
from orbslam2py.synthetic.options import SyntheticOptions
from orbslam2py.synthetic.pieces import arrange
from orbslam2py.synthetic.rig_images import RigEffects, images_of_rig
from orbslam2py.synthetic.scenes import LAPS, Corners, SyntheticWorld, make_scene
from orbslam2py.synthetic.wide_view import WideView
from orbslam2py.trajectory import Trajectory
from orbslam2py.trajectory.rotations import inverse_poses

#: Units of the depth images per metre, as in the TUM RGB-D data sets.
DEPTH_PER_METRE = 5000.0


class SyntheticSequence(SyntheticImu, FramesInOrder):
    """Renders its images on request; has the interface of the recorded sequences.

    Parameters
    ----------
    options
        World, sensor, length and disturbances.
    threads
        Number of rendering threads; the images do not depend on it.
    """

    #: Direction of up in the world of the ground truth: y points down.
    up_in_truth: FloatArray = np.array([0.0, -1.0, 0.0])

    def __init__(self, options: SyntheticOptions, *, threads: int = 1) -> None:
        if not isinstance(options, SyntheticOptions):
            raise SettingsError(f"options are {shown(options)}; give SyntheticOptions(...)")
        self.options = options
        self._threads = threads
        self._world = SyntheticWorld(options.world)
        self._scene = make_scene(self._world, options.length)
        self._fps = options.fps or (10.0 if self._scene.outdoors else 20.0)
        self._speed = options.speed or self._scene.speed
        self._motion = Motion(SyntheticMotion(options.motion), self._fps, options.seed)
        n_images = options.frames or self._frames_of_whole_way()
        self._arrangement = arrange(options, n_images, self._fps)
        self._n_frames = len(self._arrangement.of_way)
        nanoseconds = np.arange(self._n_frames, dtype=np.float64) * (1e9 / self._fps)
        #: Time stamps, int64 (n,), nanoseconds from the start.
        self.nanoseconds: IntArray = np.rint(nanoseconds).astype(np.int64)
        self._covered = self._seconds_of_cover()
        lens.check_cover(*self._covered, self.timestamps)

    def _seconds_on_way(self, index: int) -> float:
        """Path time of the camera for each image."""
        return float(np.rint(self._arrangement.of_way[index] * (1e9 / self._fps))) / 1e9

    @property
    def _size(self) -> tuple[int, int]:
        if (seen_through := self.options.lens) is not None:
            return seen_through.width or 0, seen_through.height or 0
        if self._lens_pair is not None:
            return self._lens_pair.models[0].image_size
        if self._rig:
            return self._rig[0].size
        return self.options.size or ((1241, 376) if self._scene.outdoors else (640, 480))

    def _frames_of_whole_way(self) -> int:
        laps = self.options.laps or LAPS.get(self._world, 1.0)
        seconds = self._scene.seconds(self._speed, laps) / self.options.pace
        return math.floor(self._motion.duration(seconds) * self._fps) + 1

    def __len__(self) -> int:
        return self._n_frames

    # ---- the interface of a sequence -------------------------------------------------------------
    @property
    def name(self) -> str:
        """Name of the world."""
        return f"synthetic-{self._world}"

    @property
    def layout(self) -> str:
        """Always ``synthetic``: there are no files."""
        return "synthetic"

    @property
    def sensor(self) -> Sensor:
        """The kind of camera that delivers the images."""
        return Sensor(self.options.sensor)

    @cached_property
    def timestamps(self) -> FloatArray:
        """Time of every frame in seconds from the start, float64 (n,); read-only."""
        seconds = np.asarray(self.nanoseconds / 1e9)
        seconds.setflags(write=False)
        return seconds

    def timestamp_text(self, index: int, /) -> str:
        """Return the time of a frame in seconds, with nine decimals."""
        nanoseconds = int(self.nanoseconds[index_of(index, len(self))])
        return f"{nanoseconds // 10**9}.{nanoseconds % 10**9:09d}"

    @property
    def camera(self) -> CameraSettings:
        """The camera; both cameras of a pair are alike, if they are not given."""
        if self.options.rig is not None:
            return replace(self.options.rig.camera, fps=self._fps)
        if self.options.lens_pair is not None:
            return replace(self.options.lens_pair.camera, fps=self._fps)
        width, height = self._size
        baseline = 0.54 if self._scene.outdoors else 0.1
        if (seen_through := self.options.lens) is not None:
            bf = baseline * seen_through.fx if self.sensor.has_depth else 0.0
            return replace(seen_through, fps=self._fps, bf=bf)
        f = (0.58 if self._scene.outdoors else 0.625) * width
        return CameraSettings(
            fx=f,
            fy=f,
            cx=(width - 1) / 2,
            cy=(height - 1) / 2,
            width=width,
            height=height,
            fps=self._fps,
            bf=baseline * f if self.sensor.has_depth else 0.0,
        )

    @property
    def baseline(self) -> float:
        """Distance of the cameras of the pair [m], also the virtual one of RGB-D."""
        return self.camera.bf / self.camera.pixels_per_radian

    def default_settings(self) -> Settings:
        """Return settings with the exact calibration."""
        if self.options.rig is not None:
            # Frames per second are common to all cameras.
            rig = tuple(
                replace(member, camera=replace(member.camera, fps=self._fps))
                for member in self._rig
            )
            return replace(self.options.rig, rig=rig)
        if self.options.lens_pair is not None:
            return replace(self.options.lens_pair, camera=self.camera)
        depth = None
        if self.sensor.has_depth:
            raw_per_metre = DEPTH_PER_METRE if self.sensor is Sensor.RGBD else None
            depth = DepthSettings(close_factor=40.0, raw_per_metre=raw_per_metre)
        n_features = 2000 if self._scene.outdoors else 1000
        return Settings(
            sensor=self.sensor,
            camera=self.camera,
            orb=OrbSettings(n_features=n_features),
            depth=depth,
        )

    @cached_property
    def settings(self) -> Settings:
        """The same as `default_settings`."""
        return self.default_settings()

    def ground_truth(self) -> Trajectory:
        """Return the exact poses of the camera: of a pair the left one, rectified if it will be."""
        T_wc = np.stack([self.T_wc(i) for i in range(len(self))])
        return Trajectory(self.timestamps, T_wc)

    def load(self, index: int, /) -> Images:
        """Render the images of a frame.

        Returns
        -------
        Images
            Grey images (height, width) uint8; depth (height, width) uint16 in 1/5000 m, 0 without
            depth or beyond 13.1 m.

        Raises
        ------
        IndexError
            If there is no such frame.
        """
        T_wc = self.T_wc(index)
        if self._rig:
            effects = RigEffects(
                self._exposure(float(self.timestamps[index])),
                self.options.noise,
                self.options.seed,
                self._seconds_on_way(index),
                self._hand_rows(index),
                dark=bool(self._arrangement.dark[index]),
            )
            return self._images_of_rig(T_wc, index, effects)
        left, depth = self._seen(T_wc, index, right=False)
        if self.sensor is Sensor.STEREO:
            return Images(left, right=self._seen(T_wc, index, right=True)[0])
        if self.sensor is Sensor.RGBD:
            return Images(left, depth=self._measured(depth, index))
        return Images(left)

    @property
    def _rig(self) -> tuple[RigCamera, ...]:
        rig = self.options.rig
        return () if rig is None or rig.rig is None else rig.rig

    def _images_of_rig(self, T_wc: FloatArray, number: int, effects: RigEffects) -> Images:
        factor = self.default_settings().depth_factor
        return images_of_rig(
            self._rig,
            self._wide_views,
            lambda T_wk: functools.partial(self._side, T_wk, effects.seconds),
            T_wc,
            number,
            effects,
            lambda depth, own: self._measured(depth, own, factor),
        )

    # ---- what only a made-up world knows ---------------------------------------------------------
    @property
    def lap_length(self) -> float | None:
        """Length of a round in metres, without swaying; None if the path does not return."""
        way = self._scene.way
        return way.length() if way is not None and self._world in LAPS else None

    def T_wc(self, index: int) -> FloatArray:
        """Return the exact pose of the (left) camera, camera to world, float64 (4, 4) [m].

        Raises
        ------
        IndexError
            If there is no such frame.
        """
        index = index_of(index, len(self))
        return self._T_wc_at(self._seconds_on_way(index))

    def _T_wc_at(self, seconds: float) -> FloatArray:
        options = self.options
        on_way = self._scene.T_wc(
            options.pace * self._motion.on_way(seconds),
            self._speed,
            options.lateral,
            math.radians(options.yaw),
            sharp=options.corners is Corners.SHARP,
        )
        return self._motion.applied(on_way, seconds)

    def covered(self, index: int) -> bool:
        """Return whether a hand covers the lens, also partly, or the image is dark.

        Raises
        ------
        IndexError
            If there is no such frame.
        """
        index = index_of(index, len(self))
        return self._hand_rows(index) > 0

    def _hand_rows(self, index: int) -> int:
        if self._arrangement.dark[index]:
            return self._size[1]
        begin, lasting = self._covered
        if lasting == 0:
            return 0
        seconds = float(self.timestamps[index])
        return lens.hand_rows(seconds, begin, begin + lasting, self._size[1])

    def _seconds_of_cover(self) -> tuple[float, float]:
        """Return start and duration of the hand."""
        cover = self.options.cover
        if isinstance(cover, tuple | list):
            return cover[0], cover[1]
        return (self._n_frames / self._fps - cover) / 2, cover

    def view(self, T_wc: FloatArray, number: int = 0, *, exposure: float | None = None) -> Images:
        """Render images from any pose, without blur and without a hand.

        Moving parts of the world are at their initial positions.

        Parameters
        ----------
        T_wc
            Pose of the (left) camera, camera to world, (4, 4).
        number
            Seed of the noise, together with the sequence's seed: not negative.
        exposure
            Factor on the grey values; None: that of the options (the first of two).

        Returns
        -------
        Images
            As from `load`.
        """
        factor = self._exposure(None) if exposure is None else exposure
        if self._rig:
            effects = RigEffects(factor, self.options.noise, self.options.seed)
            return self._images_of_rig(T_wc, number, effects)
        image, depth = self._render(self._left_of(T_wc), 2 * number, factor)
        if self.sensor is Sensor.STEREO:
            T_wr = self._right_of(T_wc)
            return Images(image, right=self._render(T_wr, 2 * number + 1, factor, right=True)[0])
        if self.sensor is Sensor.RGBD:
            return Images(image, depth=self._measured(depth, number))
        return Images(image)

    def exact_depth(self, index: int) -> NDArray[np.float32]:
        """Depth of the (left) image along z, (height, width) [m]; 0 where no surface is hit."""
        index = index_of(index, len(self))
        seconds = self._seconds_on_way(index)
        T_wl = self._left_of(self.T_wc(index))
        return self._render(T_wl, 2 * index, 1.0, seconds=seconds)[1]

    def write(
        self,
        folder: str | Path,
        layout: Layout | str | None = None,
        *,
        force: bool = False,
        progress: Callable[[int, int], None] | None = None,
    ) -> Path:
        """Write images, ground truth and calibration as a data set that `open_sequence` reads.

        Parameters
        ----------
        folder
            The folder; it appears after everything is written.
        layout
            ``tum`` (mono, RGB-D), ``kitti`` or ``euroc`` (mono, stereo); ``rosbag1``, ``rosbag2``
            or ``mcap`` (all, with the package rosbags); by default TUM for RGB-D and mono, KITTI
            for stereo.
        force
            Replace a folder that contains a synthetic sequence.
        progress
            Called after each frame with the number of frames written and of all frames.

        Raises
        ------
        SettingsError
            If the layout does not support the sensor.
        DatasetError
            If the folder exists and is not empty.
        OSError
            If it cannot be written.
        """
        return write_sequence(self, Path(folder), layout, force=force, progress=progress)

    @cached_property
    def _built(self) -> core.World:
        return self._scene.make_world(self.options.seed)

    @cached_property
    def _built_parts(self) -> list[core.World]:
        return [part.make_world(self.options.seed) for part in self._scene.moving]

    def _exposure(self, seconds: float | None) -> float:
        exposure = self.options.exposure
        if not isinstance(exposure, tuple | list):
            return exposure
        if seconds is None:
            return exposure[0]
        return lens.exposure_at(seconds, (exposure[0], exposure[1]), self.options.seed)

    @cached_property
    def _lens_pair(self) -> LensPair | None:
        pair = self.options.lens_pair
        return None if pair is None else lens_pair_of(pair)

    def _left_of(self, T_wc: FloatArray) -> FloatArray:
        """Pose of the raw left camera, or of the only one."""
        pair = self._lens_pair
        return T_wc if pair is None else np.asarray(T_wc @ pair.T_tracked_raw[0])

    def _right_of(self, T_wc: FloatArray) -> FloatArray:
        if self._lens_pair is not None:
            return np.asarray(T_wc @ self._lens_pair.T_tracked_raw[1])
        T_wr: FloatArray = T_wc.copy()
        T_wr[:3, 3] += self.baseline * T_wc[:3, 0]
        return T_wr

    def _seen(
        self, T_wc: FloatArray, index: int, *, right: bool
    ) -> tuple[ByteArray, NDArray[np.float32]]:
        """Return one image of a frame, with all effects, and its depth."""
        options = self.options
        seconds = self._seconds_on_way(index)
        number = 2 * index + right
        exposure = self._exposure(float(self.timestamps[index]))
        place = self._right_of if right else self._left_of
        if options.blur > 0:
            sharp, depth = self._render(place(T_wc), number, 1.0, noise=0.0, seconds=seconds)
            half = 0.5 * options.blur / self._fps
            pose_at = self.T_wc_between if options.imu else self._T_wc_at
            T_open, T_shut = (place(pose_at(seconds + aside)) for aside in (-half, half))
            image = lens.smeared(sharp, depth, self.camera, T_open, place(T_wc), T_shut)
            grey = lens.exposed(image, exposure, options.noise, [options.seed, number])
        else:
            pose = place(T_wc)
            grey, depth = self._render(pose, number, exposure, seconds=seconds, right=right)
        return lens.covered(grey, depth, self._hand_rows(index))

    def _render(
        self,
        T_wc: FloatArray,
        number: int,
        exposure: float,
        *,
        noise: float | None = None,
        seconds: float = 0.0,
        right: bool = False,
    ) -> tuple[ByteArray, NDArray[np.float32]]:
        noise = self.options.noise if noise is None else noise
        views = self._wide_views
        if views:
            side = functools.partial(self._side, T_wc, seconds)
            image, depth = views[right].render(side)
            return lens.exposed(image, exposure, noise, [self.options.seed, number]), depth
        camera = self.camera
        width, height = self._size
        return self._composed(
            T_wc,
            seconds,
            fx=camera.fx,
            fy=camera.fy,
            cx=camera.cx,
            cy=camera.cy,
            width=width,
            height=height,
            noise=noise,
            exposure=exposure,
            noise_seed=(self.options.seed << 32) | number,
        )

    @cached_property
    def _wide_views(self) -> tuple[WideView, ...]:
        """Renderers of images through the lens, or the lenses of a pair; none without a lens."""
        if self._lens_pair is not None:
            left, right = self._lens_pair.models
            return WideView(left), WideView(right)
        if self._rig:
            return tuple(WideView(m.camera.camera_model(*m.size)) for m in self._rig)
        seen_through = self.options.lens
        return () if seen_through is None else (WideView(seen_through.camera_model(*self._size)),)

    def _side(
        self, T_wc: FloatArray, seconds: float, R_sc: FloatArray, focal_length: float, size: int
    ) -> tuple[ByteArray, NDArray[np.float32]]:
        """One side of the cube around a camera, without noise."""
        T_cs = np.eye(4)
        T_cs[:3, :3] = R_sc.T
        middle = (size - 1) / 2
        return self._composed(
            T_wc @ T_cs,
            seconds,
            fx=focal_length,
            fy=focal_length,
            cx=middle,
            cy=middle,
            width=size,
            height=size,
            noise=0.0,
            exposure=1.0,
            noise_seed=0,
        )

    def _composed(
        self, T_wc: FloatArray, seconds: float, **image: Any
    ) -> tuple[ByteArray, NDArray[np.float32]]:
        """Return one side of the cube around a camera, without noise."""
        grey, depth = self._rendered(self._built, T_wc, image)
        for part, world in zip(self._scene.moving, self._built_parts, strict=True):
            # A part that moves is one that stands still and a camera that moves the other way.
            T_pc = T_wc.copy()
            T_pc[:3, 3] -= part.shift(seconds)
            grey_part, depth_part = self._rendered(world, T_pc, image)
            before = (depth_part > 0) & ((depth == 0) | (depth_part < depth))
            grey, depth = np.where(before, grey_part, grey), np.where(before, depth_part, depth)
        return grey, depth

    def _rendered(
        self, world: core.World, T_wc: FloatArray, image: Mapping[str, Any]
    ) -> tuple[ByteArray, NDArray[np.float32]]:
        grey, depth = core.render(world, inverse_poses(T_wc), **image, threads=self._threads)
        return grey, depth

    def _measured(
        self, depth: NDArray[np.float32], number: int, raw_per_metre: float = DEPTH_PER_METRE
    ) -> NDArray[np.uint16]:
        metres = depth.astype(np.float64)
        if self.options.depth_noise > 0:
            random = np.random.default_rng([self.options.seed, number])
            metres += self.options.depth_noise * metres**2 * random.standard_normal(depth.shape)
        raw = np.rint(metres * raw_per_metre)
        return np.where((raw > 0) & (raw < 2**16), raw, 0).astype(np.uint16)

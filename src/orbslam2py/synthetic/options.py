# SPDX-License-Identifier: BSD-3-Clause
"""Options of a synthetic sequence: world, sensor, length, disturbances."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Any

from orbslam2py._arguments import is_number, is_whole, seed_of, shown
from orbslam2py.errors import SettingsError
from orbslam2py.settings import CameraSettings, Sensor, Settings, imu_noise
from orbslam2py.synthetic.lens_pair import check_lens_pair
from orbslam2py.synthetic.motions import SyntheticMotion
from orbslam2py.synthetic.scenes import (
    CORNERED,
    LAPS,
    ROOM_BESIDE,
    WITHOUT_WAY,
    Corners,
    SyntheticWorld,
)


@dataclass(frozen=True)
class SyntheticOptions:
    """Options of a synthetic sequence. None means the world's own value.

    Attributes
    ----------
    world
        The world.
    sensor
        The sensor.
    frames
        Number of images; by default the whole path.
    laps
        Number of rounds, instead of `frames`; only if the path returns to its start (1.2 in
        corridors and around the block, 1.1 in the figure of eight).
    length
        Metres of the straight street (600).
    fps
        Frames per second (20 indoors, 10 in streets).
    speed
        Metres per second along the path (0.7 in corridors, 0.4 between the rooms, 10 in streets);
        not in worlds without a path (room, table-top, wall, lift-door).
    pace
        Factor on the usual speed, in every world.
    motion
        Motion of the camera along its path.
    corners
        How the viewing direction follows the bends of a path: `Corners`; only if there are bends.
    size
        Width and height in pixels (640 x 480, in streets 1241 x 376).
    seed
        Another seed gives other wallpaper and furniture.
    noise
        Standard deviation of the grey values' noise, grey levels.
    exposure
        Factor on the grey values. Two numbers: the factor jumps between frames, about once a
        second, and is between them.
    blur
        Exposure time, in times between two frames (0 to 1): the camera's motion during it blurs the
        image. The ground truth is the pose in the middle of the exposure.
    cover
        Seconds that a hand covers the lens, in the middle of the sequence. Two numbers: start [s]
        and duration [s].
    pieces
        Number of parts of equal length that the path is cut into; they follow each other. `frames`
        and `laps` are those of the path before the cut.
    order
        Numbers of the used parts in their order, from 0; the others are left out. By default all of
        them, shuffled by the seed.
    gap
        Seconds of darkness between two parts, at the end of the one before (3 with `pieces`).
    overlap
        Seconds by which each part is longer at its start and its end, so that neighbours share
        places (0 with `pieces`).
    depth_noise
        Standard deviation of the depth [m] at 1 m; it grows with the square of the depth (RGB-D).
    lateral
        Offset to the right of the path [m]: the same places from other viewpoints. Limited by the
        walls (0.6 m between the rooms, 3.5 m in the street, 3 m around the blocks).
    yaw
        Degrees to the right of the direction of travel.
    lens
        Camera with width and height, whose lens the images have: any model of
        `orbslam2py.CameraSettings`. Single camera or RGB-D, without `blur` and `size`. None for a
        pinhole without distortion.
    imu
        Whether there is an IMU beside the camera. Its path is a smooth curve through the poses of
        the images, which do not change; not with `pieces`, between which the camera jumps.
    imu_noise
        Name of a chip with the noise of the samples, such as ``bmi088``, and a bias that drifts; by
        default they are exact.
    lens_pair
        Stereo settings of a raw pair, through whose two lenses the images are seen: with a
        rectification, or with the right camera of a fisheye pair. The images are raw.
    rig
        Settings of a rig, through whose lenses the images of all its cameras are seen (sensor rig).
        A hand (`cover`) covers its first camera alone.

    Raises
    ------
    SettingsError
        If a value is out of range.
    """

    world: SyntheticWorld | str = SyntheticWorld.ROOM
    sensor: Sensor | str = Sensor.STEREO
    frames: int | None = None
    laps: float | None = None
    fps: float | None = None
    speed: float | None = None
    size: tuple[int, int] | None = None
    seed: int = 0
    noise: float = 0.0
    exposure: float | tuple[float, float] = 1.0
    depth_noise: float = 0.0
    lateral: float = 0.0
    yaw: float = 0.0
    pace: float = 1.0
    motion: SyntheticMotion | str = SyntheticMotion.SMOOTH
    corners: Corners | str = Corners.ROUND
    blur: float = 0.0
    cover: float | tuple[float, float] = 0.0
    pieces: int | None = None
    order: tuple[int, ...] | None = None
    gap: float | None = None
    overlap: float | None = None
    length: float | None = None
    lens: CameraSettings | None = None
    imu: bool = False
    imu_noise: str | None = None
    lens_pair: Settings | None = None
    rig: Settings | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "world", _member(SyntheticWorld, "world", self.world))
        object.__setattr__(self, "sensor", _member(Sensor, "sensor", self.sensor))
        object.__setattr__(self, "motion", _member(SyntheticMotion, "motion", self.motion))
        object.__setattr__(self, "corners", _member(Corners, "corners", self.corners))
        _check_range("frames", self.frames, 1, 1_000_000, whole=True)
        _check_range("laps", self.laps, 0.01, 1000)
        self._check_length()
        _check_range("fps", self.fps, 0.1, 1000)
        _check_range("speed", self.speed, 0.001, 100)
        if self.size is not None:
            _check_size(self.size)
        self._check_lens()
        self._check_rig()
        seed_of(self.seed, most=2**31 - 1)
        _check_range("noise", self.noise, 0, 100)
        _check_exposure(self.exposure)
        _check_range("blur", self.blur, 0, 1)
        _check_cover(self.cover)
        self._check_pieces()
        _check_range("depth_noise", self.depth_noise, 0, 1)
        beside = ROOM_BESIDE[SyntheticWorld(self.world)]
        _check_range("lateral", self.lateral, -beside, beside)
        _check_range("yaw", self.yaw, -180, 180)
        self._check_pace()
        self._check_imu()
        if self.laps is not None and self.world not in LAPS:
            names = ", ".join(map(str, LAPS))
            raise SettingsError(
                f"laps apply to ways that come back to their start: {names}; take one, or give "
                "frames"
            )
        if self.laps is not None and self.frames is not None:
            raise SettingsError(
                "frames and laps exclude each other: both say how long the way is; give one"
            )
        if self.corners is Corners.SHARP and self.world not in CORNERED:
            names = ", ".join(map(str, CORNERED))
            raise SettingsError(f"corners are sharp on ways with corners: {names}; take one")

    def _check_length(self) -> None:
        _check_range("length", self.length, 50, 3500)  # pictures of more take too much memory
        if self.length is not None and self.world is not SyntheticWorld.STREET:
            raise SettingsError(
                f"length does not apply to the {self.world}, whose size is fixed; take the street"
            )

    def _check_rig(self) -> None:
        if (self.sensor is Sensor.RIG) != (self.rig is not None):
            raise SettingsError(
                "a rig needs the sensor rig and settings of its cameras (--rig FILE); give both, "
                "or neither"
            )
        if self.rig is None:
            return
        if not isinstance(self.rig, Settings) or self.rig.rig is None:
            raise SettingsError(f"rig is {shown(self.rig)}; give Settings of the sensor rig")
        given = {"size": self.size, "lens": self.lens, "lens_pair": self.lens_pair}
        for name, value in (given | {"blur": self.blur, "imu": self.imu}).items():
            if value:
                raise SettingsError(f"a rig (--rig) goes without {name}; leave it out")

    def _check_lens(self) -> None:
        if self.lens_pair is not None:
            self._check_lens_pair(self.lens_pair)
        if self.lens is None:
            return
        if not isinstance(self.lens, CameraSettings):
            raise SettingsError(f"lens is {shown(self.lens)}; give CameraSettings(...)")
        if self.lens.width is None or self.lens.height is None:
            raise SettingsError(
                "the camera of lens has no image size; give its width and height "
                "(Camera.width and Camera.height in a settings file)"
            )
        _check_size((self.lens.width, self.lens.height))
        if self.size is not None:
            raise SettingsError("size and lens exclude each other: the camera of lens has a size")
        if self.blur:
            raise SettingsError("blur is made for pinhole images alone; leave blur or lens out")
        if self.sensor is Sensor.STEREO:
            raise SettingsError(
                "lens is of one camera; give the settings of both as lens_pair, or take the sensor "
                "mono or rgbd"
            )

    def _check_lens_pair(self, pair: Settings) -> None:
        if not isinstance(pair, Settings):
            raise SettingsError(f"lens_pair is {shown(pair)}; give Settings of a raw pair")
        if self.size is not None or self.lens is not None:
            raise SettingsError(
                "lens_pair (--lens) sets size and lenses of both cameras; leave size and lens out"
            )
        if self.blur or self.imu:
            raise SettingsError("a raw pair (--lens) goes without blur and imu; leave them out")
        check_lens_pair(pair, Sensor(self.sensor))

    def _check_pieces(self) -> None:
        _check_range("pieces", self.pieces, 1, 1000, whole=True)
        _check_range("gap", self.gap, 0, 1000)
        _check_range("overlap", self.overlap, 0, 1000)
        if self.pieces is None:
            for name in ("order", "gap", "overlap"):
                if getattr(self, name) is not None:
                    raise SettingsError(f"{name} applies to a way in pieces; give pieces as well")
        elif self.order is not None:
            object.__setattr__(self, "order", _order_of(self.order, self.pieces))
        if self.gap and len(self.order or range(self.pieces or 0)) == 1:
            raise SettingsError(
                "gap is the time between pieces, and only one comes; give more pieces, or leave it "
                "out"
            )
        if self.overlap and self.pieces == 1:
            raise SettingsError(
                "overlap is what pieces share, and there is only one; give more pieces, or leave "
                "it out"
            )

    def _check_imu(self) -> None:
        if not isinstance(self.imu, bool):
            raise SettingsError(f"imu is {shown(self.imu)}; give True or False")
        if self.imu_noise is not None:
            if not self.imu:
                raise SettingsError("imu_noise is that of an IMU; give imu (--imu) as well")
            imu_noise(self.imu_noise)
        if self.imu and self.pieces is not None:
            raise SettingsError(
                "the camera jumps between pieces, which no IMU can measure; leave out imu or pieces"
            )

    def _check_pace(self) -> None:
        _check_range("pace", self.pace, 0.01, 100)
        world = SyntheticWorld(self.world)
        if self.speed is not None and world in WITHOUT_WAY:
            raise SettingsError(
                f"speed does not apply to the {world}: {WITHOUT_WAY[world]}; leave it out"
            )
        if self.speed is not None and self.pace != 1:
            raise SettingsError("speed and pace exclude each other: both say how fast; give one")


def _member(kind: type[Enum], name: str, value: object) -> Enum:
    try:
        return kind(value)
    except ValueError:
        names = ", ".join(str(member) for member in kind)
        raise SettingsError(f"{name} is '{value}'; there are {names}") from None


def _check_range(
    name: str, value: float | None, low: float, high: float, *, whole: bool = False
) -> None:
    if value is None:
        return
    if not (is_whole(value) if whole else is_number(value)) or not low <= value <= high:
        kind = "whole numbers " if whole else ""
        raise SettingsError(f"{name} is {shown(value)}; allowed: {kind}{low:g} to {high:g}")


def _check_size(size: Any) -> None:
    if not isinstance(size, tuple | list) or len(size) != 2:
        raise SettingsError(f"size is {shown(size)}; give width and height, such as (640, 480)")
    for pixels in size:
        _check_range("size", pixels, 64, 8192, whole=True)


def _check_cover(cover: Any) -> None:
    if not isinstance(cover, tuple | list):
        _check_range("cover", cover, 0, 1000)
        return
    if len(cover) != 2:
        raise SettingsError(
            f"cover has {len(cover)} numbers; give the seconds, or when it begins and the seconds"
        )
    _check_range("beginning of cover", cover[0], 0, 1_000_000)
    _check_range("cover", cover[1], 0, 1000)


def _order_of(order: Any, n_pieces: int) -> tuple[int, ...]:
    if not isinstance(order, tuple | list) or not len(order):
        raise SettingsError(f"order is {shown(order)}; give numbers of pieces, such as (2, 0, 1)")
    for number in order:
        _check_range("order", number, 0, n_pieces - 1, whole=True)
    if len(set(order)) < len(order):
        raise SettingsError("order names a piece twice; name each at most once")
    return tuple(int(number) for number in order)


def _check_exposure(exposure: Any) -> None:
    if not isinstance(exposure, tuple | list):
        _check_range("exposure", exposure, 0.01, 100)
        return
    if len(exposure) != 2:
        raise SettingsError(
            f"exposure has {len(exposure)} factors; give one, or the least and the most"
        )
    for factor in exposure:
        _check_range("exposure", factor, 0.01, 100)
    if exposure[0] > exposure[1]:
        raise SettingsError(
            f"exposure is {exposure[0]:g} to {exposure[1]:g}; give the least factor first"
        )

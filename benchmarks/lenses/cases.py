# SPDX-License-Identifier: BSD-3-Clause
"""Pairs of cameras that see the same path: the one that is judged, and its reference."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import orbslam2py as orb
from orbslam2py._arrays import FloatArray
from orbslam2py.settings import CameraSettings, DepthSettings, OrbSettings, RigCamera, Settings
from orbslam2py.settings.pair_cameras import cameras_of_pair

PARTS = ("lenses", "pairs", "rigs")
WORLDS = ("corridor", "room", "street")
SENSORS = ("mono", "stereo", "rgbd")
SIZE = (320, 240)
FEATURES = 700
_FRAMES = {"corridor": 100, "room": 100, "street": 70}
_BASELINES = {"corridor": 0.12, "room": 0.12, "street": 0.54}

#: Parameters after fx, fy, cx, cy, and the angles of view that the model can have [degrees].
LENSES: dict[str, tuple[tuple[float, ...], tuple[int, ...]]] = {
    "radtan5": ((-0.28, 0.07, 0.0005, -0.0005, 0.0), (90,)),
    "rational": ((0.3, 0.02, 0.0, 0.0, 0.001, 0.6, 0.1, 0.005), (90,)),
    "thin_prism": ((-0.2, 0.04, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.002, 0.0, -0.002, 0.0), (90,)),
    "kannala_brandt": ((-0.01, 0.02, -0.01, 0.002), (90, 150, 195)),
    "double_sphere": ((-0.2, 0.6), (90, 150, 195)),
    "eucm": ((0.62, 1.1), (90, 150, 195)),
    "mei": ((1.2, -0.05, 0.01, 0.0, 0.0), (90, 150, 195)),
    "fov": ((0.95,), (90, 150)),
}
_PINHOLES = ("radtan5", "rational")


@dataclass(frozen=True)
class Case:
    """A path through a world, seen by the judged camera and by its reference.

    Attributes
    ----------
    part, name
        Part of the table; what is judged.
    world, sensor, seed
        Of the sequence.
    judged, reference
        Options of `orbslam2py.synthetic.SyntheticOptions` that make the images, and the sensor
        where it is another one.
    """

    part: str
    name: str
    world: str
    sensor: str
    seed: int
    judged: dict[str, Any] = field(hash=False)
    reference: dict[str, Any] = field(hash=False)

    @property
    def row(self) -> tuple[str, str, str, str]:
        """What the seeds of a row have in common."""
        return self.part, self.name, self.world, self.sensor


def lens(model: str, degrees: float, cx: float | None = None) -> CameraSettings:
    """Return a camera with a horizontal angle of view."""
    parameters, _ = LENSES[model]
    unit = orb.CameraModel(model, [100.0, 100.0, 0.0, 0.0, *parameters], SIZE)
    half = math.radians(degrees / 2)
    x = float(unit.project([[math.sin(half), 0.0, math.cos(half)]])[0, 0]) / 100
    f = SIZE[0] / 2 / x
    size = {"width": SIZE[0], "height": SIZE[1]}
    x0 = SIZE[0] / 2 if cx is None else cx
    if model not in _PINHOLES:
        return CameraSettings(f, f, x0, SIZE[1] / 2, **size, model=model, lens=parameters)
    names = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
    return CameraSettings(
        f, f, x0, SIZE[1] / 2, **size, **dict(zip(names, parameters, strict=False))
    )


def _pinhole(camera: CameraSettings) -> CameraSettings:
    """Return a pinhole with as many pixels per radian in its middle."""
    f, (width, height) = camera.pixels_per_radian, SIZE
    return CameraSettings(f, f, width / 2, height / 2, width=width, height=height)


def _depth(sensor: str) -> DepthSettings | None:
    if sensor == "mono":
        return None
    return DepthSettings(40.0, 5000.0 if sensor == "rgbd" else None)


def _shifted(baseline: float, turned: bool) -> FloatArray:
    """Return ``T_right_left``; raw cameras are turned by a degree."""
    T = np.eye(4)
    if turned:
        a, b, c = 0.01, 0.018, -0.007
        rotation = np.array([[0, -c, b], [c, 0, -a], [-b, a, 0]])
        u, _, vt = np.linalg.svd(np.eye(3) + rotation)
        T[:3, :3] = u @ vt
    T[:3, 3] = -T[:3, :3] @ [baseline, 0.0, 0.0]
    return T


def _pair(left: CameraSettings, right: CameraSettings, T: FloatArray) -> dict[str, Any]:
    settings = Settings(
        sensor="stereo",
        **cameras_of_pair(left, right, T, SIZE).fields,
        orb=OrbSettings(n_features=FEATURES),
        depth=_depth("stereo"),
    )
    return {"lens_pair": settings}


def _camera(camera: CameraSettings, sensor: str, baseline: float, turned: bool) -> dict[str, Any]:
    if sensor == "stereo":
        return _pair(camera, camera, _shifted(baseline, turned))
    return {"lens": camera}


def _rows_of_lenses() -> Iterator[tuple[str, int, str, str]]:
    """Each model with each world, each sensor and each angle that it can have, at least once."""
    for number, (model, (_, angles)) in enumerate(LENSES.items()):
        for row in range(3):
            yield (
                model,
                angles[(row + number) % len(angles)],
                WORLDS[row],
                SENSORS[(row + number // 3 + number) % 3],
            )


def _lenses(seed: int) -> Iterator[Case]:
    for model, degrees, world, sensor in _rows_of_lenses():
        camera = lens(model, degrees)
        baseline = _BASELINES[world]
        yield Case(
            "lenses",
            f"{model} {degrees}",
            world,
            sensor,
            seed,
            _camera(camera, sensor, baseline, turned=True),
            _camera(_pinhole(camera), sensor, baseline, turned=False),
        )


def _pairs(seed: int) -> Iterator[Case]:
    for model, degrees in (("radtan5", 90), ("kannala_brandt", 90), ("kannala_brandt", 150)):
        for world in WORLDS:
            left, right = lens(model, degrees), lens(model, degrees, cx=SIZE[0] / 2 - 4)
            raw = _pair(left, right, _shifted(_BASELINES[world], turned=True))
            found = raw["lens_pair"]
            seen = _pinhole(left) if found.rectification is None else found.camera
            f, cx, cy = seen.fx, seen.cx, seen.cy
            ideal = CameraSettings(f, f, cx, cy, width=SIZE[0], height=SIZE[1])
            rectified = _pair(ideal, ideal, _shifted(_BASELINES[world], turned=False))
            yield Case("pairs", f"{model} {degrees}", world, "stereo", seed, raw, rectified)


def _mounted(yaw: float, place: Sequence[float]) -> FloatArray:
    """``T_body_camera`` of a camera that is turned about the vertical [degrees, m]."""
    c, s = math.cos(math.radians(yaw)), math.sin(math.radians(yaw))
    T = np.eye(4)
    T[:3, :3] = [[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]
    T[:3, 3] = place
    return T


def _rig(members: Sequence[RigCamera]) -> dict[str, Any]:
    settings = Settings(
        sensor="rig",
        camera=members[0].camera,
        orb=OrbSettings(n_features=FEATURES),
        depth=DepthSettings(40.0, 5000.0),
        rig=tuple(members),
    )
    return {"rig": settings}


def _rigs(seed: int) -> Iterator[Case]:
    wide = lens("kannala_brandt", 150)
    pinhole = _pinhole(wide)
    front = [RigCamera(wide), RigCamera(wide, _mounted(0, (0.12, 0, 0)))]
    rear = [
        RigCamera(wide, _mounted(180, (0.12, 0, -0.2))),
        RigCamera(wide, _mounted(180, (0, 0, -0.2))),
    ]
    around = [
        RigCamera(wide),
        RigCamera(wide, _mounted(90, (0.12, 0, -0.12))),
        RigCamera(wide, _mounted(180, (0, 0, -0.24))),
        RigCamera(wide, _mounted(-90, (-0.12, 0, -0.12))),
    ]
    depths = [
        RigCamera(pinhole, depth=True),
        RigCamera(pinhole, _mounted(180, (0, 0, -0.2)), depth=True),
    ]
    rigs = {
        "pair, one to the rear": [*front, rear[0]],
        "two pairs": [*front, *rear],
        "four around": around,
    }
    for world in ("corridor", "room"):
        for name, members in rigs.items():
            yield Case("rigs", name, world, "rig", seed, _rig(members), _rig(front))
        one = {"lens": pinhole, "sensor": "rgbd"}
        yield Case("rigs", "two depth cameras", world, "rig", seed, _rig(depths), one)


def cases(parts: Sequence[str], seeds: Sequence[int]) -> list[Case]:
    """All of them, seed by seed."""
    makers = {"lenses": _lenses, "pairs": _pairs, "rigs": _rigs}
    return [case for seed in seeds for part in parts for case in makers[part](seed)]


def frames_of(world: str) -> int:
    """Number of images of a run in a world."""
    return _FRAMES[world]

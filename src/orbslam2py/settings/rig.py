# SPDX-License-Identifier: BSD-3-Clause
"""The cameras of a rig: how they are mounted, and which of them gives which one its depths."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from orbslam2py._arguments import shown
from orbslam2py._arrays import EqualByValue, FloatArray, MadeAgainByCopies
from orbslam2py.errors import SettingsError
from orbslam2py.settings.extrinsics import inverse_of, rigid_transform
from orbslam2py.settings.groups import CameraSettings

#: Most cameras of a rig.
MOST_CAMERAS = 8
#: Distance of two cameras that a camera with depth images counts as [m]: as in files for TUM.
VIRTUAL_BASELINE = 0.075
#: Points are close below this many baselines, if nothing else is said.
USUAL_CLOSE_FACTOR = 40.0
#: Rays per side by which views are compared, and their length in baselines.
_RAYS, _FAR = 17, 50.0
#: Least share of a view that another camera must share to give it depths.
_LEAST_OVERLAP = 0.1
#: Share from which on two cameras see the same, so that keypoints of one of them are enough.
_SAME_VIEW = 0.7
#: Two cameras that are nearer than this see no depth [m].
_LEAST_BASELINE = 1e-3
#: Distance of a camera from the first one that is hardly in metres [m].
_MOST_DISTANCE = 5.0


@dataclass(frozen=True, eq=False)
class RigCamera(EqualByValue, MadeAgainByCopies):
    """A camera of a rig.

    Attributes
    ----------
    camera
        Its lens and intrinsics, with the width and the height of its images.
    T_body_camera
        From its coordinates to those of the body, (4, 4), metres: its translation is where the
        camera stands. The body is the first camera, whose transform is the identity. Kalibr and
        others give the inverse.
    depth
        It delivers depth images, registered to its images.

    Raises
    ------
    SettingsError
        If the transform is not rigid, or the size of the images is missing.
    """

    camera: CameraSettings
    T_body_camera: FloatArray = field(default_factory=lambda: np.eye(4))
    depth: bool = False

    def __post_init__(self) -> None:
        if not isinstance(self.camera, CameraSettings):
            raise SettingsError(f"a camera of the rig is {shown(self.camera)}; give CameraSettings")
        if self.camera.width is None or self.camera.height is None:
            raise SettingsError(
                "the size of the images of a camera of the rig is missing; give width and height "
                "in pixels (Camera1.width, Camera1.height)"
            )
        if not isinstance(self.depth, bool):
            raise SettingsError(f"depth is {shown(self.depth)}; give True or False")
        pose = rigid_transform(self.T_body_camera, "T_body_camera")
        object.__setattr__(self, "T_body_camera", pose)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the images [pixels]."""
        assert self.camera.width is not None and self.camera.height is not None
        return self.camera.width, self.camera.height

    @property
    def centre(self) -> FloatArray:
        """Position of the camera in the body, (3,), metres."""
        return self.T_body_camera[:3, 3]


class DepthSource(NamedTuple):
    """Source of the depths of a camera of a rig.

    Attributes
    ----------
    partner
        The camera that is matched with it; None without one.
    image
        It has depth images.
    active
        Its keypoints are used. Not so those of a partner that sees nearly the same, as the right
        camera of a pair, unless the other camera has no image.
    """

    partner: int | None = None
    image: bool = False
    active: bool = True

    @property
    def has_depth(self) -> bool:
        """Whether the camera has depths at all."""
        return self.image or self.partner is not None


def checked_rig(cameras: Sequence[RigCamera]) -> tuple[RigCamera, ...]:
    """Check the cameras of a rig.

    Raises
    ------
    SettingsError
        If there are not 2 to 8, the first one is not the body, or none has depths.
    """
    rig = tuple(cameras) if isinstance(cameras, Sequence) else (cameras,)
    if not all(isinstance(camera, RigCamera) for camera in rig):
        raise SettingsError(f"rig is {shown(cameras)}; give a sequence of RigCamera(...)")
    if not 2 <= len(rig) <= MOST_CAMERAS:
        raise SettingsError(
            f"a rig has 2 to {MOST_CAMERAS} cameras, and this one {len(rig)}; for one camera or "
            "one pair take the sensors mono, stereo or rgbd"
        )
    if not np.allclose(rig[0].T_body_camera, np.eye(4), atol=1e-9):
        raise SettingsError(
            "the first camera of a rig is its body, so its T_body_camera must be the identity; "
            "give all others relative to it"
        )
    if not any(source.has_depth for source in depth_sources(rig)):
        raise SettingsError(
            "no camera of the rig has depths: no two views overlap, and none has depth images, so "
            "the scale is unknown. Check the extrinsics (T_c1_c2: from camera 2 to camera 1, "
            "metres; a calibration may give the inverse), say which cameras deliver depth images "
            "(Camera1.depth: 1), or track one camera with --sensor mono"
        )
    return rig


def overlap(first: RigCamera, second: RigCamera) -> float:
    """Return the share of a camera's view that another one also sees, 0 to 1."""
    width, height = first.size
    columns, rows = np.linspace(0, width - 1, _RAYS), np.linspace(0, height - 1, _RAYS)
    pixels = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
    rays = first.camera.camera_model(width, height).unproject(pixels)
    rays = rays[np.isfinite(rays).all(axis=1)]
    T = inverse_of(second.T_body_camera) @ first.T_body_camera
    far = _FAR * max(float(np.linalg.norm(T[:3, 3])), _LEAST_BASELINE)
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    seen = second.camera.camera_model(*second.size).project(far * rays @ T[:3, :3].T + T[:3, 3])
    inside = ((seen >= 0) & (seen <= np.array(second.size) - 1)).all(axis=1)  # False for NaN
    return float(np.count_nonzero(inside)) / max(1, len(rays))


def _alike(first: RigCamera, second: RigCamera) -> float:
    """1 for two cameras that look in one direction, 0 for opposite ones."""
    return 0.5 + 0.5 * float(first.T_body_camera[:3, 2] @ second.T_body_camera[:3, 2])


def depth_sources(rig: Sequence[RigCamera]) -> tuple[DepthSource, ...]:
    """Find each camera's source of depths: its depth images, or the camera with most overlap."""
    n = len(rig)
    shared = np.zeros((n, n))
    for i in range(n):
        for j in range(n):
            apart = float(np.linalg.norm(rig[i].centre - rig[j].centre))
            if i != j and apart > _LEAST_BASELINE:
                shared[i, j] = overlap(rig[i], rig[j])
    sources: list[DepthSource] = []
    only_partner: set[int] = set()
    for i in range(n):
        if rig[i].depth:
            sources.append(DepthSource(image=True))
            continue
        # Of equal ones the next in the order, so that cameras in a circle take turns. The same
        # thing looks the more alike in both images, the less one camera is turned to the other.
        score = [round(shared[i, j] * _alike(rig[i], rig[j]), 2) for j in range(n)]
        order = sorted(range(n), key=lambda j: (-score[j], (j - i) % n))
        partner = order[0] if score[order[0]] >= _LEAST_OVERLAP else None
        sources.append(DepthSource(partner=partner, active=i not in only_partner))
        if partner is None or i in only_partner or partner < i or rig[partner].depth:
            continue
        if min(shared[i, partner], shared[partner, i]) >= _SAME_VIEW:
            only_partner.add(partner)
    return tuple(sources)


def doubts_of_rig(rig: Sequence[RigCamera]) -> list[str]:
    """Return values that are allowed but probably wrong, one sentence each."""
    return [
        f"Camera{i + 1} stands {np.linalg.norm(camera.centre):.4g} m from Camera1; extrinsics are "
        "in metres: divide translations in millimetres by 1000"
        for i, camera in enumerate(rig)
        if np.linalg.norm(camera.centre) > _MOST_DISTANCE
    ]


def describe_rig(rig: Sequence[RigCamera]) -> list[str]:
    """Return a line for each camera of a rig: its lens, its place and its depths."""
    lines = []
    for i, (member, source) in enumerate(zip(rig, depth_sources(rig), strict=True), 1):
        place = ", ".join(f"{value:.3g}" for value in member.centre)
        depths = "depth images" if source.image else "no depths"
        if source.partner is not None:
            depths = f"depths with camera {source.partner + 1}"
        if not source.active:
            depths = "gives depths to another camera"
        lines.append(
            f"camera {i} of {len(rig)}: {member.size[0]}x{member.size[1]}, {member.camera.model}, "
            f"at ({place}) m; {depths}"
        )
    return lines

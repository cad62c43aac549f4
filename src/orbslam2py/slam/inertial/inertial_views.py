# SPDX-License-Identifier: BSD-3-Clause
"""Views for the start of an IMU: poses of images, and the IMU samples between them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from orbslam2py import _core as core
from orbslam2py._arrays import FloatArray

#: Views that an estimate uses at most: it solves for nine unknowns each.
_MOST = 30
#: Seconds between views at first, and at most.
_SPACING, _WIDEST = 0.2, 0.8


@dataclass(frozen=True, eq=False)
class InertialView:
    """The pose of an image relative to a keyframe, which may move."""

    timestamp: float
    keyframe: int
    T_ck: core.Pose
    """From the keyframe to the camera."""
    deviations: tuple[float, float]
    """Standard deviations of rotation [rad] and position, from the covariance of the pose."""
    samples: FloatArray = field(repr=False)
    """(n, 7), IMU samples since the view before."""

    def T_wc(self, slam_map: core.Map) -> core.Pose:
        """Return the pose in the present map."""
        return (self.T_ck @ slam_map.keyframe_pose(self.keyframe)).inverse()


class InertialViews:
    """Collects at most 30 views for the start of the IMU; their spacing grows with time."""

    def __init__(self) -> None:
        self.views: list[InertialView] = []
        self._spacing = _SPACING
        self._samples: list[FloatArray] = []

    def clear(self) -> None:
        """Remove all views."""
        self.views.clear()
        self._samples.clear()
        self._spacing = _SPACING

    @property
    def seconds(self) -> float:
        """Time from the first view to the last."""
        return self.views[-1].timestamp - self.views[0].timestamp if self.views else 0.0

    def add(
        self,
        slam_map: core.Map,
        frame: core.TrackedFrame,
        covariance: FloatArray | None,
        samples: FloatArray | None,
    ) -> bool:
        """Add a frame; return whether it became a view.

        Parameters
        ----------
        slam_map : orbslam2py._core.Map
            The map of the frame's pose.
        frame : orbslam2py._core.TrackedFrame
            A tracked frame, with its pose.
        covariance : array of float64, (6, 6), or None
            Covariance of its pose.
        samples : array of float64, (n, 7), or None
            IMU samples since the frame before; None removes all views, because samples are missing.
        """
        if samples is None:
            self.clear()
        elif self.views:
            self._samples.append(samples)
            if frame.timestamp - self.views[-1].timestamp < self._spacing:
                return False
        if frame.T_cw is None:
            return False
        keyframe = frame.reference_keyframe
        T_ck = frame.T_cw @ slam_map.keyframe_pose(keyframe).inverse()
        view = InertialView(
            frame.timestamp, keyframe, T_ck, _deviations(covariance), joined(self._samples)
        )
        self._samples = []
        self.views.append(view)
        self._thin()
        return True

    def _thin(self) -> None:
        if len(self.views) <= _MOST:
            return
        if 2 * self._spacing > _WIDEST:
            del self.views[0]
            return
        self._spacing *= 2
        first = (len(self.views) - 1) % 2
        kept = []
        for i in range(first, len(self.views), 2):
            view, before = self.views[i], self.views[i - 1 : i] if i > first else []
            samples = joined([*(one.samples for one in before), view.samples])
            kept.append(
                InertialView(view.timestamp, view.keyframe, view.T_ck, view.deviations, samples)
            )
        self.views = kept


def joined(parts: list[FloatArray]) -> FloatArray:
    """Join samples of neighbouring intervals, which share the reading between them."""
    parts = [part for part in parts if len(part)]
    if not parts:
        return np.zeros((0, 7))
    return np.concatenate([parts[0], *(part[1:] for part in parts[1:])])


def _deviations(covariance: FloatArray | None) -> tuple[float, float]:
    if covariance is None:
        return 0.0, 0.0
    variances = np.diag(covariance)
    return float(np.sqrt(variances[:3].mean())), float(np.sqrt(variances[3:].mean()))

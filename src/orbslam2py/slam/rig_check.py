# SPDX-License-Identifier: BSD-3-Clause
"""Whether the cameras of a rig are mounted as the calibration says, by what pairs of them see."""

from __future__ import annotations

import logging
from collections.abc import Sequence

import numpy as np

from orbslam2py import _core as core
from orbslam2py.settings.extrinsics import inverse_of
from orbslam2py.settings.rig import DepthSource, RigCamera, overlap

_log = logging.getLogger(__name__)

#: Number of frames that are checked, and least number of keypoints of such a frame.
_FRAMES, _LEAST_KEYPOINTS = 10, 100
#: Share of the keypoints in the common view that find their partner at least.
_LEAST_SHARE = 0.04
#: The inverse extrinsics explain the images if they find this many times as many partners.
_CLEARLY_MORE = 3.0


class RigCheck:
    """Counts the depths that overlapping cameras of a rig give, in the first frames.

    Parameters
    ----------
    rig : sequence of RigCamera
        The cameras.
    sources : sequence of DepthSource
        Source of the depths of each camera.
    scales : ScalePyramid
        Of the extraction.

    Attributes
    ----------
    warning : str or None
        The logged text.
    """

    def __init__(
        self, rig: Sequence[RigCamera], sources: Sequence[DepthSource], scales: core.ScalePyramid
    ) -> None:
        self._rig, self._sources, self._scales = rig, sources, scales
        #: Frames, keypoints and those with depth, by camera.
        self._counts = {
            i: np.zeros(3) for i, s in enumerate(sources) if s.partner is not None and s.active
        }
        self.warning: str | None = None

    def look(
        self,
        pairs: Sequence[core.WidePair | None],
        extractions: Sequence[core.Extraction],
        there: Sequence[bool],
    ) -> None:
        """Look at one frame, until there were enough."""
        for i in list(self._counts):
            partner, pair = self._sources[i].partner, pairs[i]
            assert partner is not None and pair is not None
            n = len(extractions[i].keypoints)
            if not (there[i] and there[partner]) or n < _LEAST_KEYPOINTS:
                continue
            if len(extractions[partner].keypoints) < _LEAST_KEYPOINTS:
                continue
            counts = self._counts[i]
            counts += 1, n, _n_depths(pair, extractions[i], extractions[partner], self._scales)
            if counts[0] < _FRAMES:
                continue
            self._judge(i, partner, extractions)

    def _judge(self, i: int, partner: int, extractions: Sequence[core.Extraction]) -> None:
        counts = self._counts.pop(i)
        frames, n, n_depths = counts
        if n_depths >= _LEAST_SHARE * overlap(self._rig[i], self._rig[partner]) * n:
            return
        inverse = self._inverse_pair(i, partner)
        by_inverse = _n_depths(inverse, extractions[i], extractions[partner], self._scales)
        found = (
            f"camera {i + 1} of the rig finds the distance of {n_depths / frames:.0f} of "
            f"{n / frames:.0f} keypoints with camera {partner + 1}, which sees the same by its "
            "extrinsics"
        )
        if by_inverse > _CLEARLY_MORE * max(n_depths / frames, 5):
            self.warning = (
                f"{found}; by the inverse extrinsics it finds {by_inverse}: Camera2.T_c1_c2 maps "
                "coordinates of camera 2 into those of camera 1, and so on; give the inverse "
                "transforms"
            )
        else:
            self.warning = (
                f"{found}: look at the extrinsics (metres, from camera 2 to camera 1), at the "
                "order of the cameras, and whether their images are of one moment"
            )
        _log.warning("%s", self.warning)

    def _inverse_pair(self, i: int, partner: int) -> core.WidePair:
        """Both cameras, if every extrinsic transform were given the wrong way round."""
        first, second = (inverse_of(np.asarray(self._rig[k].T_body_camera)) for k in (i, partner))
        T = inverse_of(first) @ second
        member = self._rig[i]
        camera = core.Camera(
            core.CameraOptions(
                width=member.size[0],
                height=member.size[1],
                depth_ratio=1.0,
                model=member.camera.camera_model(*member.size).core,
                right_centre=np.ascontiguousarray(T[:3, 3]),
            )
        )
        other = self._rig[partner]
        T_partner = inverse_of(T)
        return core.WidePair(
            camera,
            other.camera.camera_model(*other.size).core,
            np.ascontiguousarray(T_partner[:3, :3]),
            np.ascontiguousarray(T_partner[:3, 3]),
        )


def _n_depths(
    pair: core.WidePair,
    first: core.Extraction,
    second: core.Extraction,
    scales: core.ScalePyramid,
) -> int:
    return int(np.count_nonzero(pair.match(first, second, scales)[1] > 0))

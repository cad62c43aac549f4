# SPDX-License-Identifier: BSD-3-Clause
"""Images of some frames with their map points: frame_images.zip."""

from __future__ import annotations

import logging
import zipfile
from pathlib import Path
from typing import TypeGuard, cast

import cv2
import numpy as np

from orbslam2py._arrays import FloatArray, IntArray
from orbslam2py._files import atomic_write, describe_error
from orbslam2py.datasets.base import LiveSource, Sequence, Source
from orbslam2py.errors import OrbSlamError
from orbslam2py.runs.feeds import is_sequence
from orbslam2py.runs.kept_images import SmallImage, shrink
from orbslam2py.runs.result import RunResult
from orbslam2py.settings.settings import Settings
from orbslam2py.trajectory.rotations import inverse_poses

_log = logging.getLogger(__name__)

#: Keyframes that are shown, spread evenly over those of the main map.
_N_KEYFRAMES = 8
#: Frames in which tracking was lost that are shown.
_N_LOST = 4
_QUALITY = 72

#: Fill and rim of a point [BGR]: visible on light and dark ground, also for colour-blind people.
_FILL, _RIM = (66, 228, 240), (60, 40, 0)


def has_images(source: Source) -> TypeGuard[Sequence]:
    """Return whether images can be read again, unlike those of a camera."""
    return is_sequence(cast("Sequence | LiveSource", source))


def has_any_images(result: RunResult) -> bool:
    """Return whether images of a run can be shown: read again, or kept during the run."""
    return has_images(result.sequence) or bool(_kept(result))


def _kept(result: RunResult) -> list[int]:
    return [] if result.kept_images is None else result.kept_images.positions


def choose_frames(result: RunResult, extra: IntArray | None = None) -> list[int]:
    """Choose the most informative frames.

    Parameters
    ----------
    result : RunResult
        A run that has ended.
    extra : array of int64, optional
        Positions of further frames in `RunResult.rows`.

    Returns
    -------
    list of int
        Positions in `RunResult.rows`, ascending: some keyframes of the main map, those of its
        loops, the first images of losses, and the further ones.
    """
    keyframes = result.keyframes.indices
    if result.kept_images is not None:
        keyframes = keyframes[np.isin(keyframes, _kept(result))]
    spread = np.unique(np.linspace(0, max(0, len(keyframes) - 1), _N_KEYFRAMES).astype(np.int64))
    chosen = set(keyframes[spread].tolist()) if len(keyframes) else set()
    snapshot = result.snapshot
    if len(result.keyframes) == len(snapshot.keyframe_ids):
        of_loops = np.isin(snapshot.keyframe_ids, snapshot.loop_edges[:3])
        chosen |= set(result.keyframes.indices[of_loops].tolist())
    states = ["OK", *(row.state for row in result.rows)]
    began = [i for i in range(len(result.rows)) if states[i] == "OK" and states[i + 1] == "LOST"]
    chosen |= set(began[:_N_LOST])
    chosen |= set([] if extra is None else extra.tolist())
    return sorted(chosen)


def write_frame_images(path: Path, result: RunResult, positions: list[int]) -> None:
    """Write images of frames as JPEG into one ZIP file, named by their numbers in the sequence.

    Map points that a keyframe observes are marked at their predicted pixels. A frame whose image
    cannot be read again is left out.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    with (
        atomic_write(path, binary=True) as stream,
        zipfile.ZipFile(stream, "w", zipfile.ZIP_STORED) as archive,
    ):
        for position in positions:
            row = result.rows[position]
            small = _find(result, position)
            if small is not None:
                points = _points_seen(result, position)
                jpeg = draw_frame(small, points, result.settings)
                # A date would make the bytes of two equal runs differ.
                archive.writestr(zipfile.ZipInfo(f"{row.index:06d}.jpg"), jpeg)


def draw_frame(small: SmallImage, points: FloatArray, settings: Settings) -> bytes:
    """Draw points into an image.

    Parameters
    ----------
    small
        The image; it is changed.
    points
        Positions in the camera's frame, float64 (p, 3), in any unit of length.
    settings
        Settings of the camera, for its lens.

    Returns
    -------
    bytes
        A JPEG file.
    """
    shown = small.picture
    size = shown.shape[1::-1]
    if len(points):
        # NaN, of points that the camera does not show, is not inside.
        pixels = settings.camera.project(points) * small.scale
        inside = np.all((pixels > -1) & (pixels < np.array(size) + 1), axis=1)
        for radius, colour in ((3, _RIM), (2, _FILL)):
            for u, v in np.rint(pixels[inside]).astype(int).tolist():
                cv2.circle(shown, (u, v), radius, colour, -1)
    done, jpeg = cv2.imencode(".jpg", shown, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
    assert done
    return jpeg.tobytes()


def _find(result: RunResult, position: int) -> SmallImage | None:
    """Return the image of a frame, read again or kept."""
    if result.kept_images is not None:
        return result.kept_images.find(position)
    source, index = result.sequence, result.rows[position].index
    if not has_images(source):
        return None
    try:
        return shrink(source.load(index).image, rgb=result.settings.camera.rgb)
    except (OrbSlamError, OSError) as error:
        _log.debug("no picture of frame %d: %s", index, describe_error(error))
        return None


def _points_seen(result: RunResult, position: int) -> FloatArray:
    """Return the points that the keyframe of a frame observes, in its camera's frame, (p, 3)."""
    snapshot = result.snapshot
    found = np.flatnonzero(result.keyframes.indices == position)
    if not len(found) or len(result.keyframes) != len(snapshot.keyframe_ids):
        return np.zeros((0, 3))
    keyframe = int(found[0])
    seen = result.sightings[result.sightings[:, 1] == snapshot.keyframe_ids[keyframe], 0]
    known = np.isin(snapshot.point_ids, seen)
    T_cw = inverse_poses(snapshot.keyframe_T_wc[keyframe][None])[0]
    points: FloatArray = snapshot.point_positions[known] @ T_cw[:3, :3].T + T_cw[:3, 3]
    return points

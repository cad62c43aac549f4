# SPDX-License-Identifier: BSD-3-Clause
"""Full bundle adjustment of a map whose sightings are first aligned to each other in the images.

``docs/method/alignment.md``.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from orbslam2py import _core as core
from orbslam2py._arguments import instance_of, is_whole, shown
from orbslam2py._arrays import ByteArray, FloatArray, IntArray
from orbslam2py.errors import DatasetError, ImageError, MapFileError
from orbslam2py.maps.contents import MapContents, contents_of
from orbslam2py.maps.exports.images import ImageSequence
from orbslam2py.maps.map_copies import restore_contents, take_contents
from orbslam2py.trajectory import associate

_log = logging.getLogger(__name__)

#: Time stamps of a keyframe and of its image are the same text, read twice [s].
_SAME_TIME = 1e-3
#: Of the images that a map was made of, at least this share of the sightings can be aligned; of
#: other images it is a fraction of that.
_LEAST_ALIGNED = 0.4

#: Called after every image with how many are done and how many there are.
Progress = Callable[[int, int], None]


class _HasImages(Protocol):
    @property
    def image(self) -> ByteArray: ...
    @property
    def right(self) -> ByteArray | None: ...


class ImagePairSequence(ImageSequence, Protocol):
    """What `align_sightings` takes: an image sequence that may have right images."""

    def load(self, index: int, /) -> _HasImages:
        """Read (and rectify) a frame: its ``image`` and, of a stereo pair, ``right``."""
        ...


@dataclass(frozen=True)
class AlignmentRecord:
    """One adjustment with aligned sightings; counts of sightings are those of the last round."""

    n_keyframes: int
    """Keyframes that took part."""
    n_images: int
    """Those of them whose image is in the sequence."""
    n_points: int
    """Points that took part."""
    n_observations: int
    """Sightings of these points by these keyframes."""
    n_aligned: int
    """Sightings that were moved to where the image looks like the reference sighting."""
    failures: dict[str, int]
    """Sightings that were not, by reason: outside, flat, not_converged, low_correlation."""
    n_right_aligned: int
    """Columns in right images of a stereo pair that were aligned as well."""
    right_failures: dict[str, int]
    """Those that were not, by reason."""
    noise: float
    """Standard deviation of an aligned coordinate, median, pixels of its pyramid level."""
    error_before: float
    """Median distance of sightings from their points at the start, pixels."""
    error_after: float
    """The same at the end, with the aligned sightings."""
    used: bool
    """False: nothing got better, and the map is as it was."""
    seconds: float
    """Time for all of it."""


def align_sightings(
    contents: MapContents,
    sequence: ImagePairSequence,
    *,
    rounds: int = 3,
    progress: Progress | None = None,
) -> tuple[MapContents, AlignmentRecord]:
    """Refine all keyframes and points of a map by sightings that are aligned in the images.

    ORB detects the corner of a point in every image separately, with errors of half a pixel. Here
    one sighting of each point is the reference, and the others are moved to where their image looks
    like it. Then everything is adjusted, as `optimize_map` does. The map keeps its keypoints as
    they were found: aligned positions serve the adjustment alone.

    Parameters
    ----------
    contents
        The map, as from `load_map`.
    sequence
        That the map was made of, opened for the same sensor.
    rounds
        How often alignment and adjustment alternate, at least 1.
    progress
        ``progress(done, total)`` after every image.

    Returns
    -------
    contents
        The refined map. Keyframe 0 stays where it is.
    record
        Numbers of aligned sightings, and errors before and after.

    Raises
    ------
    DatasetError
        If no keyframe's time stamp is in the sequence, or its images do not show the map.
    ImageError
        If an image has not the size of its camera.
    MapFileError
        If the contents are inconsistent, or an argument has the wrong type.
    """
    began = time.perf_counter()
    contents_of(contents)
    if contents.cameras.has_rigs:
        raise MapFileError(
            "the sightings of a rig's map cannot be aligned in its images yet; optimize the map "
            "without --align"
        )
    if not is_whole(rounds) or rounds < 1:
        raise MapFileError(f"rounds is {shown(rounds)}; give a whole number of at least 1")
    # Corners, as long as this has not aligned them: those that are aligned belong to other patches.
    slam_map = restore_contents(contents.without_patches())
    alignment = core.SightingAlignment(slam_map)
    images = _Images(contents, alignment.keyframes, sequence, rounds, progress)
    error_before = alignment.median_error
    for keyframe, left, _ in images:
        alignment.take_references(keyframe, left)
    options = core.FullBundleOptions(iterations=10)
    for number in range(rounds):
        alignment.begin_round()
        for keyframe, left, right in images:
            alignment.align(keyframe, left, right)
        if number == 0:
            _check_share(alignment.counts)
        alignment.weigh()
        alignment.solve(options)
    used = alignment.commit(slam_map).committed
    refined = take_contents(slam_map)
    # No keyframe comes or goes, and nothing here knows the vocabulary.
    keyframes = replace(refined.keyframes, words=contents.keyframes.words)
    record = _record(alignment, images, error_before, used, time.perf_counter() - began)
    refined = replace(
        refined,
        map_index=contents.map_index,
        keyframes=keyframes,
        imu_states=contents.imu_states,
        patches=contents.patches,
        aligned=contents.aligned,
        alignment_noise=contents.alignment_noise,
    )
    return refined, record


class _Images:
    """Images of keyframes, read again at each pass, because all may not fit into memory."""

    def __init__(
        self,
        contents: MapContents,
        wanted: IntArray,
        sequence: ImagePairSequence,
        rounds: int,
        progress: Progress | None,
    ) -> None:
        keyframes = contents.keyframes
        times = keyframes.timestamps[np.searchsorted(keyframes.ids, wanted)]
        rows, indices = associate(times, sequence.timestamps, _SAME_TIME)
        if not len(rows):
            raise DatasetError(
                f"no image of the sequence has the time stamp of a keyframe (keyframes "
                f"{_span(times)}, images {_span(sequence.timestamps)}); give the sequence that the "
                "map was made of"
            )
        if len(rows) < len(wanted):
            _log.warning(
                "%d of %d keyframes have no image in the sequence; their sightings are not aligned",
                len(wanted) - len(rows),
                len(wanted),
            )
        self._places = list(zip(wanted[rows].tolist(), indices.tolist(), strict=True))
        self._sequence = sequence
        self._progress = progress
        self._total = len(self._places) * (rounds + 1)
        self._done = 0

    def __len__(self) -> int:
        return len(self._places)

    def __iter__(self) -> Any:
        """Yield keyframe id, left and right grey image; None for the right one if there is none."""
        rgb = self._sequence.settings.camera.rgb
        for keyframe, index in self._places:
            images = self._sequence.load(index)
            right = images.right
            yield (
                keyframe,
                _grey(images.image, rgb, keyframe),
                None if right is None else _grey(right, rgb, keyframe),
            )
            self._done += 1
            if self._progress is not None:
                self._progress(self._done, self._total)


def _grey(image: ByteArray, rgb: bool, keyframe: int) -> ByteArray:
    instance_of(image, np.ndarray, f"the image of keyframe {keyframe}", "an array", ImageError)
    return core.to_grey(image, rgb)


def _check_share(counts: list[int]) -> None:
    """Refuse images that do not look like the points: they would be wrong."""
    n = sum(counts)
    if n and counts[0] < _LEAST_ALIGNED * n:
        raise DatasetError(
            f"only {counts[0]} of {n} sightings look alike in these images, so they do not "
            "show the map; give the sequence that the map was made of"
        )


def _record(
    alignment: core.SightingAlignment,
    images: _Images,
    error_before: float,
    used: bool,
    seconds: float,
) -> AlignmentRecord:
    counts, right_counts = alignment.counts, alignment.right_counts
    return AlignmentRecord(
        n_keyframes=len(alignment.keyframes),
        n_images=len(images),
        n_points=alignment.n_points,
        n_observations=alignment.n_observations,
        n_aligned=counts[0],
        failures=_by_reason(counts),
        n_right_aligned=right_counts[0],
        right_failures=_by_reason(right_counts),
        noise=alignment.noise.deviation,
        error_before=error_before,
        error_after=alignment.median_error,
        used=used,
        seconds=seconds,
    )


def _by_reason(counts: list[int]) -> dict[str, int]:
    reasons = core.AlignmentFailure.__members__
    return {name.lower(): counts[int(value)] for name, value in reasons.items() if int(value)}


def _span(timestamps: FloatArray) -> str:
    if not len(timestamps):
        return "none"
    return f"{timestamps[0]:.3f} to {timestamps[-1]:.3f} s"

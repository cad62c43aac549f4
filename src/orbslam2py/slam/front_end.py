# SPDX-License-Identifier: BSD-3-Clause
"""From images to frames: input checks, grey values, features, depth."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from orbslam2py import _core as core
from orbslam2py._depth_size import depth_size_problem, enlarged_depth
from orbslam2py._sixteen_bits import REMEDY
from orbslam2py._timing import StageTimer
from orbslam2py.errors import ImageError
from orbslam2py.settings.depth_check import DepthCheck
from orbslam2py.settings.fit import find_misfit
from orbslam2py.settings.sensor import Sensor
from orbslam2py.settings.settings import Settings
from orbslam2py.slam.pair_check import PairCheck
from orbslam2py.slam.raw_pairs import raw_pairs_of, wide_pair_of

#: Pixels per side from which on an image has room for a cell of corners (30 pixels) between its
#: borders (16 on each side): `features/corner_grid.hpp`.
SMALLEST_SIDE = 62
_log = logging.getLogger(__name__)

Mask = npt.NDArray[np.uint8]
#: For a pair: one mask for both images, or (left, right), either of which may be None.
PairMask = Mask | tuple[Mask | None, Mask | None]


#: Looks for known points in a grey image; None where too few are found.
Follow = Callable[[core.FrameContext, npt.NDArray[np.uint8]], core.FollowedPoints | None]

_LARGEST_NUMBER = 8  # bytes of the largest type of depth that is converted


class FrontEnd:
    """Builds frames from images; the first image fixes the size until a reset.

    Parameters
    ----------
    settings : Settings
        Calibration and extractor settings.
    sensor : Sensor
        The sensor.
    check_calibration : bool
        Warn if the calibration cannot belong to images of that size.
    keep_images : bool
        Frames keep their image pyramids until these are released.
    align_right : bool
        Align the right images of pairs to the left ones; needs the images.
    """

    def __init__(
        self,
        settings: Settings,
        sensor: Sensor,
        *,
        check_calibration: bool = True,
        keep_images: bool = False,
        align_right: bool = False,
    ) -> None:
        self._settings = settings
        self._sensor = sensor
        self._context: core.FrameContext | None = None
        self._size: tuple[int, int] | None = None
        options = orb_options(settings)
        self._extractor = core.OrbExtractor(options)
        # By the factor on the number of features; more while a single camera starts.
        self._extractors = {1: self._extractor}
        self._pair_extractor = core.PairExtractor(options) if sensor is Sensor.STEREO else None
        self._raw_pairs = raw_pairs_of(settings, self._extract_pair)
        self._wide_pair: core.WidePair | None = None
        self._check_calibration = check_calibration
        self._keep_images = keep_images or align_right
        self._align_right = align_right
        self._told_depth_size = False
        self.depth_check = DepthCheck(settings.depth_factor)
        self.pair_check = PairCheck()

    @property
    def depth_warning(self) -> str | None:
        """Why depth will be wrong, as the first images say: its factor, or pairs that are none."""
        raw = None if self._raw_pairs is None else self._raw_pairs.warning
        return self.depth_check.warning or self.pair_check.warning or raw

    def reset(self) -> None:
        """Let the next image have any size: a new map begins."""
        self._context = None
        self._wide_pair = None
        self._size = None

    def monocular(
        self,
        image: npt.NDArray[np.uint8],
        frame_id: int,
        timestamp: float,
        timer: StageTimer,
        mask: Mask | None = None,
        *,
        feature_factor: int = 1,
    ) -> core.Frame:
        """Frame of a single camera; with a multiple of the settings' features."""
        self._check(image, "image")
        check_mask(mask, image, "mask")
        context = self._context_for(image)
        with timer("extract"):
            grey = core.to_grey(image, self._settings.camera.rgb)
            extractor = self._extractor_for(feature_factor)
            extraction = extractor.extract(grey, mask)
            frame = core.build_monocular_frame(context, frame_id, timestamp, extraction)
            return self._finished(frame, image, grey, extraction)

    def without_features(
        self,
        image: npt.NDArray[np.uint8],
        depth: npt.NDArray[np.generic] | None,
        frame_id: int,
        timestamp: float,
        follow: Follow,
    ) -> tuple[core.FollowedPoints, core.Frame] | None:
        """Follow known points in an image of one camera, without features.

        Parameters
        ----------
        image, depth
            As for `monocular` and `rgbd`; no depth with a single camera.
        frame_id, timestamp
            Of the frame.
        follow
            Looks for the points in the grey image.

        Returns
        -------
        tuple or None
            The points, and the frame of their keypoints; None where too few were found.
        """
        self._check(image, "image")
        if depth is not None:
            depth = self._depth_of(depth, image)
        context = self._context_for(image)
        grey = core.to_grey(image, self._settings.camera.rgb)
        followed = follow(context, grey)
        if followed is None:
            return None
        extraction = followed.extraction
        if depth is None:
            frame = core.build_monocular_frame(context, frame_id, timestamp, extraction)
        else:
            frame = core.build_rgbd_frame(
                context, frame_id, timestamp, extraction, depth, self._settings.depth_factor
            )
        return followed, self._finished(frame, image, grey, extraction)

    def _extractor_for(self, factor: int) -> core.OrbExtractor:
        if factor not in self._extractors:
            options = orb_options(self._settings, factor=factor)
            self._extractors[factor] = core.OrbExtractor(options)
        return self._extractors[factor]

    def stereo(
        self,
        left: npt.NDArray[np.uint8],
        right: npt.NDArray[np.uint8],
        frame_id: int,
        timestamp: float,
        timer: StageTimer,
        mask: PairMask | None = None,
    ) -> core.Frame:
        """Frame of a pair: rectified, or raw with settings that contain the rectification."""
        assert self._pair_extractor is not None
        self._check(left, "left image")
        self._check(right, "right image")
        if left.shape[:2] != right.shape[:2]:
            raise ImageError(
                f"left image has size {_size_text(left)}, the right {_size_text(right)}; both must "
                "be of the size of the calibration"
            )
        if left.shape != right.shape:
            raise ImageError(f"left and right image differ: shapes {left.shape} and {right.shape}")
        if isinstance(mask, tuple) and len(mask) != 2:
            raise ImageError(f"a tuple of masks must hold two (left, right), got {len(mask)}")
        left_mask, right_mask = mask if isinstance(mask, tuple) else (mask, mask)
        check_mask(left_mask, left, "left mask")
        check_mask(right_mask, right, "right mask")
        if not self.pair_check.done:
            self.pair_check.look(left, right)
        context = self._context_for(left)
        with timer("extract"):
            left_grey = core.to_grey(left, self._settings.camera.rgb)
            right_grey = core.to_grey(right, self._settings.camera.rgb)
            rectifier = None
            if self._raw_pairs is not None:
                left_grey, right_grey = self._raw_pairs.rectify(left_grey, right_grey)
                left_mask, right_mask = self._raw_pairs.rectify_masks(left_mask, right_mask)
                rectifier = self._raw_pairs.rectifier
            features_left, features_right = self._pair_extractor.extract(
                left_grey, right_grey, left_mask, right_mask
            )
        with timer("stereo"):
            if self._wide_pair is not None:
                frame = core.build_wide_stereo_frame(
                    context, self._wide_pair, frame_id, timestamp, features_left, features_right
                )
            else:
                frame = core.build_stereo_frame(
                    context, frame_id, timestamp, features_left, features_right
                )
            extractions = features_left, features_right
            frame = self._finished(frame, left, left_grey, *extractions, rectifier=rectifier)
            if self._align_right and self._wide_pair is None:
                core.align_right_columns(frame)
            return frame

    def _extract_pair(
        self, left: npt.NDArray[np.uint8], right: npt.NDArray[np.uint8]
    ) -> tuple[core.Extraction, core.Extraction]:
        assert self._pair_extractor is not None
        return self._pair_extractor.extract(left, right)

    def rgbd(
        self,
        image: npt.NDArray[np.uint8],
        depth: npt.NDArray[np.generic],
        frame_id: int,
        timestamp: float,
        timer: StageTimer,
        mask: Mask | None = None,
    ) -> core.Frame:
        """Frame of a colour image with registered depth."""
        self._check(image, "image")
        depth = self._depth_of(depth, image)
        check_mask(mask, image, "mask")
        context = self._context_for(image)
        with timer("extract"):
            grey = core.to_grey(image, self._settings.camera.rgb)
            extraction = self._extractor.extract(grey, mask)
        with timer("stereo"):
            frame = core.build_rgbd_frame(
                context, frame_id, timestamp, extraction, depth, self._settings.depth_factor
            )
            return self._finished(frame, image, grey, extraction)

    def _depth_of(
        self, depth: npt.NDArray[np.generic], image: npt.NDArray[np.uint8]
    ) -> npt.NDArray[np.generic]:
        """Check a depth image and bring it to the size of its image."""
        if not isinstance(depth, np.ndarray) or depth.ndim != 2:
            shape = getattr(depth, "shape", None)
            raise ImageError(f"depth must be an array of shape (height, width), got {shape}")
        # Where a masked array hides the depth there is none; nor may a matrix's own rules count.
        if type(depth) is not np.ndarray:
            depth = np.asarray(np.ma.filled(depth, 0))
        if depth.dtype.kind not in "uif" or depth.dtype.itemsize > _LARGEST_NUMBER:
            raise ImageError(f"depth must hold numbers (uint16, float32...), got {depth.dtype}")
        depth = self._enlarged(depth, image)
        if not self.depth_check.done:
            self.depth_check.look(depth)
        return depth

    def _enlarged(
        self, depth: npt.NDArray[np.generic], image: npt.NDArray[np.uint8]
    ) -> npt.NDArray[np.generic]:
        """Depth in the size of the image, by nearest neighbour."""
        if depth.shape == image.shape[:2]:
            return depth
        problem = depth_size_problem(depth.shape, image.shape)
        if problem is not None:
            raise ImageError(problem)
        if not self._told_depth_size:
            self._told_depth_size = True
            _log.warning(
                "depth is %s, the images %s: enlarged by nearest neighbour; this is right only if "
                "both show the same view (depth registered to the image)",
                *(_size_text(depth), _size_text(image)),
            )
        return enlarged_depth(depth, image.shape)

    def _finished(
        self,
        frame: core.Frame,
        image: npt.NDArray[np.uint8],
        grey: npt.NDArray[np.uint8],
        left: core.Extraction,
        right: core.Extraction | None = None,
        *,
        rectifier: core.PairRectifier | None = None,
    ) -> core.Frame:
        kept = left if self._keep_images else None
        is_rgb = self._settings.camera.rgb
        core.keep_pixels(frame, image, is_rgb, grey, kept, right, rectifier)
        return frame

    def _check(self, image: npt.NDArray[np.uint8], what: str) -> None:
        if not isinstance(image, np.ndarray):
            raise ImageError(f"{what} must be a NumPy array, got {type(image).__name__}")
        _refuse_masked(image, what)
        if image.dtype != np.uint8:
            remedy = f"; {REMEDY}" if image.dtype == np.uint16 else ""
            raise ImageError(f"{what} must be uint8, got {image.dtype}{remedy}")
        if image.size == 0:
            raise ImageError(f"{what} is empty, shape {image.shape}")
        if not (image.ndim == 2 or (image.ndim == 3 and image.shape[2] in (1, 3, 4))):
            raise ImageError(
                f"{what} must have shape (height, width) or (height, width, 3 or 4), "
                f"got {image.shape}"
            )
        if min(image.shape[:2]) < SMALLEST_SIDE:
            raise ImageError(
                f"{what} is too small: {_size_text(image)} pixels, and keypoints are "
                f"found from {SMALLEST_SIDE} per side on; give whole images of the camera"
            )
        if self._size is not None and image.shape[:2] != self._size:
            raise ImageError(
                f"{what} has size {_size_text(image)}, the first image had "
                f"{self._size[1]}x{self._size[0]}; give images of one size"
            )

    def _context_for(self, image: npt.NDArray[np.uint8]) -> core.FrameContext:
        if self._context is None:
            height, width = image.shape[:2]
            camera = core.Camera(_camera_options(self._settings, width, height))
            self._context = core.FrameContext(camera, self._extractor.scales)
            if self._settings.right is not None:
                self._wide_pair = wide_pair_of(self._settings, camera, (width, height))
            self._size = (height, width)
            self._tell_misfit(width, height)
        return self._context

    def _tell_misfit(self, width: int, height: int) -> None:
        if not self._check_calibration:
            return
        self._check_calibration = False
        misfit = find_misfit(self._settings, (width, height))
        if misfit is not None:
            _log.warning("%s", misfit)


def _size_text(image: npt.NDArray[np.generic]) -> str:
    """Width and height as text."""
    return f"{image.shape[1]}x{image.shape[0]}"


def check_mask(mask: Mask | None, image: npt.NDArray[np.uint8], what: str) -> None:
    """Raise `ImageError` unless a mask belongs to its image."""
    if mask is None:
        return
    if not isinstance(mask, np.ndarray) or mask.dtype != np.uint8:
        kind = mask.dtype if isinstance(mask, np.ndarray) else type(mask).__name__
        raise ImageError(f"{what} must be a NumPy array of uint8 (0: ignore), got {kind}")
    _refuse_masked(mask, what)
    if mask.shape != image.shape[:2]:
        raise ImageError(
            f"{what} has shape {mask.shape}; it must be that of the image, {image.shape[:2]}"
        )


def _refuse_masked(array: npt.NDArray[np.uint8], what: str) -> None:
    # Points under its mask would be tracked: there is no grey value for "nothing".
    if type(array) is not np.ndarray and isinstance(array, np.ma.MaskedArray):
        raise ImageError(
            f"{what} is a masked array; give its data, and where to look as mask=, uint8 with 0 "
            "where no keypoint may lie"
        )


def orb_options(settings: Settings, factor: int = 1) -> core.OrbOptions:
    """Return the options of the extraction, with a multiple of the settings' features."""
    return core.OrbOptions(
        n_features=factor * settings.orb.n_features,
        scale_factor=settings.orb.scale_factor,
        n_levels=settings.orb.n_levels,
        initial_threshold=settings.orb.ini_th_fast,
        minimum_threshold=settings.orb.min_th_fast,
        original_coordinates=settings.orb.original_coordinates,
    )


def _camera_options(settings: Settings, width: int, height: int) -> core.CameraOptions:
    camera = settings.camera
    # A fisheye model replaces the pinhole's numbers.
    lens: dict[str, Any] = {}
    if camera.is_fisheye or settings.right is not None:
        lens["model"] = camera.camera_model(width, height).core
    if settings.right is not None:
        lens["right_centre"] = settings.right.centre
    return core.CameraOptions(
        fx=camera.fx,
        fy=camera.fy,
        cx=camera.cx,
        cy=camera.cy,
        width=width,
        height=height,
        distortion=camera.distortion.tolist(),
        bf=camera.bf,
        depth_ratio=settings.depth.close_factor if settings.depth is not None else 0.0,
        **lens,
    )

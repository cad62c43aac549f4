# SPDX-License-Identifier: BSD-3-Clause
"""Frames of a rig: the images of all cameras of one moment become one frame."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from typing import Any

import numpy as np

from orbslam2py import _core as core
from orbslam2py._arrays import ByteArray
from orbslam2py._timing import StageTimer
from orbslam2py.errors import ImageError
from orbslam2py.settings.extrinsics import inverse_of
from orbslam2py.settings.rig import RigCamera, depth_sources
from orbslam2py.settings.settings import Settings
from orbslam2py.slam.front_end import FrontEnd, check_mask, orb_options
from orbslam2py.slam.rig_check import RigCheck

_log = logging.getLogger(__name__)

#: A camera with fewer keypoints sees nothing; images in a row after which a warning says so.
_LEAST_KEYPOINTS, _BLIND_FRAMES = 10, 30


class RigFrontEnd(FrontEnd):
    """Builds frames of the images of a rig.

    Parameters
    ----------
    settings : Settings
        Calibration of a rig, and extractor settings.
    """

    def __init__(self, settings: Settings) -> None:
        super().__init__(settings, settings.sensor, check_calibration=False)
        assert settings.rig is not None
        self._rig = rig = settings.rig
        self._sources = depth_sources(rig)
        options = orb_options(settings)
        self._rig_extractor = core.RigExtractor(options, len(rig))
        self._scales = self._extractor.scales
        self._cameras = [self._camera(i) for i in range(len(rig))]
        self._pairs = [self._pair(i) for i in range(len(rig))]
        usual = [source.active for source in self._sources]
        poses = [core.Pose.from_matrix(member.T_body_camera) for member in rig]
        self._camera_of_rig = core.Camera.rig(self._cameras, poses, usual)
        #: Frame contexts by the cameras that are active.
        self._contexts = {tuple(usual): core.FrameContext(self._camera_of_rig, self._scales)}
        self._told_missing: set[int] = set()
        #: Images in a row without keypoints, by camera.
        self._blind = [0] * len(rig)
        self._check_of_rig = RigCheck(rig, self._sources, self._scales)

    @property
    def depth_warning(self) -> str | None:
        """Why depth will be wrong, as the first images say: its factor, or the extrinsics."""
        return self.depth_check.warning or self._check_of_rig.warning

    def reset(self) -> None:
        """Nothing: the settings fix all sizes."""

    def _camera(self, i: int) -> core.Camera:
        member, source = self._rig[i], self._sources[i]
        width, height = member.size
        lens: dict[str, Any] = {"width": width, "height": height}
        lens["model"] = member.camera.camera_model(width, height).core
        depth = self._settings.depth
        assert depth is not None
        if source.partner is not None:
            lens["right_centre"] = self._T_partner(i)[1]
        elif source.image:
            lens["bf"] = self._settings.camera.bf / self._settings.camera.pixels_per_radian
            lens["bf"] *= member.camera.pixels_per_radian
        return core.Camera(core.CameraOptions(depth_ratio=depth.close_factor, **lens))

    def _T_partner(self, i: int) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
        """From a camera to its partner, and where that stands, in the frame of the camera."""
        partner = self._sources[i].partner
        assert partner is not None
        T = inverse_of(self._rig[i].T_body_camera) @ self._rig[partner].T_body_camera
        return inverse_of(T), np.ascontiguousarray(T[:3, 3])

    def _pair(self, i: int) -> core.WidePair | None:
        partner = self._sources[i].partner
        if partner is None:
            return None
        T = self._T_partner(i)[0]
        model = self._rig[partner].camera.camera_model(*self._rig[partner].size).core
        R, t = np.ascontiguousarray(T[:3, :3]), np.ascontiguousarray(T[:3, 3])
        return core.WidePair(self._cameras[i], model, R, t)

    # ---- one moment ------------------------------------------------------------------------------
    def rig(
        self,
        images: Sequence[Any],
        frame_id: int,
        timestamp: float,
        timer: StageTimer,
        masks: Sequence[ByteArray | None] | None = None,
    ) -> core.Frame:
        """Frame of a rig.

        Parameters
        ----------
        images : sequence
            One entry a camera: its image; image and depth of a camera with depth images; None if
            it gave nothing.
        frame_id, timestamp, timer
            As for the other frames.
        masks : sequence, optional
            One mask, or None, a camera.

        Raises
        ------
        ImageError
            If their number is wrong, all are missing, or one does not fit its camera.
        """
        pixels, depths = self._taken(images, timestamp)
        allowed = [None] * len(pixels) if masks is None else list(masks)
        if len(allowed) != len(pixels):
            raise ImageError(
                f"a rig of {len(pixels)} cameras has {len(allowed)} masks; give one each"
            )
        for i, (image, mask) in enumerate(zip(pixels, allowed, strict=True), 1):
            if image is not None:
                check_mask(mask, image, f"mask {i}")
        with timer("extract"):
            greys = [
                None if image is None else core.to_grey(image, self._settings.camera.rgb)
                for image in pixels
            ]
            extractions = self._rig_extractor.extract(
                greys, [None if g is None else m for g, m in zip(greys, allowed, strict=True)]
            )
        with timer("stereo"):
            context, active = self._context_of(self._seeing(extractions, pixels, timestamp))
            self._check_of_rig.look(self._pairs, extractions, [g is not None for g in greys])
            # None, where a camera has no frame, is no type of the stubs.
            frames: list[Any] = [
                self._frame(i, frame_id, timestamp, extractions, pixels, depths) if used else None
                for i, used in enumerate(active)
            ]
            return core.join_frames(context, frame_id, timestamp, frames)

    def _frame(
        self,
        i: int,
        frame_id: int,
        timestamp: float,
        extractions: list[core.Extraction],
        pixels: list[ByteArray | None],
        depths: list[Any],
    ) -> core.Frame:
        context = core.FrameContext(self._cameras[i], self._scales)
        partner, pair, depth = self._sources[i].partner, self._pairs[i], depths[i]
        if partner is not None and pair is not None and pixels[partner] is not None:
            frame = core.build_wide_stereo_frame(
                context, pair, frame_id, timestamp, extractions[i], extractions[partner]
            )
        elif depth is not None:
            factor = self._settings.depth_factor
            frame = core.build_rgbd_frame(
                context, frame_id, timestamp, extractions[i], depth, factor
            )
        else:
            frame = core.build_monocular_frame(context, frame_id, timestamp, extractions[i])
        image = pixels[i]
        if image is not None:
            core.keep_pixels(frame, image, self._settings.camera.rgb)
        return frame

    def _seeing(
        self,
        extractions: list[core.Extraction],
        pixels: list[ByteArray | None],
        timestamp: float,
    ) -> list[bool]:
        """Whether each camera sees something; one that is covered counts as one without image."""
        seeing = []
        for i, (extraction, image) in enumerate(zip(extractions, pixels, strict=True)):
            sees = len(extraction.keypoints) >= _LEAST_KEYPOINTS
            self._blind[i] = 0 if sees or image is None else self._blind[i] + 1
            if self._blind[i] == _BLIND_FRAMES and i not in self._told_missing:
                self._told_missing.add(i)
                _log.warning(
                    "camera %d of the rig has seen nothing in %d images until %.3f s: is its lens "
                    "covered? Tracking continues with the others",
                    *(i + 1, _BLIND_FRAMES, timestamp),
                )
            seeing.append(sees)
        return seeing if any(seeing) else [image is not None for image in pixels]

    def _context_of(self, there: list[bool]) -> tuple[core.FrameContext, tuple[bool, ...]]:
        """The context for the cameras that see something; a partner steps in for its camera."""
        active = []
        for i, source in enumerate(self._sources):
            needed = source.active or not any(
                there[k] and other.active and other.partner == i
                for k, other in enumerate(self._sources)
            )
            active.append(there[i] and needed)
        key = tuple(active)
        if key not in self._contexts:
            camera = self._camera_of_rig.with_active(list(key))
            self._contexts[key] = core.FrameContext(camera, self._scales)
        return self._contexts[key], key

    # ---- what was given --------------------------------------------------------------------------
    def _taken(
        self, images: Sequence[Any], timestamp: float
    ) -> tuple[list[ByteArray | None], list[Any]]:
        """Images and depths of the cameras; None where there is none."""
        n = len(self._rig)
        if not isinstance(images, Sequence) or len(images) != n:
            given = len(images) if isinstance(images, Sequence) else 1
            raise ImageError(
                f"the frame of {timestamp} s has {given} images; this rig has {n} cameras: give "
                "one image for each, None for a camera that gave none"
            )
        pixels: list[ByteArray | None] = []
        depths: list[Any] = []
        for i, (given_images, member) in enumerate(zip(images, self._rig, strict=True)):
            image, depth = self._image_of(i, given_images, member)
            pixels.append(image)
            depths.append(depth)
            self._tell_missing(i, there=image is not None, timestamp=timestamp)
        if all(image is None for image in pixels):
            raise ImageError(f"the frame of {timestamp} s has no image of any camera")
        return pixels, depths

    def _image_of(self, i: int, given: Any, member: RigCamera) -> tuple[ByteArray | None, Any]:
        if given is None:
            return None, None
        image, depth = given, None
        if isinstance(given, tuple | list):
            if not member.depth or len(given) != 2:
                wanted = "(image, depth)" if member.depth else "one image"
                raise ImageError(f"camera {i + 1} has {len(given)} images; give {wanted}")
            image, depth = given
            if image is None:
                return None, None
        what = f"image of camera {i + 1}"
        self._check(image, what)
        if image.shape[1::-1] != member.size:
            raise ImageError(
                f"{what} is {image.shape[1]}x{image.shape[0]}, and its calibration is for "
                f"{member.size[0]}x{member.size[1]}; give images as they come, in the order of the "
                "cameras of the settings"
            )
        return image, None if depth is None else self._depth_of(depth, image)

    def _tell_missing(self, i: int, *, there: bool, timestamp: float) -> None:
        if there or i in self._told_missing:
            return
        self._told_missing.add(i)
        _log.warning(
            "camera %d of the rig has no image at %.3f s; tracking continues with the others",
            i + 1,
            timestamp,
        )

    def mosaic(self, images: Sequence[Any]) -> ByteArray:
        """Put the images side by side, where the pixels of frames of the rig lie; (h, w) uint8."""
        width, height = self._camera_of_rig.image_size
        whole = np.zeros((height, width), np.uint8)
        for i, given in enumerate(images):
            image = given[0] if isinstance(given, tuple | list) else given
            if not isinstance(image, np.ndarray) or image.shape[1::-1] != self._rig[i].size:
                continue
            grey = core.to_grey(image, self._settings.camera.rgb)
            column = round(self._camera_of_rig.column_of(i))
            whole[: grey.shape[0], column : column + grey.shape[1]] = grey
        return whole


def front_end_of(settings: Settings, **options: bool) -> FrontEnd:
    """Make the front end for settings of any sensor."""
    if settings.rig is not None:
        return RigFrontEnd(settings)
    return FrontEnd(settings, settings.sensor, **options)

# SPDX-License-Identifier: BSD-3-Clause
"""Whether depth belongs to the colour camera, or else to which camera."""

from __future__ import annotations

import logging
from dataclasses import dataclass

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py._depth_size import depth_size_problem
from orbslam2py.datasets.bags.bag import Bag
from orbslam2py.datasets.bags.calibration import CameraInfo
from orbslam2py.datasets.bags.image_topics import ImageTopic
from orbslam2py.datasets.bags.infos import info_if_any
from orbslam2py.datasets.bags.realsense import stream_of
from orbslam2py.datasets.bags.topics import Chosen, own_info, says_registered
from orbslam2py.datasets.bags.transforms import Transforms, names_of_coordinates
from orbslam2py.datasets.registration import DepthRegistration, Lens
from orbslam2py.errors import DatasetError
from orbslam2py.settings import Settings

_log = logging.getLogger(__name__)

#: Numbers of one camera, written by two programs, differ by no more pixels than this.
_ROUNDING = 0.1
#: Two calibrations of one camera differ by no more than this part of the focal length.
_OTHER_CALIBRATION = 0.05
#: Cameras are in one place if things at this distance [m] are seen within half a pixel.
_NEAR, _HALF_A_PIXEL = 0.5, 0.5
_REMEDY = (
    "record depth that is aligned to the images (realsense2_camera: align_depth.enable:=true), or "
    "run the images alone (--sensor mono)"
)
_REMEDY_OF_SDK = (
    "the RealSense Viewer does not record aligned depth: run the images alone (--sensor mono){}, "
    "or record with the ROS node realsense2_camera and align_depth.enable:=true"
)


@dataclass(frozen=True, eq=False)
class DepthCamera:
    """A depth camera beside the camera of the images.

    Attributes
    ----------
    lens
        Its calibration.
    T_colour_depth
        Transform (4, 4) from its coordinates to those of the images' camera [m].
    """

    lens: Lens
    T_colour_depth: FloatArray

    def registration(self, settings: Settings, size: tuple[int, int]) -> DepthRegistration:
        """Make a registration of its images to those of the camera of the settings.

        Parameters
        ----------
        settings
            RGB-D settings.
        size
            Width and height of the images [pixels].
        """
        colour = Lens(settings.camera.matrix, settings.camera.distortion, size)
        units = (settings.depth.raw_per_metre if settings.depth else None) or 1.0
        return DepthRegistration(self.lens, colour, self.T_colour_depth, units)


def find_depth_camera(
    bag: Bag, topics: Chosen, frames: tuple[str, str], chosen: Settings | None
) -> DepthCamera | None:
    """Find the camera of the depth images, if they must be registered.

    Parameters
    ----------
    bag, topics
        The bag, and the topics of a run with depth.
    frames
        Frame ids in the headers of images and depth.
    chosen
        Settings that the user gave.

    Returns
    -------
    DepthCamera or None
        None if depth belongs to the camera of the images, or if nothing contradicts this.

    Raises
    ------
    DatasetError
        If depth belongs to another camera, and the bag has no transform between the two.
    """
    images, depth = topics.left, topics.depth
    if depth is None:
        return None
    colour_info = info_if_any(bag, images, topics.left_info)
    depth_info = info_if_any(bag, depth, topics.depth_info)
    how = _difference(images, depth, colour_info, depth_info, chosen)
    names = [
        names_of_coordinates(one, frame) for one, frame in zip((images, depth), frames, strict=True)
    ]
    one_info = topics.left_info is not None and topics.left_info == topics.depth_info
    T = None if one_info else Transforms(bag).between(*names)
    if how and T is None and colour_info is None and chosen and images.size == depth.size:
        _warn(bag, depth, f"is of another camera than that of the settings ({how})")
        return None
    known = depth_info is not None and (colour_info or chosen) is not None
    if not how and (one_info or T is None or not known or says_registered(depth)):
        own = info_if_any(bag, depth, own_info(bag, depth))
        own_difference = _difference(images, depth, colour_info, own, chosen)
        if own_difference:  # the user named the CameraInfo of another camera
            _warn(bag, depth, f"has a CameraInfo of another camera ({own_difference})")
        elif frames[0] != frames[1]:
            where = f"has the frame_id '{frames[1]}', and the images have '{frames[0]}'"
            _warn(bag, depth, where)
        return None
    missing = [
        f"a CameraInfo for {one.topic.name} of its size"
        for one, told in ((depth, depth_info), (images, colour_info or chosen))
        if told is None
    ]
    if T is None or depth_info is None or missing:
        raise _cannot_be_registered(bag, topics, depth, how, missing, T)
    if not how and _in_one_place(T, depth_info):
        return None
    of_bag = colour_info is not None and colour_info.is_fisheye and not images.is_rectified
    if of_bag if chosen is None else chosen.camera.is_fisheye:
        raise DatasetError(
            f"{bag.path}: depth of {depth.topic.name} is of another camera than "
            f"{images.topic.name}, and depth cannot be registered to a fisheye camera; record "
            "depth that is registered to the images, or run with --sensor mono"
        )
    _log.info(
        "%s: depth of %s is of another camera than %s (%s); it is registered with the calibrations "
        "of both and the transform between them (%.1f mm apart)",
        *(bag.path, depth.topic.name, images.topic.name, how or "another place"),
        np.linalg.norm(T[:3, 3]) * 1e3,
    )
    if set(names[0]) & set(names[1]):
        _log.warning(
            "%s: images and depth have the same frame_id '%s', so the two cameras are assumed to "
            "be at the same place; if they are not, depth is some pixels off",
            *(bag.path, frames[0]),
        )
    return DepthCamera(_lens_of(depth, depth_info), T)


def _warn(bag: Bag, depth: ImageTopic, told: str) -> None:
    _log.warning(
        "%s: depth of %s %s: if it is not registered to the images, the result is wrong",
        *(bag.path, depth.topic.name, told),
    )


def _lens_of(image: ImageTopic, info: CameraInfo) -> Lens:
    if image.is_rectified or info.is_undistorted:
        return Lens(info.rectified_K, np.zeros(8), info.size)
    return Lens(info.K, info.distortion(), info.size)


def _difference(
    images: ImageTopic,
    depth: ImageTopic,
    colour_info: CameraInfo | None,
    depth_info: CameraInfo | None,
    chosen: Settings | None,
) -> str:
    """Return the difference of the two cameras; empty if there is none or it is not known."""
    if images.size != depth.size and images.size and depth.size:
        problem = depth_size_problem(depth.size[::-1], images.size[::-1])
        if says_registered(depth) and problem is None:
            return ""  # it is only smaller
        return "{} x {} pixels against {} x {}".format(*depth.size, *images.size)
    if depth_info is None or (colour_info is None and chosen is None):
        return ""
    K = depth_info.rectified_K if depth.is_rectified else depth_info.K
    others, allowed = [], _ROUNDING
    if colour_info is not None:
        others = [colour_info.K, colour_info.rectified_K]
    elif chosen is not None:
        others, allowed = [chosen.camera.matrix], _OTHER_CALIBRATION * chosen.camera.fx
    if min(np.abs(K - other).max() for other in others) <= allowed:
        return ""
    names = (("fx", 0, 0), ("fy", 1, 1), ("cx", 0, 2), ("cy", 1, 2))
    worst = max(names, key=lambda one: abs(K[one[1:]] - others[0][one[1:]]))
    return f"{worst[0]} {K[worst[1:]]:.6g} against {others[0][worst[1:]]:.6g}"


def _in_one_place(T: FloatArray, info: CameraInfo) -> bool:
    """Return whether a pixel of one camera is the same pixel of the other at usual distances."""
    fx = info.K[0, 0]
    apart = np.linalg.norm(T[:3, 3]) / _NEAR
    turned = np.abs(T[:3, :3] - np.eye(3)).max()
    return bool(fx * (apart + turned) < _HALF_A_PIXEL)


def _cannot_be_registered(
    bag: Bag,
    topics: Chosen,
    depth: ImageTopic,
    how: str,
    missing: list[str],
    T: FloatArray | None,
) -> DatasetError:
    images, stream = topics.left, stream_of(depth)
    if T is None:
        where = "topic /tf_static"
        if stream is not None:
            where = f"topics {stream_of(images)}/tf/... and {stream}/tf/..."
        missing.append(f"the transform between the two cameras ({where})")
    remedy = _REMEDY
    if stream is not None:
        has_pair = any("/Infrared_2/image" in topic.name for topic in bag.topics)
        remedy = _REMEDY_OF_SDK.format(" or the infrared pair (--sensor stereo)" * has_pair)
    registered = ""
    if topics.left_info is not None and images.size == depth.size:
        registered = (
            f"; if it is registered already, say so: --topics depth_info={topics.left_info.name}"
        )
    return DatasetError(
        f"{bag.path}: depth of {depth.topic.name} is of another camera than {images.topic.name} "
        f"({how}), and cannot be registered to it without {' and '.join(missing)}; {remedy}"
        f"{registered}"
    )

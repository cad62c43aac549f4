# SPDX-License-Identifier: BSD-3-Clause
"""A bag of ROS 1 or ROS 2 as a sequence, without ROS."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbslam2py._arguments import index_of
from orbslam2py._arrays import ByteArray, FloatArray
from orbslam2py._depth_size import depth_size_problem
from orbslam2py.datasets.bags.attached import attached_settings
from orbslam2py.datasets.bags.bag import Bag, Message
from orbslam2py.datasets.bags.depth_cameras import find_depth_camera
from orbslam2py.datasets.bags.image_topics import ImageTopic
from orbslam2py.datasets.bags.imu import read_imu
from orbslam2py.datasets.bags.messages import read_message
from orbslam2py.datasets.bags.pixels import decode_depth, decode_image, decode_pixels
from orbslam2py.datasets.bags.poses import read_poses
from orbslam2py.datasets.bags.realsense import camera_times
from orbslam2py.datasets.bags.settings_of_topics import settings_of_topics
from orbslam2py.datasets.bags.timing import (
    pair_messages,
    require_one_size,
    stamps_of,
    time_messages,
    warn_of_gaps,
)
from orbslam2py.datasets.bags.topics import TopicChoice, parse_topics
from orbslam2py.datasets.base import Images, choose_sensor, rate_of
from orbslam2py.datasets.choose_settings import SettingsChoice
from orbslam2py.datasets.frames import FramesInOrder
from orbslam2py.datasets.grey_scale import GreyScale, spread_over
from orbslam2py.datasets.imu import ImuSamples
from orbslam2py.datasets.rectification import Rectifiers, rectifiers_of, with_rectified_images
from orbslam2py.datasets.registration import DepthRegistration
from orbslam2py.errors import DatasetError, ImageError
from orbslam2py.settings import Sensor, Settings, resolve_settings
from orbslam2py.trajectory import Trajectory

_log = logging.getLogger(__name__)

#: Images per second of a bag with a single one.
_USUAL_RATE = 30.0


class BagSequence(FramesInOrder):
    """The images of a bag; see `datasets.base.Sequence`.

    Images are read on request; the bag is never completely in memory.

    Parameters
    ----------
    path
        A file of ROS 1 (``.bag``) or ROS 2 (``.db3``, ``.mcap``), or the folder of a recording.
    sensor
        The sensor; by default the richest one that the bag has images for.
    settings
        Settings, a file, a built-in name, or None for the CameraInfo of the bag.
    topics
        Names of topics by their roles, as a dictionary or as ``left=/a,right=/b``: ``left`` (or
        ``image``), ``right``, ``depth``, ``left_info`` (or ``info``), ``right_info``,
        ``depth_info``, ``truth``. By default guessed by types and names.

    Raises
    ------
    DatasetError
        By default they are chosen by types and names.
    SettingsError
        If the settings given are wrong.
    """

    #: Direction of up in the world of the true poses is not known.
    up_in_truth: FloatArray | None = None

    def __init__(
        self,
        path: str | Path,
        sensor: Sensor | str | None = None,
        *,
        settings: SettingsChoice = None,
        topics: Mapping[str, str] | str | None = None,
    ) -> None:
        self.path = Path(path)
        self.name = self.path.resolve().name.partition(".")[0]
        named = parse_topics(topics) if isinstance(topics, str) else dict(topics or {})
        self._bag = Bag(self.path)
        self.layout = self._bag.layout
        for doubt in self._bag.doubts:
            _log.warning("%s", doubt)
        choice = TopicChoice(self._bag, named)
        if sensor is not None:
            choice.require(Sensor(sensor))
        self.sensor = choose_sensor(self.path, sensor, choice.sensors)
        self.topics = choice.choose(self.sensor)
        self._chosen = None if settings is None else resolve_settings(settings, self.sensor)
        self._grey_scale = GreyScale(self.path, self._sample)
        self._list_images()
        self._stamps = stamps_of(self._nanoseconds)
        warn_of_gaps(self.path, self.timestamps)
        names = [one.topic.name for one in self._streams]
        _log.info("%s: %d frames of %s", self.path, len(self), " and ".join(names))

    @cached_property
    def settings(self) -> Settings:
        """The settings the caller chose, or `default_settings`."""
        chosen = self.default_settings() if self._chosen is None else self._chosen
        return with_rectified_images(chosen)

    def default_settings(self) -> Settings:
        """Make settings of the CameraInfo in the bag, or take those that are attached to it.

        Raises
        ------
        DatasetError
            If there is none, or it cannot be used.
        SettingsError
            If the attached settings are wrong.
        """
        return self._default_settings

    @cached_property
    def _default_settings(self) -> Settings:
        attached = attached_settings(self._bag, self.sensor)
        if attached is not None:
            return attached
        fps = rate_of(self.timestamps, _USUAL_RATE)
        return settings_of_topics(self._bag, self.topics, self.sensor, self._frames, fps)

    def __len__(self) -> int:
        return len(self._nanoseconds)

    @property
    def timestamps(self) -> FloatArray:
        """Times in seconds, float64 (n,): the stamps of the (left) images; read-only."""
        return self._stamps.seconds

    def timestamp_text(self, index: int, /) -> str:
        """Return the time of a frame in seconds, with nine decimals."""
        return self._stamps.texts[index_of(index, len(self))]

    def load(self, index: int, /) -> Images:
        """Read (and rectify) the images of a frame; see `datasets.base.Sequence.load`."""
        index = index_of(index, len(self))
        left, *others = (messages[index] for messages in self._messages)
        image = self._image(self.topics.left, left, 0)
        if self.topics.right is not None:
            return Images(image, right=self._image(self.topics.right, others[0], 1))
        if self.topics.depth is not None:
            return Images(image, depth=self._depth(self.topics.depth, others[0], image))
        return Images(image)

    def ground_truth(self) -> Trajectory | None:
        """Read the poses of the topic ``truth``; see `datasets.base.Sequence.ground_truth`."""
        topic = self.topics.truth
        return None if topic is None else read_poses(self._bag, topic)

    def imu(self) -> ImuSamples | None:
        """Read the samples of the IMU at each call; None if the bag has none.

        Raises
        ------
        DatasetError
            If the samples cannot be read.
        """
        return read_imu(self._bag)

    # ---- images ----------------------------------------------------------------------------------
    @property
    def _streams(self) -> list[ImageTopic]:
        topics = (self.topics.left, self.topics.right, self.topics.depth)
        return [one for one in topics if one is not None]

    def _list_images(self) -> None:
        """Find the messages of every frame."""
        timed = [time_messages(self._bag, one.topic) for one in self._streams]
        for one, messages in zip(self._streams, timed, strict=True):
            require_one_size(self.path, one.topic, messages.sizes)
        timed = camera_times(self._bag, self._streams, timed)
        self._frames = [messages.frame for messages in timed]
        self._check_cameras()
        first = timed[0]
        self._nanoseconds, self._messages = first.nanoseconds, [first.messages]
        if len(timed) > 1:
            names = (self._streams[0].topic.name, self._streams[1].topic.name)
            i, j = pair_messages(self.path, first, timed[1], names)
            self._nanoseconds = [first.nanoseconds[k] for k in i]
            self._messages = [[first.messages[k] for k in i], [timed[1].messages[k] for k in j]]

    def _check_cameras(self) -> None:
        left, *others = self._streams
        self._depth_camera = None
        if self.topics.depth is not None:
            frames = (self._frames[0], self._frames[1])
            self._depth_camera = find_depth_camera(self._bag, self.topics, frames, self._chosen)
            return
        for other in others:
            if other.size != left.size and other.size and left.size:
                sizes = ", ".join(
                    "{} {} x {}".format(one.topic.name, *(one.size or ())) for one in (left, other)
                )
                raise DatasetError(
                    f"{self.path}: images differ in size, {sizes}; name two cameras of one size "
                    "with --topics"
                )

    @cached_property
    def _registration(self) -> DepthRegistration | None:
        """Return the registration of depth to the images; None if depth is registered."""
        size = self.topics.left.size
        if self._depth_camera is None or size is None:
            return None
        return self._depth_camera.registration(self.settings, size)

    def _message(self, one: ImageTopic, message: Message) -> Any:
        try:
            content = self._bag.read(message)
            return read_message(content, one.topic.kind, one.topic.encoding)
        except DatasetError as error:
            raise ImageError(f"{self._where(one)}: {error}") from error

    def _image(self, one: ImageTopic, message: Message, camera: int) -> ByteArray:
        rgb = self.settings.camera.rgb
        try:
            read = self._message(one, message)
            image = decode_image(
                read, compressed=one.is_compressed, rgb=rgb, to_8_bits=self._grey_scale
            )
        except ImageError as error:
            raise ImageError(f"{self._where(one)}: {error}") from error
        size = (image.shape[1], image.shape[0])
        if one.size is not None and size != one.size:
            raise ImageError(
                f"an image of {self._where(one)} is {size[0]} x {size[1]}, the first one "
                f"{one.size[0]} x {one.size[1]}"
            )
        if self.sensor is Sensor.STEREO and self._rectifiers is not None:
            return self._rectifiers[camera].rectify(image, f"an image of {self._where(one)}")
        return image

    def _sample(self) -> list[NDArray[np.generic]]:
        """Return images of the (left) camera, distributed over the bag."""
        one, found = self.topics.left, []
        for index in spread_over(len(self)):
            with contextlib.suppress(ImageError):  # said when the run comes to it
                message = self._message(one, self._messages[0][index])
                found.append(decode_pixels(message, compressed=one.is_compressed))
        return found

    def _depth(self, one: ImageTopic, message: Message, image: ByteArray) -> NDArray[np.generic]:
        try:
            depth = decode_depth(self._message(one, message), compressed=one.is_compressed)
            if self._registration is not None:
                depth = self._registration.register(depth)
        except ImageError as error:
            raise ImageError(f"{self._where(one)}: {error}") from error
        problem = depth_size_problem(depth.shape, image.shape)
        if problem is not None:
            raise ImageError(f"{self._where(one)}: {problem}")
        return depth

    @cached_property
    def _rectifiers(self) -> Rectifiers | None:
        return rectifiers_of(self.settings)

    def _where(self, one: ImageTopic) -> str:
        return f"{one.topic.name} in {self.path}"

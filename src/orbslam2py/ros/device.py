# SPDX-License-Identifier: BSD-3-Clause
"""The topics of a robot as a live source."""

from __future__ import annotations

import logging
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cached_property, partial

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.datasets.bags.bag import Topic
from orbslam2py.datasets.bags.depth_cameras import find_depth_camera
from orbslam2py.datasets.bags.image_topics import ImageTopic
from orbslam2py.datasets.bags.messages import HEAD_SIZE, IMU, TRANSFORMS, read_head, stamp_of
from orbslam2py.datasets.bags.pixels import decode_depth, decode_pixels
from orbslam2py.datasets.bags.settings_of_topics import settings_of_topics
from orbslam2py.datasets.bags.topics import TopicChoice, parse_topics
from orbslam2py.datasets.bags.transforms import Transforms
from orbslam2py.datasets.base import choose_sensor, rate_of
from orbslam2py.datasets.registration import DepthRegistration
from orbslam2py.errors import DatasetError, OrbSlamError
from orbslam2py.live.device import Request, Sink, Stream
from orbslam2py.ros.gathering import Gathered, gather, title_of
from orbslam2py.ros.transport import Subscription, Transport
from orbslam2py.ros.types import from_cdr
from orbslam2py.settings import ImuSettings, Sensor, Settings

_log = logging.getLogger(__name__)

#: Images per second if their stamps do not show it.
_USUAL_RATE = 30.0
#: Images whose exact stamps are kept: those that wait to be tracked.
_MOST_STAMPS = 1000
#: A stamp counts as the time of the exposure if the image is no older than this, seconds; else the
#: clocks of robot and computer are not the same.
_OLDEST = 1.0


class TopicsDevice:
    """Images and samples of an IMU from topics; see `orbslam2py.live.Device`.

    Topics are chosen as those of a bag are: by name, or by the types and names of all that is
    published. The transport is closed by `stop` and opened again by `start`.

    Parameters
    ----------
    connect
        Opens the transport.
    kind
        ``ros2`` or ``zenoh``.
    request
        The request of the user.

    Raises
    ------
    DatasetError
        If there are no such topics, or nothing is published on them.
    """

    def __init__(self, connect: Callable[[], Transport], kind: str, request: Request) -> None:
        self.kind = kind
        self.name = f"{kind}:{request.address}"
        self._connect = connect
        self._transport: Transport | None = connect()
        self._lock = threading.RLock()
        self._subscriptions: list[Subscription] = []
        self._sink: Sink | None = None
        #: Stamps [ns] by the times of the sink [s], which cannot hold all their digits.
        self._nanoseconds: OrderedDict[float, int] = OrderedDict()
        _log.info(
            "%s: domain %d, on %s",
            *(title_of(self.name), self._transport.domain, self._transport.where),
        )
        try:
            named, imu_topic = _named_topics(request.topics)
            wanted = {**named, **({"imu": imu_topic} if imu_topic else {})}
            imu = request.imu or bool(imu_topic)
            self._gathered = gather(self._transport, self.name, wanted, imu=imu)
            choice = TopicChoice(self._gathered.bag, named)
            if request.sensor is not None:
                choice.require(request.sensor)
            path = self._gathered.bag.path
            self._sensor: Sensor = choose_sensor(path, request.sensor, choice.sensors)
            self._chosen = choice.choose(self._sensor)
            self._imu = _imu_topics(self.name, self._gathered, imu_topic) if imu else {}
        except BaseException:
            self._transport.close()
            raise

    @property
    def streams(self) -> tuple[Stream, ...]:
        """The streams that it delivers."""
        found: list[Stream] = list(self._images)
        return (*found, "imu") if self._imu else tuple(found)

    @property
    def frame(self) -> str:
        """Name of the coordinates of the (left) camera, as its messages have it."""
        return self._heads[0][1].strip("/")

    def nanoseconds_of(self, stamp: float) -> int:
        """Return the stamp of an image with all digits [ns], by its stamp in seconds."""
        return self._nanoseconds.get(stamp, round(stamp * 1e9))

    def between(self, target: str, source: str) -> FloatArray | None:
        """Return ``T_target_source`` (4, 4) [m] by the static transforms; None if unknown."""
        return self._transforms.between((target.strip("/"),), (source.strip("/"),))

    def parent_of(self, frame: str) -> str | None:
        """Return the frame that TF has above a frame; None if there is none."""
        bag = self._gathered.bag
        for topic in bag.topics:
            if topic.kind not in TRANSFORMS:
                continue
            for message in bag.messages(topic):
                for one in from_cdr(bag.read(message), topic.kind).transforms:
                    if one.child_frame_id.strip("/") == frame.strip("/"):
                        return str(one.header.frame_id).strip("/")
        return None

    def root_of(self, frame: str) -> tuple[str, FloatArray]:
        """Return the highest frame that TF has rigidly above a frame, and ``T_root_frame``."""
        root, T = frame.strip("/"), np.eye(4)
        seen = {root}
        while (parent := self.parent_of(root)) is not None and parent not in seen:
            found = self.between(parent, frame)
            if found is None:
                break
            root, T = parent, found
            seen.add(root)
        return root, T

    def settings(self) -> Settings | None:
        """Make settings of the CameraInfo; see `Device.settings`."""
        frames = [frame for _, frame in self._heads]
        made = settings_of_topics(
            self._gathered.bag, self._chosen, self._sensor, frames, self._rate
        )
        return replace(made, camera=replace(made.camera, rgb=False))

    def imu_settings(self) -> ImuSettings | None:
        """Return None: messages do not contain the noise of an IMU."""
        return None

    def start(self, sink: Sink, /) -> None:
        """Begin to deliver; see `Device.start`."""
        with self._lock:
            if self._transport is None:
                self._transport = self._connect()
                self._require_publishers(self._transport)
            self._sink = sink
            for stream, image in self._images.items():
                self._subscribe(image.topic.name, partial(self._on_image, stream, image))
            for part, topic in self._imu.items():
                self._subscribe(topic.name, partial(self._on_imu, part))

    def stop(self) -> None:
        """End delivering; see `Device.stop`."""
        with self._lock:
            self._sink = None
            subscriptions, self._subscriptions = self._subscriptions, []
            transport, self._transport = self._transport, None
        for subscription in subscriptions:
            subscription.close()
        if transport is not None:
            transport.close()

    # ---- topics ----------------------------------------------------------------------------------
    @cached_property
    def _images(self) -> dict[Stream, ImageTopic]:
        chosen = self._chosen
        if chosen.right is not None:
            return {"left": chosen.left, "right": chosen.right}
        if chosen.depth is not None:
            return {"image": chosen.left, "depth": chosen.depth}
        return {"image": chosen.left}

    @cached_property
    def _heads(self) -> list[tuple[list[int], str]]:
        """Stamps [ns] of the first images of each stream, and the name of its coordinates."""
        bag, found = self._gathered.bag, []
        for image in self._images.values():
            heads = [
                read_head(bag.read(message, HEAD_SIZE), image.topic.kind, "cdr")
                for message in bag.messages(image.topic)
            ]
            found.append(([head.stamp for head in heads], heads[0].frame))
        return found

    @cached_property
    def _rate(self) -> float:
        return rate_of(np.array(self._heads[0][0], np.float64) / 1e9, _USUAL_RATE)

    @cached_property
    def _transforms(self) -> Transforms:
        return Transforms(self._gathered.bag)

    @cached_property
    def _registration(self) -> DepthRegistration | None:
        frames = (self._heads[0][1], self._heads[1][1])
        camera = find_depth_camera(self._gathered.bag, self._chosen, frames, None)
        size = self._chosen.left.size
        if camera is None or size is None:
            return None
        settings = self.settings()
        assert settings is not None
        return camera.registration(settings, size)

    def _subscribe(self, name: str, receive: Callable[[bytes], None]) -> None:
        assert self._transport is not None
        topic = self._gathered.topics[name]
        self._subscriptions.append(self._transport.subscribe(topic, receive))

    def _require_publishers(self, transport: Transport) -> None:
        needed = {image.topic.name for image in self._images.values()}
        for _ in range(10):  # a new participant finds the others within a moment
            missing = needed - {topic.name for topic in transport.topics()}
            if not missing:
                return
            time.sleep(0.1)
        self._transport = None
        transport.close()
        raise DatasetError(
            f"{title_of(self.name)}: nobody publishes {' and '.join(sorted(missing))}"
        )

    # ---- messages --------------------------------------------------------------------------------
    def _on_image(self, stream: Stream, image: ImageTopic, content: bytes) -> None:
        sink, arrival = self._sink, time.time()
        if sink is None:
            return
        try:
            message = from_cdr(content, image.topic.kind)
            if stream == "depth":
                array = decode_depth(message, compressed=image.is_compressed)
                if self._registration is not None:
                    array = self._registration.register(array)
            else:
                array = decode_pixels(message, compressed=image.is_compressed)
        except OrbSlamError as error:
            sink.warning(f"an image of {image.topic.name} cannot be used: {error}")
            return
        exact = stamp_of(message.header)
        if not exact:
            sink.warning(f"{image.topic.name} has no stamps; the times of arrival are taken")
            exact = round(arrival * 1e9)
        stamp = exact / 1e9
        self._nanoseconds[stamp] = exact
        if len(self._nanoseconds) > _MOST_STAMPS:
            self._nanoseconds.popitem(last=False)
        age = arrival - stamp
        exposure = time.monotonic() - age if 0 <= age < _OLDEST else None
        sink.image(stream, array, stamp, exposure)

    def _on_imu(self, part: str, content: bytes) -> None:
        sink = self._sink
        if sink is None:
            return
        try:
            message = from_cdr(content, IMU)
        except OrbSlamError as error:
            sink.warning(f"a sample of the IMU cannot be used: {error}")
            return
        stamp = stamp_of(message.header) / 1e9 or time.time()
        w, a = message.angular_velocity, message.linear_acceleration
        if part == "gyro":
            sink.gyro(np.array([[stamp, w.x, w.y, w.z]]))
        elif part == "accel":
            sink.accel(np.array([[stamp, a.x, a.y, a.z]]))
        else:
            sink.imu(np.array([[stamp, w.x, w.y, w.z, a.x, a.y, a.z]]))


def _named_topics(given: Mapping[str, str] | str | None) -> tuple[dict[str, str], str]:
    """Split the names given by the user into topics by role and the topic of the IMU."""
    text = (
        given if isinstance(given, str) else ",".join(f"{k}={v}" for k, v in (given or {}).items())
    )
    parts = [part for part in text.split(",") if part.strip()]
    imu = [part for part in parts if part.partition("=")[0].strip() == "imu"]
    others = ",".join(part for part in parts if part not in imu)
    return (parse_topics(others) if others else {}), "".join(imu[:1]).partition("=")[2].strip()


def _imu_topics(name: str, gathered: Gathered, named: str) -> dict[str, Topic]:
    """Choose the topic of the IMU, or those of its gyro and its accelerometer.

    Raises
    ------
    DatasetError
        If there is none, or the choice is ambiguous.
    """
    topics = [one for one in gathered.bag.topics if one.kind == IMU]
    if named:
        wanted = "/" + named.strip("/")
        return {"whole": next(one for one in topics if one.name == wanted)}
    gyros = [one for one in topics if "gyro" in one.name.lower()]
    accels = [one for one in topics if "accel" in one.name.lower()]
    whole = [one for one in topics if one not in gyros and one not in accels]
    if len(whole) == 1:
        return {"whole": whole[0]}
    if not whole and len(gyros) == len(accels) == 1:
        return {"gyro": gyros[0], "accel": accels[0]}
    title, listed = title_of(name), ", ".join(one.name for one in topics)
    if not listed:
        raise DatasetError(
            f"{title}: nothing is published as {IMU}; start the node of the IMU, or leave out --imu"
        )
    raise DatasetError(
        f"{title}: cannot decide which of {listed} is the IMU; name it: --topics "
        f"imu={topics[0].name}"
    )

# SPDX-License-Identifier: BSD-3-Clause
"""The topics of a run: named by the user, or chosen by types and names."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from orbslam2py.datasets.bags.bag import Bag, Topic
from orbslam2py.datasets.bags.image_topics import ImageTopic, rank_of
from orbslam2py.datasets.bags.messages import (
    CAMERA_INFO,
    COMPRESSED_IMAGE,
    ENCODINGS,
    IMAGE,
    POSES,
    read_message,
)
from orbslam2py.datasets.bags.pixels import base_encoding, decode_depth, decode_pixels, is_depth
from orbslam2py.datasets.pair_names import side_of_pair
from orbslam2py.errors import DatasetError, OrbSlamError
from orbslam2py.settings import Sensor

#: Roles that may be named, and other words for them.
ROLES = ("left", "right", "depth", "left_info", "right_info", "depth_info", "truth")
_ALIASES = {"image": "left", "color": "left", "colour": "left", "rgb": "left", "info": "left_info"}
_ROLES_ARE = (
    "roles are image or left, right, depth, info or left_info, right_info, depth_info, truth"
)
#: The topic that is used as ground truth by default.
_TRUTH = "/ground_truth"
_COLOUR = re.compile(r"rgb|colou?r", re.IGNORECASE)
_REGISTERED = re.compile(r"regist|aligned|depth_to_(rgb|colou?r)", re.IGNORECASE)


@dataclass(frozen=True)
class Chosen:
    """The topics of a run.

    Attributes
    ----------
    left
        Images of the single, left or colour camera.
    right, depth
        The second images, if the sensor has them.
    left_info, right_info, depth_info
        Calibration of the cameras, if there is one.
    truth
        Poses of the ground truth, if there are any.
    """

    left: ImageTopic
    right: ImageTopic | None = None
    depth: ImageTopic | None = None
    left_info: Topic | None = None
    right_info: Topic | None = None
    depth_info: Topic | None = None
    truth: Topic | None = None


def parse_topics(text: str) -> dict[str, str]:
    """Read ``left=/cam0/image_raw,right=/cam1/image_raw``.

    Raises
    ------
    DatasetError
        If a part has no ``=``, or does not name a role.
    """
    named: dict[str, str] = {}
    for part in text.split(","):
        role, equals, topic = (piece.strip() for piece in part.partition("="))
        role = _ALIASES.get(role, role)
        if not (equals and topic):
            problem = f"'{part}' is no ROLE=/TOPIC"
        elif role not in ROLES:
            problem = f"the role '{role}' of '{part}' is unknown"
        elif role in named:
            problem = f"'{part}' is there twice"
        else:
            named[role] = topic
            continue
        raise DatasetError(f"--topics: {problem}; {_ROLES_ARE}")
    return named


class TopicChoice:
    """Chooses the topics of a bag.

    Parameters
    ----------
    bag
        The bag.
    named
        Topics by role, as the user gave them.

    Raises
    ------
    DatasetError
        If there are no images, or a named topic does not exist.
    """

    def __init__(self, bag: Bag, named: Mapping[str, str]) -> None:
        self._bag = bag
        self._named = {_ALIASES.get(role, role): topic for role, topic in named.items()}
        self._require_images()
        for role, name in self._named.items():
            if role not in ROLES:
                raise DatasetError(f"topics: the role '{role}' is unknown; {_ROLES_ARE}")
            self._topic(role, name)

    @property
    def sensors(self) -> tuple[Sensor, ...]:
        """Return the sensors that there are images for, as far as known, the richest first."""
        found = []
        if "depth" in self._named or (self._depths and "right" not in self._named):
            found.append(Sensor.RGBD)
        if "right" in self._named or self._pairs:
            found.append(Sensor.STEREO)
        return (*found, Sensor.MONOCULAR)

    def require(self, sensor: Sensor) -> None:
        """Check that there are images for a sensor.

        Raises
        ------
        DatasetError
            If a pair is requested, and no names of several cameras form a pair.
        """
        if sensor is Sensor.STEREO and sensor not in self.sensors and len(self._cameras) > 1:
            raise self._not_certain("the left and right images", "left", "right")

    def choose(self, sensor: Sensor) -> Chosen:
        """Choose the topics for a sensor.

        Raises
        ------
        DatasetError
            If the choice is not clear, with a list of all images and their types.
        """
        right: ImageTopic | None = None
        depth: ImageTopic | None = None
        if sensor is Sensor.STEREO:
            left, right = self._pair()
        elif sensor is Sensor.RGBD:
            depth = self._given("depth") or self._best_depth()
            left = self._given("left") or self._colour()
        else:
            left = self._given("left") or self._single()
        return Chosen(
            left,
            right,
            depth,
            self._info("left_info", left),
            None if right is None else self._info("right_info", right),
            None if depth is None else self._info("depth_info", depth),
            self._truth(),
        )

    # ---- images ----------------------------------------------------------------------------------
    @cached_property
    def _all(self) -> list[ImageTopic]:
        return [self._look_at(topic) for topic in self._bag.topics if _has_images(topic)]

    @cached_property
    def _cameras(self) -> list[ImageTopic]:
        """Return grey or colour images, the best topic of each camera."""
        best: dict[str, ImageTopic] = {}
        for one in self._all:
            if one.size is None or one.is_depth:
                continue
            if one.camera not in best or rank_of(one) < rank_of(best[one.camera]):
                best[one.camera] = one
        return list(best.values())

    @cached_property
    def _depths(self) -> list[ImageTopic]:
        best: dict[str, ImageTopic] = {}
        for one in self._all:
            if one.is_depth and (one.base not in best or not one.is_compressed):
                best[one.base] = one
        return list(best.values())

    @cached_property
    def _pairs(self) -> list[tuple[ImageTopic, ImageTopic]]:
        pairs = []
        for one in self._cameras:
            sides = [(side_of_pair(one.base, other.base), other) for other in self._cameras]
            fitting = [(side, other) for side, other in sides if side is not None]
            if fitting:
                pairs.append((one, min(fitting, key=lambda item: item[0])[1]))
        # Of cam0, cam1, cam2 the first two are meant.
        rights = {pair[1].base for pair in pairs}
        return [pair for pair in pairs if pair[0].base not in rights]

    def _pair(self) -> tuple[ImageTopic, ImageTopic]:
        left, right = self._given("left"), self._given("right")
        if left and right:
            return left, right
        fitting = [
            pair
            for pair in self._pairs
            if (left is None or pair[0] == left) and (right is None or pair[1] == right)
        ]
        if len(fitting) != 1:
            raise self._not_certain("the left and right images", "left", "right")
        return fitting[0]

    def _colour(self) -> ImageTopic:
        found = self._cameras
        if len(found) > 1:
            found = [one for one in found if _COLOUR.search(one.base)]
        if not found and len(self._pairs) == 1:  # depth was made of this pair
            return self._pairs[0][0]
        if len(found) != 1:
            raise self._not_certain("the images that belong to the depth", "image", "depth")
        return found[0]

    def _best_depth(self) -> ImageTopic:
        found = self._depths
        if len(found) > 1:
            found = [one for one in found if _REGISTERED.search(one.base)]
        if len(found) > 1:
            found = [one for one in found if _COLOUR.search(one.base)]
        if len(found) != 1:
            raise self._not_certain("the depth", "image", "depth")
        return found[0]

    def _single(self) -> ImageTopic:
        found = self._cameras
        if len(found) > 1 and len(self._pairs) == 1 and len(found) == 2:
            return self._pairs[0][0]
        if len(found) > 1:
            found = [one for one in found if _COLOUR.search(one.base)]
        if len(found) != 1:
            raise self._not_certain("the images", "image")
        return found[0]

    def _given(self, role: str) -> ImageTopic | None:
        if role not in self._named:
            return None
        topic = self._topic(role, self._named[role])
        if not _has_images(topic):
            raise DatasetError(
                f"topic {topic} of {self._bag.path} has no images that can be read; name another "
                "one with --topics"
            )
        found = self._look_at(topic)
        if role != "depth" and found.size is None:
            raise DatasetError(
                f"images of {topic.name} in {self._bag.path} cannot be read: {found.problem}; name "
                "another topic with --topics"
            )
        return found

    def _look_at(self, topic: Topic) -> ImageTopic:
        """Decode the first image of a topic."""
        messages = self._bag.messages(topic)
        compressed = topic.kind == COMPRESSED_IMAGE
        encoding, size, problem = "unknown", None, ""
        try:
            if not messages:
                raise DatasetError("all its messages are cut off")
            first = read_message(self._bag.read(messages[0]), topic.kind, topic.encoding)
            encoding = base_encoding(str(first.format if compressed else first.encoding))
            depth = is_depth(encoding, topic.name)
            decode = decode_depth if depth else decode_pixels
            image = decode(first, compressed=compressed)
            size = (int(image.shape[1]), int(image.shape[0]))
            if compressed and image.ndim == 2 and not depth:
                encoding = "mono8" if image.dtype.itemsize == 1 else "mono16"
        except OrbSlamError as error:
            problem = str(error)  # reported if nothing else can be read
        return ImageTopic(topic, encoding, size, problem)

    # ---- others ----------------------------------------------------------------------------------
    def _info(self, role: str, image: ImageTopic) -> Topic | None:
        if role in self._named:
            return self._topic(role, self._named[role])
        return own_info(self._bag, image)

    def _truth(self) -> Topic | None:
        if "truth" in self._named:
            topic = self._topic("truth", self._named["truth"])
            if topic.kind not in POSES:
                raise DatasetError(
                    f"topic {topic} has no poses; true poses are of the types {', '.join(POSES)}"
                )
            return topic
        found = (t for t in self._bag.topics if t.name == _TRUTH and t.kind in POSES and t.n)
        return next(found, None)

    def _topic(self, role: str, name: str) -> Topic:
        wanted = "/" + name.strip("/")
        found = next((t for t in self._bag.topics if t.name == wanted and t.n), None)
        if found is None:
            raise DatasetError(
                f"--topics: {self._bag.path} has no messages of {name} ({role}); it has "
                f"{_listed(self._bag.topics)}"
            )
        return found

    def _require_images(self) -> None:
        path, topics = self._bag.path, [topic for topic in self._bag.topics if topic.n]
        if not topics:
            raise DatasetError(f"{path} holds no messages; record it again")
        if any(_has_images(topic) for topic in topics):
            return
        pictures = [topic for topic in topics if "Image" in topic.kind]
        if pictures:
            raise DatasetError(
                f"{path} holds images only as {pictures[0]}, {pictures[0].encoding or 'untyped'}: "
                "that cannot be read; convert them to sensor_msgs/msg/Image"
            )
        what = "calibrations (CameraInfo), but no" if _has_infos(topics) else "no"
        raise DatasetError(
            f"{path} holds {what} images: it has {_listed(topics)}; give a bag with "
            "sensor_msgs/Image or sensor_msgs/CompressedImage"
        )

    def _not_certain(self, what: str, *roles: str) -> DatasetError:
        broken = next((one for one in self._all if one.size is None), None)
        if broken is not None and all(one.size is None for one in self._all):
            return DatasetError(
                f"{self._bag.path} has images that cannot be read; the first of "
                f"{broken.topic.name}: {broken.problem}"
            )
        listed = "".join(f"\n  {one}" for one in self._all)
        example = ",".join(f"{role}={topic}" for role, topic in self._examples(roles).items())
        return DatasetError(
            f"cannot decide which topics of {self._bag.path} are {what}; these have images, of "
            f"type, pixels and number:{listed}\nname them with --topics, for example --topics "
            f"{example}"
        )

    def _examples(self, roles: tuple[str, ...]) -> dict[str, str]:
        """Return the possible topics for roles; ``/...`` if there is none."""
        coloured = [one for one in self._cameras if _COLOUR.search(one.base)]
        registered = [one for one in self._depths if _REGISTERED.search(one.base)]
        pair = self._pairs[0] if self._pairs else tuple(self._cameras[:2])
        found: dict[str, Sequence[ImageTopic]] = {
            "image": coloured or self._cameras,
            "left": pair,
            "right": pair[1:],
            "depth": registered or self._depths,
        }
        examples = {}
        for role in roles:
            named = self._named.get(_ALIASES.get(role, role))
            first = next(iter(found[role]), None)
            examples[role] = named or ("/..." if first is None else first.topic.name)
        return examples


def own_info(bag: Bag, image: ImageTopic) -> Topic | None:
    """Find the CameraInfo of a topic of images by its name; None if there is none."""
    parent = image.base.rpartition("/")[0]
    stream = parent.rpartition("/")[0]  # as recordings of RealSense cameras have it
    wanted = [
        *(f"{image.base}/camera_info", f"{parent}/camera_info"),
        f"{stream}/info/camera_info",
    ]
    found = {t.name: t for t in bag.topics if t.kind == CAMERA_INFO and t.n}
    return next((found[name] for name in wanted if name in found), None)


def says_registered(depth: ImageTopic) -> bool:
    """Return whether the name of a topic says that its depth is registered to images."""
    return _REGISTERED.search(depth.base) is not None


def _has_images(topic: Topic) -> bool:
    return bool(topic.n) and topic.kind in (IMAGE, COMPRESSED_IMAGE) and topic.encoding in ENCODINGS


def _has_infos(topics: list[Topic]) -> bool:
    return any(topic.kind == CAMERA_INFO for topic in topics)


def _listed(topics: list[Topic]) -> str:
    shown = ", ".join(map(str, topics[:4])) or "no topics"
    return shown if len(topics) <= 4 else f"{shown} and {len(topics) - 4} more"

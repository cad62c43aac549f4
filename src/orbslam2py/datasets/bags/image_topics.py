# SPDX-License-Identifier: BSD-3-Clause
"""A topic with images: its pixels, and the camera by its name."""

from __future__ import annotations

from dataclasses import dataclass

from orbslam2py.datasets.bags.bag import Topic
from orbslam2py.datasets.bags.messages import COMPRESSED_IMAGE
from orbslam2py.datasets.bags.pixels import is_depth

#: Ways in which image_transport sends an image: the last part of the topic's name.
_TRANSPORTS = ("compressed", "compressedDepth")
#: Images of one camera, the best first: rectified before raw, grey before colour.
_OF_ONE_CAMERA = (
    *("image_rect", "image_rect_color", "image_rect_raw"),
    *("image_mono", "image_raw", "image_color", "image"),
)


@dataclass(frozen=True)
class ImageTopic:
    """A topic with images.

    Attributes
    ----------
    topic
        The topic.
    encoding
        Encoding of its raw pixels: ``mono8``, ``16UC1`` ...
    size
        Width and height of the first image in pixels; None if it cannot be decoded.
    problem
        Why it cannot.
    """

    topic: Topic
    encoding: str
    size: tuple[int, int] | None
    problem: str = ""

    @property
    def is_compressed(self) -> bool:
        """Whether its messages are CompressedImage."""
        return self.topic.kind == COMPRESSED_IMAGE

    @property
    def is_depth(self) -> bool:
        """Whether its pixels are depths."""
        return is_depth(self.encoding, self.topic.name)

    @property
    def base(self) -> str:
        """Name without the transport."""
        name, _, last = self.topic.name.rpartition("/")
        return name if last in _TRANSPORTS and name else self.topic.name

    @property
    def camera(self) -> str:
        """Common part of the names of one camera's images."""
        name, _, last = self.base.rpartition("/")
        return name or "/" if last in _OF_ONE_CAMERA else self.base

    @property
    def is_rectified(self) -> bool:
        """Whether the name contains this word."""
        return "rect" in self.base.rpartition("/")[2]

    def __str__(self) -> str:
        unread = f", not readable: {self.problem}" if self.problem else ", not readable"
        size = unread if self.size is None else f", {self.size[0]} x {self.size[1]}"
        return f"{self.topic.name} ({self.topic.kind}, {self.encoding}{size}, {self.topic.n})"


def rank_of(one: ImageTopic) -> tuple[bool, int, bool]:
    """Sort key of the images of one camera, the best first."""
    last = one.base.rpartition("/")[2]
    place = _OF_ONE_CAMERA.index(last) if last in _OF_ONE_CAMERA else 0
    return (not one.is_rectified, place, one.is_compressed)

# SPDX-License-Identifier: BSD-3-Clause
"""Pixels of image messages: raw, JPEG, PNG, and compressed depth."""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from orbslam2py._arrays import ByteArray
from orbslam2py.datasets.images import decode_any
from orbslam2py.errors import ImageError

#: Encodings of images for eyes: channels, and what OpenCV calls the way to BGR (None: as it is).
_SEEN: dict[str, tuple[int, int | None]] = {
    "mono8": (1, None),
    "8UC1": (1, None),
    "bgr8": (3, None),
    "8UC3": (3, None),
    "rgb8": (3, cv2.COLOR_RGB2BGR),
    "bgra8": (4, cv2.COLOR_BGRA2BGR),
    "8UC4": (4, cv2.COLOR_BGRA2BGR),
    "rgba8": (4, cv2.COLOR_RGBA2BGR),
    # OpenCV names a pattern by its second row and column, ROS by its first.
    "bayer_rggb8": (1, cv2.COLOR_BayerBG2BGR),
    "bayer_bggr8": (1, cv2.COLOR_BayerRG2BGR),
    "bayer_gbrg8": (1, cv2.COLOR_BayerGR2BGR),
    "bayer_grbg8": (1, cv2.COLOR_BayerGB2BGR),
    "yuv422": (2, cv2.COLOR_YUV2BGR_UYVY),
    "uyvy": (2, cv2.COLOR_YUV2BGR_UYVY),
    "yuv422_yuy2": (2, cv2.COLOR_YUV2BGR_YUY2),
    "yuyv": (2, cv2.COLOR_YUV2BGR_YUY2),
}
#: Encodings of grey images of 16 bits; topics with 16UC1 are depth unless the user says otherwise.
_SEEN_16 = ("mono16", "16UC1")
#: Encodings of depth: type of the pixels, and units per metre (REP 118).
_DEPTHS: dict[str, tuple[str, float]] = {
    "16UC1": ("u2", 1000.0),
    "mono16": ("u2", 1000.0),
    "32FC1": ("f4", 1.0),
}
#: Before the PNG of compressed depth: how it is packed, and two numbers for inverse depth.
_DEPTH_HEAD = struct.Struct("<iff")


def is_depth(encoding: str, topic: str) -> bool:
    """Return whether pixels are depths: mono16 is grey unless the topic's name says depth."""
    base = base_encoding(encoding)
    return base in _DEPTHS and (base != "mono16" or "depth" in topic.lower())


def units_per_metre(encoding: str) -> float:
    """Return the units of depth per metre, by its encoding."""
    return _DEPTHS[base_encoding(encoding)][1]


def base_encoding(text: str) -> str:
    """Return the encoding of the pixels, also of compressed ones.

    ``16UC1; compressedDepth png`` is ``16UC1``; ``jpeg`` or ``png`` alone is ``bgr8``.
    """
    first = text.partition(";")[0].strip()
    return first if first in _SEEN or first in _DEPTHS else "bgr8" if _is_packed(text) else first


def _is_packed(text: str) -> bool:
    return any(name in text.lower() for name in ("jpeg", "jpg", "png", "compressed"))


def decode_image(
    message: Any,
    *,
    compressed: bool,
    rgb: bool,
    to_8_bits: Callable[[NDArray[np.generic]], ByteArray],
) -> ByteArray:
    """Decode a grey or colour image.

    Parameters
    ----------
    message
        Image or CompressedImage.
    compressed
        Whether it is a CompressedImage.
    rgb
        Whether the order of colours is RGB (True) or BGR.
    to_8_bits
        Scales images of 16 bits.

    Returns
    -------
    ByteArray
        (h, w) or (h, w, 3).

    Raises
    ------
    ImageError
        If it is damaged, or no grey or colour image; the message does not name the bag.
    """
    pixels = decode_pixels(message, compressed=compressed)
    image = to_8_bits(pixels) if pixels.dtype == np.uint16 else np.asarray(pixels, dtype=np.uint8)
    if image.ndim == 3 and rgb:
        image = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2RGB), dtype=np.uint8)
    return np.ascontiguousarray(image)


def decode_pixels(message: Any, *, compressed: bool) -> NDArray[np.generic]:
    """Decode a grey or colour image: uint8 or uint16, (h, w) or (h, w, 3) in the order BGR.

    Raises
    ------
    ImageError
        If it is damaged, or no grey or colour image; the message does not name the bag.
    """
    if not compressed:
        return _raw_image(message)
    image = decode_any(message.data.tobytes(), "the message")
    if image.dtype not in (np.uint8, np.uint16):
        raise ImageError(f"it has {image.dtype} pixels; images have 8 or 16 bits per channel")
    return image[:, :, :3] if image.ndim == 3 else image


def decode_depth(message: Any, *, compressed: bool) -> NDArray[np.generic]:
    """Decode a depth image (h, w): uint16 or float32, in the units of its encoding.

    Raises
    ------
    ImageError
        If it is damaged, or no depth image; the message does not name the bag.
    """
    if compressed:
        return _packed_depth(message.data.tobytes(), str(message.format))
    encoding = base_encoding(str(message.encoding))
    if encoding not in _DEPTHS:
        raise ImageError(f"its encoding is {message.encoding}; depth is 16UC1 or 32FC1")
    return _rows(message, np.dtype(_DEPTHS[encoding][0]), 1)[:, :, 0]


def _raw_image(message: Any) -> NDArray[np.generic]:
    told = str(message.encoding)
    if told in _SEEN_16:
        return _rows(message, np.dtype(np.uint16), 1)[:, :, 0]
    encoding = told if told in _SEEN else told.lower()  # the RealSense SDK writes YUYV
    if encoding not in _SEEN:
        raise ImageError(
            f"its encoding is {told or 'not told'}; known are {', '.join(_SEEN)} and mono16; "
            "convert it to mono8"
        )
    channels, way = _SEEN[encoding]
    pixels = np.asarray(_rows(message, np.dtype(np.uint8), channels), dtype=np.uint8)
    image = pixels[:, :, 0] if channels == 1 else pixels
    return image if way is None else np.asarray(cv2.cvtColor(image, way), dtype=np.uint8)


def _rows(message: Any, kind: np.dtype[Any], channels: int) -> NDArray[np.generic]:
    """View the bytes of a raw image as (h, w, channels); rows may be padded."""
    height, width, step = int(message.height), int(message.width), int(message.step)
    row = width * channels * kind.itemsize
    step = step or row
    data = np.asarray(message.data, dtype=np.uint8)
    if min(height, width) == 0 or step < row or data.size < step * (height - 1) + row:
        raise ImageError(
            f"it is damaged: {data.size} bytes for {width} x {height} pixels ({message.encoding})"
        )
    if data.size < step * height:  # the last row without its padding
        data = np.pad(data, (0, step * height - data.size))
    pixels = data[: step * height].reshape(height, step)[:, :row]
    there = kind.newbyteorder(">" if message.is_bigendian else "<")
    shaped = np.ascontiguousarray(pixels).view(there)
    native: NDArray[np.generic] = shaped.reshape(height, width, channels).astype(kind, copy=False)
    return native


def _packed_depth(content: bytes, form: str) -> NDArray[np.generic]:
    """Decode ``compressedDepth``: a header, then a PNG of depth or of scaled inverse depth."""
    encoding = base_encoding(form)
    if "compressedDepth" not in form:
        decoded = decode_any(content, "the message")  # a plain PNG of 16 bits
    else:
        if "rvl" in form.lower():
            raise ImageError("it is packed as RVL; record it as compressedDepth with PNG")
        decoded = decode_any(content[_DEPTH_HEAD.size :], "the message")
    if decoded.ndim != 2:
        raise ImageError(f"it has {decoded.shape[2]} channels; depth has one")
    if encoding != "32FC1" or decoded.dtype.kind == "f":
        return decoded
    _, scale, shift = _DEPTH_HEAD.unpack_from(content)
    metres = np.zeros(decoded.shape, dtype=np.float32)
    known = np.asarray(decoded, dtype=np.float32)
    np.divide(np.float32(scale), known - np.float32(shift), out=metres, where=known > 0)
    return metres

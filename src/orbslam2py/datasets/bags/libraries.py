# SPDX-License-Identifier: BSD-3-Clause
"""The libraries that read messages and compressed parts of bags: rosbags and its dependencies."""

from __future__ import annotations

import importlib
import shutil
import sys
from functools import lru_cache
from typing import Any, BinaryIO

from orbslam2py.errors import DatasetError

#: The bytes that compressed data (Zstandard) begin with; no serialised message does.
ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
_ZSTD = "compression.zstd" if sys.version_info >= (3, 14) else "backports.zstd"


def require(name: str) -> Any:
    """Import a module of rosbags or of its dependencies.

    Raises
    ------
    DatasetError
        If it is not installed, with the command that installs it.
    """
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise DatasetError(
            "bags are read with the package rosbags, which is not installed; "
            "install it: pip install 'orbslam2py[bags]'"
        ) from error


def lz4_decompress(content: bytes) -> bytes:
    """Decompress a frame of LZ4."""
    return bytes(require("lz4.frame").decompress(content))


def zstd_decompress(content: bytes, most: int | None = None) -> bytes:
    """Decompress Zstandard data, completely or only the first bytes.

    Raises
    ------
    OSError
        If the data are damaged.
    """
    zstd = require(_ZSTD)
    try:
        if most is None:
            return bytes(zstd.decompress(content))
        return bytes(zstd.ZstdDecompressor().decompress(content, max_length=most))
    except zstd.ZstdError as error:
        raise OSError(f"damaged Zstandard data: {error}") from error


def unpack_zstd(packed: BinaryIO, target: BinaryIO) -> str | None:
    """Decompress a file of Zstandard data, as much as is intact.

    Returns
    -------
    str or None
        What is wrong with the data, such as ``is cut off``; None if they were complete.

    Raises
    ------
    OSError
        If a file cannot be read or written.
    """
    zstd = require(_ZSTD)
    try:
        with zstd.open(packed, "rb") as source:
            shutil.copyfileobj(source, target, 1 << 20)
    except EOFError:
        return "is cut off"
    except zstd.ZstdError:
        return "is damaged"
    return None


@lru_cache(maxsize=2)
def type_store(encoding: str) -> Any:
    """Return rosbags' types for messages of ROS 1 (``ros1``) or ROS 2 (``cdr``)."""
    typesys = require("rosbags.typesys")
    stores = typesys.Stores
    if encoding != "ros1":
        return typesys.get_typestore(stores.ROS2_HUMBLE)
    store = typesys.get_typestore(stores.ROS1_NOETIC)
    name = "tf2_msgs/msg/TFMessage"
    if name not in store.types:
        definition = "geometry_msgs/TransformStamped[] transforms"
        store.register(typesys.get_types_from_msg(definition, name))
    return store

# SPDX-License-Identifier: BSD-3-Clause
"""Synthetic images that several tests use are rendered once, which takes as long as tracking."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from orbslam2py._arrays import FloatArray
from orbslam2py.synthetic import SyntheticSequence

#: Bytes of the images that are kept; those that were not used for longest go first.
_MOST_BYTES = 200_000_000

_RENDER = SyntheticSequence._rendered


class _Kept:
    """Images by all that they depend on."""

    def __init__(self) -> None:
        self._images: OrderedDict[tuple[Any, ...], tuple[Any, Any]] = OrderedDict()
        self._n_bytes = 0
        self._lock = threading.Lock()

    def get(self, key: tuple[Any, ...]) -> tuple[Any, Any] | None:
        with self._lock:
            found = self._images.get(key)
            if found is not None:
                self._images.move_to_end(key)
            return found

    def put(self, key: tuple[Any, ...], images: tuple[Any, Any]) -> None:
        with self._lock:
            if key not in self._images:
                self._images[key] = images
                self._n_bytes += _size(images)
            while self._n_bytes > _MOST_BYTES:
                self._n_bytes -= _size(self._images.popitem(last=False)[1])


def _size(images: tuple[Any, Any]) -> int:
    return sum(image.nbytes for image in images)


_kept = _Kept()


def _rendered_once(
    self: SyntheticSequence,
    world: Any,
    T_wc: FloatArray,
    number: int,
    exposure: float,
    noise: float | None,
) -> tuple[Any, Any]:
    options = self.options
    place = [*self._built_parts, self._built].index(world)  # which of the parts that move
    noise = options.noise if noise is None else noise
    key = (
        *(self._world, options.length, options.seed, place, self._size, self.camera.fx),
        *(T_wc.tobytes(), number if noise > 0 else None, exposure, noise),
    )
    images = _kept.get(key)
    if images is None:
        images = _RENDER(self, world, T_wc, number, exposure, noise)
        _kept.put(key, images)
    grey, depth = images
    return grey.copy(), depth.copy()  # a test may write into them


def render_once() -> None:
    """Keep what is rendered from now on."""
    SyntheticSequence._rendered = _rendered_once  # type: ignore[method-assign]


@contextmanager
def rendered_each_time() -> Iterator[None]:
    """For tests of the rendering itself."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(SyntheticSequence, "_rendered", _RENDER)
        yield

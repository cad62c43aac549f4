# SPDX-License-Identifier: BSD-3-Clause
"""Synthetic worlds and images that several tests use are made once: they take their time."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import lru_cache
from typing import Any

import pytest

from orbslam2py._arrays import FloatArray
from orbslam2py.synthetic import SyntheticSequence
from orbslam2py.synthetic.scenes import SyntheticWorld, make_scene

#: Bytes of the images that are kept; those that were not used for longest go first.
_MOST_BYTES = 200_000_000

_RENDER = SyntheticSequence._rendered
_BUILT = SyntheticSequence.__dict__["_built"]
_BUILT_PARTS = SyntheticSequence.__dict__["_built_parts"]


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
    self: SyntheticSequence, world: Any, T_wc: FloatArray, image: Mapping[str, Any]
) -> tuple[Any, Any]:
    options = self.options
    place = [*self._built_parts, self._built].index(world)  # which of the parts that move
    # Without noise its seed does not matter.
    matters = {name: image[name] for name in image if image["noise"] > 0 or name != "noise_seed"}
    key = (
        *(type(self), self._world, options.length, options.seed, place),
        *(T_wc.tobytes(), *matters.items()),
    )
    images = _kept.get(key)
    if images is None:
        images = _RENDER(self, world, T_wc, image)
        _kept.put(key, images)
    grey, depth = images
    return grey.copy(), depth.copy()  # a test may write into them


@lru_cache(maxsize=8)
def _made(world: SyntheticWorld, length: float | None, seed: int) -> tuple[Any, list[Any]]:
    """A world, and its parts that move."""
    scene = make_scene(world, length)
    return scene.make_world(seed), [part.make_world(seed) for part in scene.moving]


def _built_once(self: SyntheticSequence) -> Any:
    if type(self)._built is not SyntheticSequence._built:  # which changes the world
        return self._scene.make_world(self.options.seed)
    return _made(self._world, self.options.length, self.options.seed)[0]


def _parts_built_once(self: SyntheticSequence) -> list[Any]:
    return _made(self._world, self.options.length, self.options.seed)[1]


def render_once() -> None:
    """Keep what is made and rendered from now on."""
    SyntheticSequence._rendered = _rendered_once  # type: ignore[method-assign]
    SyntheticSequence._built = property(_built_once)  # type: ignore[assignment]
    SyntheticSequence._built_parts = property(_parts_built_once)  # type: ignore[assignment]


@contextmanager
def rendered_each_time() -> Iterator[None]:
    """For tests of the rendering itself."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(SyntheticSequence, "_rendered", _RENDER)
        yield


@contextmanager
def made_each_time() -> Iterator[None]:
    """For tests of the worlds themselves."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(SyntheticSequence, "_built", _BUILT)
        patch.setattr(SyntheticSequence, "_built_parts", _BUILT_PARTS)
        yield

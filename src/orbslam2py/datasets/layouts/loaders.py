# SPDX-License-Identifier: BSD-3-Clause
"""Loaders by layout: those of this package, and those of other installed packages."""

from __future__ import annotations

import sys
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Protocol, runtime_checkable

from orbslam2py.datasets.base import IterableSequence
from orbslam2py.datasets.choose_settings import SettingsChoice
from orbslam2py.datasets.layouts.bonn import BonnSequence
from orbslam2py.datasets.layouts.icl_nuim import IclNuimSequence
from orbslam2py.datasets.layouts.kitti_raw import KittiRawSequence
from orbslam2py.datasets.layouts.openloris import OpenLorisSequence
from orbslam2py.datasets.layouts.replica import ReplicaSequence
from orbslam2py.datasets.layouts.seven_scenes import SevenScenesSequence
from orbslam2py.errors import DatasetError
from orbslam2py.settings import Sensor

#: Group of entry points under which a package names its loaders.
ENTRY_POINTS = "orbslam2py.sequences"


@runtime_checkable
class Loader(Protocol):
    """Opens the sequences of a layout; usually the class of the sequence itself.

    A package names it in its ``pyproject.toml``; then folders of its layout are recognised::

        [project.entry-points."orbslam2py.sequences"]
        my-robot = "my_package:RobotSequence"
    """

    def recognises(self, folder: Path, /) -> bool:
        """Return whether a folder has this layout, by its files; must be fast."""
        ...

    def __call__(
        self,
        folder: Path,
        sensor: Sensor | str | None = None,
        /,
        *,
        settings: SettingsChoice = None,
    ) -> IterableSequence:
        """Open the sequence.

        Raises
        ------
        DatasetError, SettingsError
            If it cannot be opened.
        """
        ...


#: Those of the package; before the ones that share a mark with them, such as TUM's lists.
OWN: dict[str, Loader] = {
    str(kind.layout): kind
    for kind in (
        *(IclNuimSequence, SevenScenesSequence, BonnSequence, ReplicaSequence),
        *(OpenLorisSequence, KittiRawSequence),
    )
}


def find_loaders(folder: Path) -> dict[str, Loader]:
    """Return the loaders that recognise a folder, by the names of their layouts.

    Loaders of other packages take precedence.

    Raises
    ------
    DatasetError
        If the loader of another package cannot be imported, or is invalid.
    """
    if not folder.is_dir():
        return {}
    installed = {point.name: _load(point) for point in _installed(tuple(sys.path))}
    found = {name: one for name, one in installed.items() if one.recognises(folder)}
    return found or {name: one for name, one in OWN.items() if one.recognises(folder)}


def loader_of(name: str) -> Loader | None:
    """Return the loader of a layout, None if there is none of that name."""
    for point in _installed(tuple(sys.path)):
        if point.name == name:
            return _load(point)
    return OWN.get(name)


@cache
def _installed(places: tuple[str, ...]) -> tuple[EntryPoint, ...]:
    """Return the loaders of other packages; `places` is the search path."""
    return tuple(entry_points(group=ENTRY_POINTS))


def _load(point: EntryPoint) -> Loader:
    try:
        loader = point.load()
    except (ImportError, AttributeError) as error:
        raise DatasetError(
            f"the loader '{point.name}' ({point.value}) cannot be imported: {error}; repair or "
            "remove the package it is from"
        ) from error
    if not isinstance(loader, Loader):
        raise DatasetError(
            f"the loader '{point.name}' ({point.value}) has no 'recognises', or cannot be called; "
            "repair or remove the package it is from"
        )
    return loader

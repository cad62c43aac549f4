# SPDX-License-Identifier: BSD-3-Clause
"""Sequences of a standard data set below a folder, recognised by their files."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from enum import Enum
from pathlib import Path

from orbslam2py._arguments import member_of
from orbslam2py._files import reason_of
from orbslam2py.datasets import Layout, recognise
from orbslam2py.datasets.recognise import has_layout
from orbslam2py.errors import DatasetError

#: Folders in folders that are looked into; the archives of the data sets need three.
_DEPTH = 5


class StandardSet(str, Enum):
    """A data set for comparisons of systems."""

    TUM = "tum"
    """TUM RGB-D (Sturm et al., IROS 2012)."""
    KITTI = "kitti"
    """KITTI odometry (Geiger et al., CVPR 2012)."""
    EUROC = "euroc"
    """EuRoC MAV (Burri et al., IJRR 2016)."""
    TUM_VI = "tum-vi"
    """TUM-VI (Schubert et al., IROS 2018)."""

    @classmethod
    def of(cls, value: StandardSet | str) -> StandardSet:
        """Take a set or its name.

        Raises
        ------
        DatasetError
            For an unknown name; the message lists the names.
        """
        return member_of(cls, value, "the standard data set")

    @property
    def full_name(self) -> str:
        """Its name as its authors write it."""
        return {
            "tum": "TUM RGB-D",
            "kitti": "KITTI odometry",
            "euroc": "EuRoC MAV",
            "tum-vi": "TUM-VI",
        }[self.value]

    @property
    def files(self) -> str:
        """The files by which its sequences are recognised."""
        return {
            "tum": "rgb.txt or associations.txt",
            "kitti": "times.txt with image_0 or image_2",
            "euroc": "mav0/cam0",
            "tum-vi": "mav0/cam0 and mav0/mocap0",
        }[self.value]

    def __str__(self) -> str:
        return self.value


def find_sequences(kind: StandardSet | str, root: Path) -> dict[str, Path]:
    """Find all sequences of a data set in a folder and the folders below it.

    Parameters
    ----------
    kind
        Which data set; sequences of others are ignored.
    root
        The folder to search.

    Returns
    -------
    dict
        Folders by name, in the order of the names. If two sequences have the same name, their
        parent folders are added to it.

    Raises
    ------
    DatasetError
        If there is none.
    """
    kind = StandardSet.of(kind)
    if not root.is_dir():
        what = "is no folder" if root.exists() else "does not exist"
        raise DatasetError(
            f"{root} {what}; give the folder that holds the sequences of {kind.full_name}"
        )
    found: list[Path] = []
    others: Counter[str] = Counter()
    for folder in _sequences(root, _DEPTH, set()):
        of = _set_of(folder)
        if of == kind.value:
            found.append(folder)
        else:
            others[of] += 1
    if not found:
        raise DatasetError(f"{root} holds no sequence of {kind.full_name}{_instead(kind, others)}")
    times = Counter(_name(folder) for folder in found)
    names = {
        _name(folder) if times[_name(folder)] == 1 else str(folder.relative_to(root)): folder
        for folder in found
    }
    return dict(sorted(names.items()))


def _set_of(folder: Path) -> str:
    """Name of the data set, or of the layout: TUM-VI has that of EuRoC, and poses in mocap0."""
    layout = recognise(folder)
    has_mocap = any((root / "mocap0").is_dir() for root in (folder, folder / "mav0"))
    return str(StandardSet.TUM_VI if layout is Layout.EUROC and has_mocap else layout)


def _sequences(folder: Path, depth: int, seen: set[Path]) -> Iterator[Path]:
    real = folder.resolve()
    if real in seen:
        return  # a link back to where it lies
    seen.add(real)
    if has_layout(folder):
        yield folder
        return
    if depth == 0:
        return
    try:
        inner = sorted(child for child in folder.iterdir() if child.is_dir())
    except OSError as error:
        raise DatasetError(
            f"{folder} cannot be read: {reason_of(error)}; give a folder that can"
        ) from error
    for child in inner:
        if not child.name.startswith("."):
            yield from _sequences(child, depth - 1, seen)


def _name(folder: Path) -> str:
    resolved = folder.resolve()
    return resolved.parent.name if resolved.name == "mav0" else folder.absolute().name


def _instead(kind: StandardSet, others: Counter[str]) -> str:
    names = {one.value for one in StandardSet}
    meant = next((name for name, _ in others.most_common() if name in names), None)
    if meant is not None:
        return f", but of {StandardSet(meant).full_name}: orbslam2py benchmark {meant}"
    return f": looked {_DEPTH} folders deep for {kind.files}; give the folder in which these lie"

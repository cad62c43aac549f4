# SPDX-License-Identifier: BSD-3-Clause
"""Folders that a sequence is read from: results there would become part of the next run."""

from __future__ import annotations

from pathlib import Path

from orbslam2py.datasets import DepthFolders, is_recording
from orbslam2py.datasets.depth_folders import told_by_names
from orbslam2py.datasets.image_folder import image_files
from orbslam2py.errors import DatasetError
from orbslam2py.runs.outputs import holds_run


def check_not_among_images(output: Path, sequence: object, source: Path | None = None) -> None:
    """Check that results will not be among the files of a sequence.

    Otherwise pictures of a run would count as frames, and its settings would replace the
    calibration beside the images.

    Parameters
    ----------
    output : Path
        Folder of the results.
    sequence : Sequence or LiveSource
        The sequence.
    source : Path, optional
        The folder of the sequence; by default from the sequence itself (`folder` or `path`).

    Raises
    ------
    DatasetError
        If it is the sequence's folder, or a folder in it that is read.
    """
    source = _place_of(sequence) if source is None else source
    if source is None or not (source.is_dir() or is_recording(source)):
        return
    folder = source if source.is_dir() else source.absolute().parent
    if folder != source and not is_recording(folder):  # else the folder of a bag stands for it
        return
    place, own = output.resolve(), folder.resolve()
    remedy = "give another --output (output)"
    if place == own:
        what = "images" if getattr(sequence, "layout", "") == "images" else "sequence"
        raise DatasetError(
            f"{output} is the folder of the {what}: the next run would take what this one writes "
            f"for a part of it, pictures and settings.yaml; {remedy}"
        )
    if own not in place.parents or folder != source:
        return
    if _is_read(place) or place in _folders_of_images(sequence):
        raise DatasetError(
            f"{output} is one of the sequence's own folders: results would lie among the images; "
            f"{remedy}"
        )
    beside_a_pair = getattr(sequence, "layout", "") == DepthFolders.layout and place.parent == own
    if beside_a_pair and not told_by_names(own):
        raise DatasetError(
            f"{output} would lie beside the folders of images and depth, and its pictures be taken "
            f"for a third one; give another --output (output), such as {source / 'runs' / 'first'}"
        )


def _place_of(sequence: object) -> Path | None:
    """Return the path of a sequence on disk; None if unknown."""
    places = (getattr(sequence, name, None) for name in ("folder", "path"))
    return next((place for place in places if isinstance(place, Path)), None)


def _folders_of_images(sequence: object) -> set[Path]:
    """Return the folders of the first image, if the sequence gives its file."""
    path_of = getattr(sequence, "image_path", None)
    first = path_of(0) if callable(path_of) else None
    return set(first.resolve().parents) if isinstance(first, Path) else set()


def _is_read(folder: Path) -> bool:
    """Return whether a folder of a sequence is probably read: it has images, and no run."""
    return folder.is_dir() and not holds_run(folder) and bool(image_files(folder))

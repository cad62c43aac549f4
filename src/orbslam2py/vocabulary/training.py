# SPDX-License-Identifier: BSD-3-Clause
"""Vocabularies trained on the features of images."""

from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import cv2
import numpy as np

from orbslam2py import _core as core
from orbslam2py._arguments import cannot_open, path_of, shown
from orbslam2py._arrays import ByteArray
from orbslam2py._cores import n_threads
from orbslam2py._files import IMAGE_SUFFIXES, kind_of_special
from orbslam2py.errors import ImageError, VocabularyError


def read_training_images(folder: str | os.PathLike[str]) -> list[Path]:
    """Find all images below a folder, sorted by path.

    Parameters
    ----------
    folder : path
        Searched with its subfolders.

    Raises
    ------
    VocabularyError
        If there are none.
    """
    root = path_of(folder, "the folder of images", VocabularyError).expanduser()
    images = sorted(
        path
        for path in root.rglob("*")
        if path.suffix.lower() in IMAGE_SUFFIXES and not path.is_dir()
    )
    if not images:
        if not root.is_dir():
            what = "is a file" if root.exists() else "does not exist"
            raise VocabularyError(f"{root} {what}; give a folder of photographs")
        suffixes = ", ".join(sorted(IMAGE_SUFFIXES))
        raise VocabularyError(
            f"{root} holds no images ({suffixes}), nor do its folders; give a folder of photographs"
        )
    return images


def train_vocabulary(
    images: Iterable[str | os.PathLike[str]],
    options: core.TrainingOptions | None = None,
    *,
    features: core.OrbOptions | None = None,
    progress: Callable[[str, float], object] | None = None,
) -> core.Vocabulary | None:
    """Train a vocabulary on the features of images.

    Parameters
    ----------
    images : iterable of path
        Photographs of places like those to recognise, one of each place.
    options : TrainingOptions, optional
    features : OrbOptions, optional
        Options of the feature extraction; default: 2000 per image.
    progress : callable, optional
        Called with the name of the step and the completed fraction, 0 to 1; returning False
        cancels.

    Returns
    -------
    Vocabulary or None
        Equal for equal images, options and seed, with any number of threads. None when cancelled.

    Raises
    ------
    ImageError
        If a file is not an image.
    SettingsError, VocabularyError
        If options are out of range or the images have no features.
    """
    options = options or core.TrainingOptions()
    options.check()
    features = features or core.OrbOptions(n_features=2000)
    report = progress or (lambda step, fraction: None)

    descriptors = _describe_images(_paths_of(images), features, options, report)
    if descriptors is None:
        return None
    ends = np.cumsum([len(rows) for rows in descriptors]).tolist()
    rows = np.concatenate([np.empty((0, 32), np.uint8), *descriptors])
    descriptors.clear()
    return core.train_vocabulary(rows, ends, options, lambda done: report("Clustering", done))


def _paths_of(images: Iterable[str | os.PathLike[str]]) -> list[Path]:
    if isinstance(images, str | bytes | os.PathLike) or not isinstance(images, Iterable):
        raise VocabularyError(
            f"the images are {shown(images)}; give a list of paths, as from read_training_images"
        )
    return [path_of(image, "an image", VocabularyError) for image in images]


def _describe_images(
    paths: list[Path],
    features: core.OrbOptions,
    options: core.TrainingOptions,
    report: Callable[[str, float], object],
) -> list[ByteArray] | None:
    """Return the descriptors of every image, in order; None if cancelled."""
    of_thread = threading.local()

    def describe(path: Path) -> ByteArray:
        if not hasattr(of_thread, "extractor"):
            of_thread.extractor = core.OrbExtractor(features)
        descriptors: ByteArray = of_thread.extractor.extract(_read_grey(path)).descriptors
        return descriptors

    results: list[ByteArray] = []
    pool = ThreadPoolExecutor(options.n_threads or n_threads(len(paths)))
    try:
        for descriptors in pool.map(describe, paths):
            results.append(descriptors)
            if report("Reading images", len(results) / len(paths)) is False:
                return None
    finally:
        pool.shutdown(cancel_futures=True)
    return results


def _read_grey(path: Path) -> ByteArray:
    # Not cv2.imread: it ends the program over a name that is not UTF-8.
    try:
        special = kind_of_special(path)
        if special is not None:
            raise ImageError(
                f"image {path} is a {special}, not a file; replace it, or leave it out"
            )
        content = np.frombuffer(path.read_bytes(), np.uint8)
    except OSError as error:
        raise ImageError(cannot_open(path, error, "image")) from error
    image = None
    if content.size:
        # Of a size that OpenCV refuses, or one that does not fit into memory.
        with contextlib.suppress(cv2.error):
            image = cv2.imdecode(content, cv2.IMREAD_GRAYSCALE)
    if image is None:
        raise ImageError(f"{path}: cannot be read as an image; remove it, or replace it")
    return np.asarray(image, dtype=np.uint8)

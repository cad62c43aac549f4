# SPDX-License-Identifier: BSD-3-Clause
"""Vocabularies trained on images."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from orbslam2py import ImageError, SettingsError, VocabularyError
from orbslam2py import _core as core
from orbslam2py.vocabulary import read_training_images, save_vocabulary, train_vocabulary


@pytest.fixture
def photographs(tmp_path) -> Path:
    folder = tmp_path / "images"
    (folder / "more").mkdir(parents=True)
    rng = np.random.default_rng(5)
    for i in range(6):
        image = cv2.resize(rng.integers(0, 256, (24, 32), np.uint8), (320, 240))
        cv2.imwrite(str(folder / ("more" if i % 2 else ".") / f"{i}.png"), image)
    (folder / "readme.txt").write_text("not an image")
    return folder


def small_tree(**changes: float) -> core.TrainingOptions:
    options = core.TrainingOptions()
    options.branching = 5
    options.depth = 3
    for name, value in changes.items():
        setattr(options, name, value)
    return options


def test_training_depends_on_images_and_seed_only(photographs):
    images = read_training_images(photographs)
    assert len(images) == 6
    features = core.OrbOptions(n_features=200)
    first = train_vocabulary(images, small_tree(n_threads=1), features=features)
    second = train_vocabulary(images, small_tree(n_threads=2), features=features)
    other = train_vocabulary(images, small_tree(seed=1), features=features)
    assert first.hash == second.hash != other.hash
    assert 25 < first.n_words <= 125


def test_training_files_are_equal_bytes(photographs, tmp_path):
    images = read_training_images(photographs)
    for threads in (1, 2):
        trained = train_vocabulary(images, small_tree(n_threads=threads))
        save_vocabulary(trained, tmp_path / f"{threads}.bvoc", comment="same")
    assert (tmp_path / "1.bvoc").read_bytes() == (tmp_path / "2.bvoc").read_bytes()


def test_training_reports_and_cancels(photographs):
    steps: list[str] = []
    images = read_training_images(photographs)
    train_vocabulary(images, small_tree(), progress=lambda step, done: steps.append(step))
    assert set(steps) == {"Reading images", "Clustering"}
    for name in ("Reading images", "Clustering"):
        assert train_vocabulary(images, small_tree(), progress=lambda s, d, n=name: s != n) is None


def test_training_refuses_nonsense(photographs, tmp_path):
    with pytest.raises(VocabularyError, match="does not exist; give a folder"):
        read_training_images(tmp_path / "nowhere")
    with pytest.raises(VocabularyError, match="no descriptors"):
        train_vocabulary([])
    with pytest.raises(SettingsError, match="branching"):
        train_vocabulary(read_training_images(photographs), small_tree(branching=1))
    with pytest.raises(ImageError, match=r"readme\.txt"):
        train_vocabulary([photographs / "readme.txt"])


def test_exception_in_training_progress_comes_through(photographs):
    def stop(step: str, fraction: float) -> None:
        if step == "Clustering":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train_vocabulary(read_training_images(photographs), small_tree(), progress=stop)

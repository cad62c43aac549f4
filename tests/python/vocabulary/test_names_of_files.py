# SPDX-License-Identifier: BSD-3-Clause
"""Files whose names are no UTF-8: read and written, or refused in words."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from orbslam2py import ImageError, VocabularyError, load_vocabulary
from orbslam2py import _core as core
from orbslam2py.vocabulary import (
    convert_vocabulary,
    read_training_images,
    save_vocabulary,
    train_vocabulary,
    vocabulary_info,
)
from orbslam2py.vocabulary.vocabulary import vocabulary_name

#: As Python spells a name with a byte that is no UTF-8.
NOT_UTF_8 = "caf\udce9"


def test_binary_vocabularies_are_refused_in_words(vocabulary, tmp_path) -> None:
    good = tmp_path / "good.bvoc"
    save_vocabulary(vocabulary, good)
    bad = Path(shutil.copy(good, tmp_path / f"{NOT_UTF_8}.bvoc"))
    for call in (
        lambda: load_vocabulary(bad),
        lambda: vocabulary_info(bad),
        lambda: save_vocabulary(vocabulary, bad),
        lambda: convert_vocabulary(good, bad),
        lambda: convert_vocabulary(bad, tmp_path / "new.txt"),
    ):
        with pytest.raises(VocabularyError, match=r"is not UTF-8.*; rename the file") as refused:
            call()
        assert str(bad) in str(refused.value)
    assert bad.read_bytes() == good.read_bytes()


def test_text_is_read_written_and_kept_in_the_cache(vocabulary, text, tmp_path) -> None:
    """Only the binary format is opened by its name in the core."""
    named = Path(shutil.copy(text, tmp_path / f"{NOT_UTF_8}.txt"))
    assert load_vocabulary(named).hash == vocabulary.hash
    kept = [path.name for path in (tmp_path / "cache" / "orbslam2py").iterdir()]
    assert len(kept) == 1
    assert kept[0].endswith(".bvoc")
    assert load_vocabulary(named).source != core.VocabularySource(), "the copy is used"
    assert vocabulary_name(named) == named.name
    other = tmp_path / f"other{NOT_UTF_8}.txt.gz"
    save_vocabulary(vocabulary, other)
    assert load_vocabulary(other, cache=False).hash == vocabulary.hash


def test_a_comment_that_holds_such_a_name(text, vocabulary, tmp_path) -> None:
    named = Path(shutil.copy(text, tmp_path / f"{NOT_UTF_8}.txt"))
    convert_vocabulary(named, tmp_path / "new.bvoc")
    assert load_vocabulary(tmp_path / "new.bvoc").comment == "Converted from caf\ufffd.txt."
    save_vocabulary(vocabulary, tmp_path / "other.bvoc", comment=f"of {NOT_UTF_8}")
    assert load_vocabulary(tmp_path / "other.bvoc").comment == "of caf\ufffd"


def test_photographs_are_read_whatever_their_names(tmp_path) -> None:
    """OpenCV ended the whole program."""
    pixels = cv2.resize(np.random.default_rng(5).integers(0, 256, (24, 32), np.uint8), (320, 240))
    content = cv2.imencode(".png", pixels)[1].tobytes()
    trained = []
    options = core.TrainingOptions()
    options.branching, options.depth = 5, 2
    for name in ("plain", NOT_UTF_8):
        (tmp_path / name).mkdir()
        (tmp_path / name / f"{name}.png").write_bytes(content)
        trained.append(train_vocabulary(read_training_images(tmp_path / name), options))
    assert trained[0].hash == trained[1].hash


@pytest.mark.watchdog(30)
def test_what_is_no_photograph(tmp_path) -> None:
    (tmp_path / "sub.png").mkdir()
    (tmp_path / "empty.png").write_bytes(b"")
    os.mkfifo(tmp_path / "pipe.png")
    (tmp_path / "text.png").write_text("no image")
    for name, words in (
        ("sub.png", "sub.png"),
        ("empty.png", "empty.png: cannot be read as an image; remove it"),
        ("text.png", "text.png: cannot be read as an image; remove it"),
        ("pipe.png", "pipe.png is a pipe, not a file; replace it"),
        ("none.png", "none.png"),
    ):
        with pytest.raises(ImageError, match=words):
            train_vocabulary([tmp_path / name])


def test_a_folder_called_like_a_photograph_is_searched(tmp_path) -> None:
    (tmp_path / "all.png").mkdir()
    (tmp_path / "all.png" / "a.jpg").write_bytes(b"")
    assert read_training_images(tmp_path) == [tmp_path / "all.png" / "a.jpg"]
    (tmp_path / "all.png" / "a.jpg").unlink()
    with pytest.raises(VocabularyError, match="holds no images"):
        read_training_images(tmp_path)

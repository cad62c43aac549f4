# SPDX-License-Identifier: BSD-3-Clause
"""Which vocabulary is taken, and where its parsed copy is kept."""

from __future__ import annotations

import multiprocessing
import os
import sys

import pytest

from orbslam2py import VocabularyError
from orbslam2py.vocabulary import (
    ENVIRONMENT_VARIABLE,
    default_vocabulary_path,
    load_vocabulary,
    save_vocabulary,
    vocabulary_info,
)
from support.file_mapping import tell_permissions
from support.vocabularies import TEXT, with_line


# ---- choice and cache ----------------------------------------------------------------------------
def test_order_of_choice(vocabulary, tmp_path, monkeypatch):
    path = tmp_path / "mine.bvoc"
    vocabulary.save(str(path))
    monkeypatch.setenv(ENVIRONMENT_VARIABLE, str(path))
    assert load_vocabulary().hash == vocabulary.hash
    with pytest.raises(VocabularyError, match="other"):
        load_vocabulary(tmp_path / "other")


def test_text_is_parsed_once(vocabulary, text):
    reports: list[float] = []
    assert load_vocabulary(text, progress=reports.append).hash == vocabulary.hash
    assert reports[-1] == 1.0
    assert text.with_suffix(".bvoc").exists()
    reports.clear()
    assert load_vocabulary(text, progress=reports.append).hash == vocabulary.hash
    assert reports == []


def test_changed_text_is_parsed_again(vocabulary, text):
    load_vocabulary(text)
    lines = text.read_text().splitlines()
    with_line(text, len(lines), lines[-1].replace("0.499397", "0.599397"))
    assert load_vocabulary(text).hash != vocabulary.hash
    # The same size and time, another content.
    stamp = text.stat().st_mtime_ns
    text.write_bytes(TEXT.read_bytes())
    os.utime(text, ns=(stamp, stamp))
    assert load_vocabulary(text).hash == vocabulary.hash


def test_damaged_or_foreign_copy_is_left_alone(vocabulary, text, tmp_path):
    beside = text.with_suffix(".bvoc")
    beside.write_bytes(b"my own file")
    assert load_vocabulary(text).hash == vocabulary.hash
    assert beside.read_bytes() == b"my own file"
    assert len(list((tmp_path / "cache" / "orbslam2py").iterdir())) == 1
    load_vocabulary(text, progress=lambda fraction: pytest.fail("parsed again"))


def test_nowhere_to_keep_a_copy(vocabulary, text, tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    text.with_suffix(".bvoc").mkdir()
    assert load_vocabulary(text).hash == vocabulary.hash


def test_exception_in_progress_ends_reading_and_writing(vocabulary, text, tmp_path):
    class StopError(Exception):
        pass

    def stop(fraction: float) -> None:
        raise StopError

    with pytest.raises(StopError):
        load_vocabulary(text, progress=stop)
    assert not text.with_suffix(".bvoc").exists()
    with pytest.raises(StopError):
        save_vocabulary(vocabulary, tmp_path / "new.txt", progress=stop)
    assert [p.name for p in tmp_path.iterdir()] == ["words.txt"]


@pytest.mark.parametrize("name", ["v.bvoc", "v.txt", "v.txt.gz"])
def test_unwritable_target_is_named(vocabulary, tmp_path, name):
    target = tmp_path / "missing" / name
    with pytest.raises(VocabularyError, match="cannot be written"):
        save_vocabulary(vocabulary, target)
    with pytest.raises(VocabularyError, match=r"must end with \.bvoc"):
        save_vocabulary(vocabulary, tmp_path / "v.bin")


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
def test_binary_files_are_mapped_and_shared(vocabulary, tmp_path):
    path = tmp_path / "v.bvoc"
    vocabulary.save(str(path))
    context = multiprocessing.get_context("spawn")
    queue = context.Queue()
    process = context.Process(target=tell_permissions, args=(str(path), queue))
    process.start()
    permissions = queue.get(timeout=60)
    process.join()
    assert permissions == "r--s"


# ---- the one of the package ----------------------------------------------------------------------
def test_default_vocabulary_is_small_and_sound():
    facts = vocabulary_info()
    assert facts.path == default_vocabulary_path()
    assert facts.size <= 7_000_000
    assert (facts.branching, facts.depth) == (10, 5)
    assert facts.n_words > 50_000
    assert "BSD-3-Clause" in facts.comment

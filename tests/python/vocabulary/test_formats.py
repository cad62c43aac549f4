# SPDX-License-Identifier: BSD-3-Clause
"""Vocabularies in every format, read and written."""

from __future__ import annotations

import gzip

import numpy as np
import pytest

from orbslam2py import _core as core
from orbslam2py.vocabulary import (
    VocabularyFormat,
    convert_vocabulary,
    load_vocabulary,
    save_vocabulary,
    vocabulary_info,
)
from support.vocabularies import TEXT, packed, to_yaml


def test_trailing_newline_makes_no_extra_word(vocabulary, text):
    """The original reads one line too many, and makes a word of it (OD-39)."""
    assert (vocabulary.n_words, vocabulary.n_nodes) == (1000, 1111)
    text.write_bytes(text.read_bytes().rstrip(b"\n"))
    assert load_vocabulary(text, cache=False).hash == vocabulary.hash


@pytest.mark.parametrize("file_format", list(VocabularyFormat))
def test_every_format_is_told_by_its_content(vocabulary, tmp_path, file_format):
    path = tmp_path / "anything.dat"
    if file_format is VocabularyFormat.BINARY:
        vocabulary.save(str(path))
    else:
        data = TEXT.read_bytes()
        path.write_bytes(
            {
                VocabularyFormat.TEXT: data,
                VocabularyFormat.GZIP: gzip.compress(data),
                VocabularyFormat.TAR: packed(data),
                VocabularyFormat.YAML: to_yaml(vocabulary).encode(),
            }[file_format]
        )
    assert load_vocabulary(path, cache=False).hash == vocabulary.hash
    assert vocabulary_info(path).format is file_format


@pytest.mark.parametrize("name", ["v.bvoc", "v.txt", "v.txt.gz"])
def test_round_trip_through_every_writer(vocabulary, tmp_path, name):
    reports: list[float] = []
    convert_vocabulary(TEXT, tmp_path / name, progress=reports.append)
    assert reports == sorted(reports)
    assert reports[-1] == 1.0
    assert load_vocabulary(tmp_path / name, cache=False).hash == vocabulary.hash
    assert [p.name for p in tmp_path.iterdir()] == [name]


def test_weights_survive_text_exactly(tmp_path):
    weights = np.array([0.1, 1 / 3, np.pi, 1e-300, 5e-324, 123456789.123456789, 0.0, 2.0**60])
    rng = np.random.default_rng(0)
    centres = rng.integers(0, 256, (8, 32), np.uint8)
    parents, words = np.zeros(8, np.uint32), np.ones(8, np.uint8)
    built = core.Vocabulary.from_table(
        10, 1, core.Scoring.L1, core.Weighting.TF_IDF, parents, words, centres, weights
    )
    save_vocabulary(built, tmp_path / "w.txt")
    again = load_vocabulary(tmp_path / "w.txt", cache=False)
    np.testing.assert_array_equal(again.table()[3], weights)
    np.testing.assert_array_equal(again.table()[2], centres)


def test_white_space_is_free(vocabulary, text):
    lines = text.read_text().splitlines()
    loose = [f"\t{line.replace(' ', '   ')} \r" for line in lines]
    loose[5:5] = ["", "  \t "]
    text.write_text("\n".join(loose) + "\n\n\n")
    assert load_vocabulary(text, cache=False).hash == vocabulary.hash

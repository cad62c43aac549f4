# SPDX-License-Identifier: BSD-3-Clause
"""Words of descriptors, against arrays of the reference."""

from __future__ import annotations

import numpy as np
import pytest

from orbslam2py import VocabularyError, load_vocabulary
from orbslam2py import _core as core
from support.vocabularies import TEXT, golden


@pytest.fixture(scope="module")
def vocabulary():
    return load_vocabulary(TEXT, cache=False)


@pytest.mark.parametrize("image", [0, 1])
def test_words_and_direct_index_are_the_references(vocabulary, image):
    words, nodes, weights = vocabulary.quantise(golden(f"desc{image}"))
    np.testing.assert_array_equal(words, golden(f"out{image}_feat_word"))
    np.testing.assert_array_equal(nodes, golden(f"out{image}_feat_node_up1"))
    np.testing.assert_allclose(weights, golden(f"out{image}_feat_weight"), atol=1e-6)
    bag, index = vocabulary.transform(golden(f"desc{image}"))
    np.testing.assert_array_equal(bag.words, golden(f"out{image}_bow_word"))
    np.testing.assert_allclose(bag.weights, golden(f"out{image}_bow_weight"), atol=1e-6)
    np.testing.assert_array_equal(index.nodes, golden(f"out{image}_fv_up1_node"))
    np.testing.assert_array_equal(index.offsets, golden(f"out{image}_fv_up1_offset"))
    np.testing.assert_array_equal(index.indices, golden(f"out{image}_fv_up1_index"))


def test_scores_are_the_references(vocabulary):
    bags = [vocabulary.transform(golden(f"desc{i}"))[0] for i in (0, 1)]
    scores = [core.similarity(bags[i], bags[j]) for i, j in ((0, 1), (0, 0), (1, 1))]
    np.testing.assert_allclose(scores, golden("out_score"), atol=1e-6)


@pytest.mark.parametrize("bad", [np.zeros((3, 31), np.uint8), np.zeros(32, np.uint8)])
def test_descriptors_of_another_shape_are_refused(vocabulary, bad):
    with pytest.raises(VocabularyError, match=r"\(n, 32\)"):
        vocabulary.transform(bad)


def test_no_descriptors_give_an_empty_bag(vocabulary):
    bag, index = vocabulary.transform(np.empty((0, 32), np.uint8))
    assert len(bag) == 0
    assert index.offsets.tolist() == [0]

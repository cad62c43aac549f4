# SPDX-License-Identifier: BSD-3-Clause
"""Visual words in map files: taken over if they are those of the vocabulary, found again if not."""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
from pathlib import Path

import numpy as np
import pytest

from orbslam2py import MapFileError, Sensor, System, TrackingState, load_vocabulary, optimize_map
from orbslam2py import _core as core
from orbslam2py.maps import (
    MapFile,
    SavedMap,
    VocabularyIdentity,
    keep_keyframes,
    load_map,
    restore_contents,
    save_map,
    take_contents,
)
from orbslam2py.maps.map_rows import all_rows, keypoint_rows
from orbslam2py.maps.map_writer import MapWriter
from support import small_sequences
from support.saved_maps import edit, small_map, written, written_as_version

#: A feature of a stopped word.
STOPPED = 2**32 - 1


def _poses_in(loaded: SavedMap | MapFile | Path) -> np.ndarray:
    """Where the first frames are found to be."""
    with System(load_map=loaded, deterministic=True) as slam:
        slam.localization_mode = True
        records = small_sequences.play(slam, 12)
        assert records[-1].state is TrackingState.OK
    return np.array([record.T_wc for record in records if record.T_wc is not None])


def _spoilt(saved: SavedMap, word: int) -> SavedMap:
    words = saved.contents.keyframes.words.copy()
    words[7] = word
    keyframes = dataclasses.replace(saved.contents.keyframes, words=words)
    contents = dataclasses.replace(saved.contents, keyframes=keyframes)
    return dataclasses.replace(saved, contents=contents)


def test_a_map_knows_the_words_of_its_features() -> None:
    keyframes = small_map().contents.keyframes
    words, _, weights = load_vocabulary().quantise(keyframes.descriptors)
    assert np.array_equal(keyframes.words, np.where(weights > 0, words, STOPPED))


def test_a_keyframe_that_was_saved_before_it_had_words(tmp_path: Path) -> None:
    """As one that nobody has described yet, in a file that is kept up to date."""
    saved, path = small_map(), tmp_path / "map.orbmap"
    contents, late = saved.contents, int(saved.contents.keyframes.ids[3])
    keyframes = dataclasses.replace(contents.keyframes, words=np.zeros(0, np.uint32))
    bare = dataclasses.replace(contents, keyframes=keyframes)
    with contextlib.closing(MapWriter(path)) as writer:
        rows = [row for row in all_rows(saved) if row[0] != "keypoints" or row[1][0] != late]
        writer.commit([*rows, *keypoint_rows(bare, [3])])
    loaded = load_map(path)
    assert loaded.contents.keyframes.words.size == 0
    assert bare.first_difference(loaded.contents) is None
    slam_map, vocabulary = core.Map(), load_vocabulary()
    MapFile(path).restore(slam_map, vocabulary, core.KeyFrameIndex())
    words = take_contents(slam_map).keyframes.words
    assert np.array_equal(words, contents.keyframes.words)


def test_known_words_and_words_found_again_are_the_same() -> None:
    contents, vocabulary = small_map().contents, load_vocabulary()
    for words_fit in (False, True):
        restored = restore_contents(contents, None, vocabulary, words_fit=words_fit)
        assert core.check_invariants(restored, require_words=True) == []
        assert np.array_equal(take_contents(restored).keyframes.words, contents.keyframes.words)
    assert not len(take_contents(restore_contents(contents)).keyframes.words)


def test_known_words_are_not_searched_again() -> None:
    # What shows it: words that the vocabulary would not have found.
    contents = _spoilt(small_map(), 5).contents
    restored = restore_contents(contents, None, load_vocabulary(), words_fit=True)
    assert take_contents(restored).keyframes.words[7] == 5


@pytest.mark.parametrize("version", [1, 2, 3, 4, 5])
def test_a_map_of_an_earlier_version_is_used_like_any(tmp_path: Path, version: int) -> None:
    old, new = written_as_version(version, tmp_path), written(tmp_path)
    saved = load_map(old)
    assert bool(len(saved.contents.keyframes.words)) == (version > 1)
    assert saved.contents.cameras.distortion.tolist() == [[0.0] * 8]
    assert small_map().contents.without_patches().first_difference(saved.contents) is None
    save_map(small_map(), new, patches=False)
    assert np.array_equal(_poses_in(old), _poses_in(new))
    save_map(saved, tmp_path / "again.orbmap")
    assert np.array_equal(_poses_in(tmp_path / "again.orbmap"), _poses_in(new))


def test_a_file_and_its_copy_in_memory_make_the_same_map(tmp_path: Path) -> None:
    path = written(tmp_path)
    file = MapFile(path)
    saved = load_map(path)
    assert (file.n_keyframes, file.n_points) == (saved.n_keyframes, saved.n_points)
    assert (file.settings, file.vocabulary) == (saved.settings, saved.vocabulary)
    assert [run.seed for run in file.runs] == [run.seed for run in saved.runs]
    maps = core.Map(), core.Map()
    file.restore(maps[0])
    saved.restore(maps[1])
    assert take_contents(maps[0]).first_difference(take_contents(maps[1])) is None
    assert np.array_equal(_poses_in(file), _poses_in(saved))


def test_words_of_another_vocabulary_are_not_taken_over(tmp_path: Path) -> None:
    other = dataclasses.replace(
        _spoilt(small_map(), 5), vocabulary=VocabularyIdentity("other.bvoc", "0" * 64)
    )
    path = tmp_path / "other.orbmap"
    save_map(other, path)
    with pytest.raises(MapFileError, match="the vocabulary other"):
        System(load_map=path)
    with System(load_map=path, allow_other_setup=True) as slam:
        found = slam.map_contents().keyframes.words
    assert np.array_equal(found, small_map().contents.keyframes.words)


def test_a_word_that_there_is_not_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "spoilt.orbmap"
    save_map(_spoilt(small_map(), 10**9), path)
    with pytest.raises(MapFileError, match="keyframe 0 has a word that the vocabulary") as caught:
        System(load_map=path)
    assert str(caught.value).startswith(f"{path}: ")


def test_a_file_that_changed_since_it_was_opened_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path)
    file = MapFile(path)
    edit(path, "UPDATE keyframes SET timestamp = timestamp + 1")
    with pytest.raises(MapFileError, match="was changed since it was opened; open it") as caught:
        file.restore(core.Map())
    assert "damaged" not in str(caught.value)


def test_a_vocabulary_is_known_by_the_sha256_of_its_content() -> None:
    vocabulary = load_vocabulary()
    identity = VocabularyIdentity.of(vocabulary, "own")
    assert len(identity.hash) == 2 * hashlib.sha256().digest_size
    assert identity.is_of(vocabulary)
    parents, is_word, centres, weights = vocabulary.table()
    table = (10, 5, vocabulary.scoring, vocabulary.weighting, parents, is_word)
    same = core.Vocabulary.from_table(*table, centres, weights)
    assert identity.is_of(same)
    weights[-1] += 1e-9
    assert not identity.is_of(core.Vocabulary.from_table(*table, centres, weights))
    assert VocabularyIdentity("", f"{vocabulary.hash:016x}").is_of(vocabulary)
    assert not VocabularyIdentity("", "0123456789abcdef").is_of(vocabulary)
    assert small_map(Sensor.RGBD).vocabulary.hash == identity.hash


def test_edits_of_a_map_keep_the_words() -> None:
    contents = small_map().contents
    refined, _ = optimize_map(contents)
    assert np.array_equal(refined.keyframes.words, contents.keyframes.words)
    kept = np.ones(len(contents.keyframes), bool)
    kept[-1] = False
    cropped = keep_keyframes(contents, kept)
    last = contents.keyframes.keypoints_of(len(kept) - 1)
    assert np.array_equal(cropped.keyframes.words, contents.keyframes.words[: last.start])

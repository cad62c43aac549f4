# SPDX-License-Identifier: BSD-3-Clause
"""Vocabularies in every format, broken in many ways, trained and cached."""

from __future__ import annotations

import gzip
import io
import multiprocessing
import os
import random
import sys
import tarfile
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from orbslam2py import _core as core
from orbslam2py.errors import ImageError, SettingsError, VocabularyError
from orbslam2py.vocabulary.vocabulary import (
    ENVIRONMENT_VARIABLE,
    VocabularyFormat,
    convert_vocabulary,
    default_vocabulary_path,
    load_vocabulary,
    read_training_images,
    save_vocabulary,
    train_vocabulary,
    vocabulary_info,
)
from support.data import GOLDEN
from support.file_mapping import tell_permissions

BOW = GOLDEN / "bow"
TEXT = BOW / "voc_small_k10L3.txt"


def golden(name: str) -> np.ndarray:
    return np.load(BOW / f"{name}.npy")


@pytest.fixture(autouse=True)
def private_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv(ENVIRONMENT_VARIABLE, raising=False)


@pytest.fixture(scope="module")
def vocabulary():
    return load_vocabulary(TEXT, cache=False)


@pytest.fixture
def text(tmp_path) -> Path:
    """A copy of the golden file in a folder of its own."""
    path = tmp_path / "words.txt"
    path.write_bytes(TEXT.read_bytes())
    return path


def with_line(path: Path, number: int, line: str | None) -> Path:
    """Replace a line (1 = the header), or drop it."""
    lines = path.read_text().splitlines()
    lines[number - 1 : number] = [] if line is None else line.split("\n")
    path.write_text("\n".join(lines) + "\n")
    return path


def error_of(path: Path) -> str:
    with pytest.raises(VocabularyError) as caught:
        load_vocabulary(path, cache=False)
    message = str(caught.value)
    assert str(path) in message
    return message


# ---- parity --------------------------------------------------------------------------------------
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


def test_trailing_newline_makes_no_extra_word(vocabulary, text):  # D11-1
    assert (vocabulary.n_words, vocabulary.n_nodes) == (1000, 1111)
    text.write_bytes(text.read_bytes().rstrip(b"\n"))
    assert load_vocabulary(text, cache=False).hash == vocabulary.hash


@pytest.mark.parametrize("bad", [np.zeros((3, 31), np.uint8), np.zeros(32, np.uint8)])
def test_descriptors_of_another_shape_are_refused(vocabulary, bad):
    with pytest.raises(VocabularyError, match=r"\(n, 32\)"):
        vocabulary.transform(bad)


def test_no_descriptors_give_an_empty_bag(vocabulary):
    bag, index = vocabulary.transform(np.empty((0, 32), np.uint8))
    assert len(bag) == 0
    assert index.offsets.tolist() == [0]


# ---- formats -------------------------------------------------------------------------------------
def to_yaml(vocabulary: core.Vocabulary) -> str:
    parents, is_word, centres, weights = vocabulary.table()
    lines = ["%YAML:1.0", "---", "vocabulary:", "   k: 10", "   L: 3", "   scoringType: 0"]
    lines += ["   weightingType: 0", "   nodes:"]
    order = list(range(len(parents)))
    random.Random(3).shuffle(order)
    for row in order:
        numbers = f"nodeId:{row + 1}, parentId:{parents[row]}, weight:{float(weights[row])!r}"
        centre = " ".join(map(str, centres[row]))
        lines += [f"      - {{ {numbers},", f'          descriptor:"{centre} " }}']
    lines.append("   words:")
    for word, row in enumerate(np.flatnonzero(is_word)):
        lines.append(f"      - {{ wordId:{word}, nodeId:{row + 1} }}")
    return "\n".join(lines) + "\n"


def packed(data: bytes) -> bytes:
    stream = io.BytesIO()
    with tarfile.open(fileobj=stream, mode="w:gz") as archive:
        folder = tarfile.TarInfo("Vocabulary")
        folder.type = tarfile.DIRTYPE
        archive.addfile(folder)
        member = tarfile.TarInfo("Vocabulary/words.txt")
        member.size = len(data)
        archive.addfile(member, io.BytesIO(data))
    return stream.getvalue()


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


# ---- broken text ---------------------------------------------------------------------------------
@pytest.mark.parametrize("header", ["1 3 0 0", "0 3 0 0", "21 3 0 0", "10 0 0 0", "10 11 0 0"])
def test_header_out_of_range(text, header):  # D11-10
    assert "line 1: not a vocabulary file" in error_of(with_line(text, 1, header))


@pytest.mark.parametrize(
    "header", ["10 3 0", "10 3 0 0 0", "10 3 6 0", "10 3 0 4", "a b c d", "-1 3 0 0"]
)
def test_header_malformed(text, header):
    assert str(text) in error_of(with_line(text, 1, header))


def test_other_scorings_are_refused_by_name(text):
    assert "scoring type 1 is not supported" in error_of(with_line(text, 1, "10 3 1 0"))


BYTES = " ".join(["7"] * 32)


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        (f"0 0 {BYTES}", "34 fields, expected 35"),
        (f"0 0 {BYTES} 0 0", "36 fields"),
        (f"0 2 {BYTES} 0", "second field"),
        (f"-1 0 {BYTES} 0", "parent is not a node number"),
        (f"0 0 256 {BYTES[2:]} 0", "'256' is not a descriptor byte"),
        (f"0 0 -1 {BYTES[2:]} 0", "'-1' is not a descriptor byte"),
        (f"0 0 {BYTES} x", "'x' is not a weight"),
        (f"0 0 {BYTES} 1.0x", "'1.0x' is not a weight"),
        (f"0 0 {BYTES} nan", "negative or not finite"),
        (f"0 0 {BYTES} 1e999", "negative or not finite"),
        (f"0 0 {BYTES} -1", "negative or not finite"),
        (f"5 0 {BYTES} 0", "parent 5 is not listed before"),
        (f"99999999999 0 {BYTES} 0", "parent is not a node number"),
        (f"0 1 {BYTES} 0", "marked as a word"),
    ],
)
def test_first_bad_line_is_named(text, line, reason):
    message = error_of(with_line(text, 5, line))
    assert reason in message
    # A word with children is noticed at the first child.
    assert "line 5:" in message or "marked as a word" in message


def test_line_numbers_count_empty_lines(text):
    with_line(text, 3, "\n\n" + text.read_text().splitlines()[2])
    assert "line 7: its parent 900" in error_of(with_line(text, 7, f"900 0 {BYTES} 0"))
    assert "line 7: 1 fields" in error_of(with_line(text, 7, "3"))


def test_structure_is_checked(text):
    lines = text.read_text().splitlines()
    child = f"0 1 {BYTES} 0"
    assert "more than 10 children" in error_of(with_line(text, len(lines), f"{lines[-1]}\n{child}"))
    text.write_text(f"10 3 0 0\n0 0 {BYTES} 0\n0 1 {BYTES} 0\n")
    assert "line 2: it has no children" in error_of(text)
    text.write_text("10 1 0 0\n" + f"0 0 {BYTES} 0\n1 1 {BYTES} 0\n")
    assert "line 3: it lies deeper than 1 levels" in error_of(text)
    text.write_text("10 1 0 0\n")
    assert "no words" in error_of(text)


@pytest.mark.parametrize(
    "content",
    [b"", b"hello", b"\0" * 1000, b"%PDF-1.4", b"1" * 3_000_000, b"10 3 0 0\n" + b"1" * 3_000_000],
)
def test_other_files_are_refused(tmp_path, content):
    path = tmp_path / "some.file"
    path.write_bytes(content)
    error_of(path)


def test_missing_file_and_folder_are_named(tmp_path):  # D11-3
    assert "No such file" in error_of(tmp_path / "nothing.txt")
    error_of(tmp_path)


def test_damaged_archives_are_named(tmp_path):
    path = tmp_path / "v.gz"
    for data in (gzip.compress(TEXT.read_bytes()), packed(TEXT.read_bytes())):
        for size in (len(data) // 2, len(data) - 4, 30, 3):
            path.write_bytes(data[:size])
            error_of(path)
        path.write_bytes(data[:3000] + b"\xff" * 50 + data[3050:])
        error_of(path)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("nodeId:7,", "nodeId:8,"),
        ("nodeId:7,", "nodeId:5000,"),
        ("nodeId:7,", "number:7,"),
        ("wordId:3,", "wordId:4,"),
        ("   words:", "   other:"),
        ("   k: 10", "   j: 10"),
        ("weight:0.0,", "weight:zero,"),
        ('descriptor:"', 'descriptor:"300 '),
    ],
)
def test_broken_yaml_is_refused(vocabulary, tmp_path, old, new):
    path = tmp_path / "v.yml"
    text = to_yaml(vocabulary)
    assert old in text
    path.write_text(text.replace(old, new, 1))
    error_of(path)


# ---- fuzz ----------------------------------------------------------------------------------------
FUZZ = settings(
    max_examples=150,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
    deadline=None,
    derandomize=True,
)


@st.composite
def damaged(draw, data: bytes) -> bytes:
    kind = draw(st.sampled_from(["cut", "flip", "replace", "noise"]))
    at = draw(st.integers(0, len(data) - 1))
    if kind == "cut":
        return data[:at]
    if kind == "flip":
        return data[:at] + bytes([data[at] ^ (1 << draw(st.integers(0, 7)))]) + data[at + 1 :]
    junk = draw(st.binary(max_size=300))
    return data[:at] + junk + data[at + len(junk) :] if kind == "replace" else data[:4] + junk


@settings(
    max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None
)
@given(choice=st.data())
def test_damaged_binary_files_never_load_as_something_else(vocabulary, tmp_path, choice):
    path = tmp_path / "v.bvoc"
    vocabulary.save(str(path))
    good = path.read_bytes()
    data = choice.draw(damaged(good))
    path.write_bytes(data)
    if data == good:
        assert load_vocabulary(path).hash == vocabulary.hash
        return
    with pytest.raises(VocabularyError):
        load_vocabulary(path, cache=False)


@settings(
    max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None
)
@given(choice=st.data())
def test_damaged_text_files_load_whole_or_not_at_all(vocabulary, tmp_path, choice):
    path = tmp_path / "v.txt"
    path.write_bytes(choice.draw(damaged(TEXT.read_bytes())))
    try:
        loaded = load_vocabulary(path, cache=False)
    except VocabularyError:
        return
    bag, _ = loaded.transform(golden("desc0"))
    assert np.isfinite(bag.weights).all()


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


# ---- training ------------------------------------------------------------------------------------
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
    with pytest.raises(VocabularyError, match="no images"):
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


# ---- the one of the package ----------------------------------------------------------------------
def test_default_vocabulary_is_small_and_sound():
    facts = vocabulary_info()
    assert facts.path == default_vocabulary_path()
    assert facts.size <= 7_000_000
    assert (facts.branching, facts.depth) == (10, 5)
    assert facts.n_words > 50_000
    assert "BSD-3-Clause" in facts.comment

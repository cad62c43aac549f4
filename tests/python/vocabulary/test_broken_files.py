# SPDX-License-Identifier: BSD-3-Clause
"""Vocabulary files broken in many ways."""

from __future__ import annotations

import gzip

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from orbslam2py import VocabularyError
from orbslam2py.vocabulary import load_vocabulary
from support.vocabularies import BYTES, TEXT, error_of, golden, packed, to_yaml, with_line


# ---- broken text ---------------------------------------------------------------------------------
@pytest.mark.parametrize("header", ["1 3 0 0", "0 3 0 0", "21 3 0 0", "10 0 0 0", "10 11 0 0"])
def test_header_out_of_range(text, header):
    """With less than two branches the original divides by zero (OD-41)."""
    assert "line 1: not a vocabulary file" in error_of(with_line(text, 1, header))


@pytest.mark.parametrize(
    "header", ["10 3 0", "10 3 0 0 0", "10 3 6 0", "10 3 0 4", "a b c d", "-1 3 0 0"]
)
def test_header_malformed(text, header):
    assert str(text) in error_of(with_line(text, 1, header))


def test_other_scorings_are_refused_by_name(text):
    assert "scoring type 1 is not supported" in error_of(with_line(text, 1, "10 3 1 0"))


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


def test_missing_file_and_folder_are_named(tmp_path):
    """The original reads on in a file that it could not open (OD-40)."""
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
    max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None
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


@FUZZ
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


@FUZZ
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

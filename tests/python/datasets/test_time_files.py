# SPDX-License-Identifier: BSD-3-Clause
"""Files of time stamps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from orbslam2py import DatasetError
from orbslam2py.datasets.time_files import read_time_file


def times_file(tmp_path: Path, *lines: str) -> Path:
    path = tmp_path / "times.txt"
    path.write_text("\n".join(lines) + "\n")
    return path


def test_times_keep_their_text(tmp_path: Path) -> None:
    stamps = read_time_file(times_file(tmp_path, "1.50", "", "2.25000001"), 2)
    assert stamps.texts == ("1.50", "2.25000001")
    np.testing.assert_array_equal(stamps.seconds, [1.5, 2.25000001])


def test_whole_numbers_are_nanoseconds_if_seconds_make_no_sense(tmp_path: Path) -> None:
    stamps = read_time_file(times_file(tmp_path, "1403636579763555584", "1403636579813555456"), 2)
    assert stamps.texts == ("1403636579.763555584", "1403636579.813555456")
    assert stamps.seconds[1] - stamps.seconds[0] == pytest.approx(0.05, abs=1e-6)
    assert read_time_file(times_file(tmp_path, "0", "33000000"), 2).texts[1] == "0.033000000"
    assert read_time_file(times_file(tmp_path, "0", "1", "2"), 3).seconds.tolist() == [0, 1, 2]


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (["1", "2"], "holds 2 time stamps, but there are 3 images"),
        (["1", "2", "3", "4"], "holds 4 time stamps, but there are 3 images"),
        (["1.0", "2.0", "2.0"], r"times\.txt:3: time stamp 2\.0 is not after"),
        (["1.0", "x", "2.0"], r"times\.txt:2: 'x' is not a number"),
        (["1.0", "nan", "2.0"], r"times\.txt:2: nan is not finite"),
        (["1.0 a.png", "2", "3"], r"times\.txt:1: expected one time stamp, .*found 2"),
    ],
)
def test_bad_times(tmp_path: Path, lines: list[str], message: str) -> None:
    with pytest.raises(DatasetError, match=message):
        read_time_file(times_file(tmp_path, *lines), 3)


NAMES = ["a.png", "b.png", "c.png"]


@pytest.mark.parametrize(
    "lines",
    [
        ["# time filename", "1.50 rgb/a.png", "2.0 rgb/b.png", "2.50 rgb/c.png"],
        ["1.50 rgb/a.png 1.51 d/1.png", "2.0 rgb/b.png 2.01 d/2.png", "2.50 c.png 2.52 d/3.png"],
        ["#timestamp [ns],filename", "1.50,a.png", "2.0,b.png", "2.50,c.png"],
        ["0.5 0.png", "2.50 c.png", "1.50 a.png", "2.0 b.png", "9.9 d.png"],
    ],
)
def test_times_in_lists_of_images(tmp_path: Path, lines: list[str]) -> None:
    stamps = read_time_file(times_file(tmp_path, *lines), 3, NAMES)
    assert stamps.texts == ("1.50", "2.0", "2.50")
    np.testing.assert_array_equal(stamps.seconds, [1.5, 2.0, 2.5])


def test_times_of_euroc_in_a_list(tmp_path: Path) -> None:
    lines = ["1403636579763555584,a.png", "1403636579813555456,b.png"]
    stamps = read_time_file(times_file(tmp_path, *lines), 2, NAMES[:2])
    assert stamps.texts == ("1403636579.763555584", "1403636579.813555456")


def test_list_for_images_without_names(tmp_path: Path) -> None:
    path = times_file(tmp_path, "1.5 a.png", "2.5 b.png")
    assert read_time_file(path, 2).texts == ("1.5", "2.5")
    with pytest.raises(DatasetError, match="holds 2 time stamps, but there are 3 images; give"):
        read_time_file(path, 3)


def test_list_of_other_images(tmp_path: Path) -> None:
    path = times_file(tmp_path, "1.5 a.png", "2.5 x.png", "3.5 c.png")
    with pytest.raises(DatasetError, match=r"no time stamp for 1 of 3 images, the first is b\.png"):
        read_time_file(path, 3, NAMES)


def test_missing_times(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match=r"cannot open .*times\.txt"):
        read_time_file(tmp_path / "times.txt", 3)


@pytest.mark.parametrize(
    ("line", "text"),
    [
        ("1403636579763555584", "1403636579.763555584"),
        ("1403636579763555584 a.png", "1403636579.763555584"),
        ("1403636579", "1403636579"),
        ("33000000", "33000000"),
        ("1403636579.5", "1403636579.5"),
    ],
)
def test_a_single_time(tmp_path: Path, line: str, text: str) -> None:
    """A step that is too long for seconds needs two; a year that is too late does not."""
    stamps = read_time_file(times_file(tmp_path, line), 1, NAMES[:1])
    assert stamps.texts == (text,)
    assert stamps.seconds.tolist() == pytest.approx([float(text)], abs=3e-7)


def test_nanoseconds_that_lie_close_together(tmp_path: Path) -> None:
    path = times_file(tmp_path, "1403636579763555584", "1403636579763605584", "1403636579763655584")
    assert read_time_file(path, 3).texts[1] == "1403636579.763605584"

# SPDX-License-Identifier: BSD-3-Clause
"""Lists of times, and the table of a run's frames."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from orbslam2py import DatasetError
from orbslam2py.trajectory import read_frame_table, read_times


@pytest.mark.parametrize(
    ("lines", "seconds"),
    [
        (["1403636579763555584"], [1403636579.763555584]),
        (["1403636579763555584", "1403636579763555684"], [1403636579.7635556] * 2),
        (["1403636579763555584", "1403636579813555456"], [1403636579.7635556, 1403636579.8135555]),
        (["0", "33000000", "66000000"], [0, 0.033, 0.066]),
        (["1403636579"], [1403636579]),
        (["33000000"], [33000000]),
        (["0", "1", "2"], [0, 1, 2]),
        (["1403636579.5"], [1403636579.5]),
    ],
)
def test_whole_numbers_are_nanoseconds_if_seconds_make_no_sense(
    tmp_path: Path, lines: list[str], seconds: list[float]
) -> None:
    (tmp_path / "t.txt").write_text("\n".join(lines) + "\n")
    np.testing.assert_allclose(read_times(tmp_path / "t.txt"), seconds, rtol=0, atol=3e-7)


def test_bad_lists_name_the_line(tmp_path: Path) -> None:
    path = tmp_path / "t.txt"
    path.write_text("# when\n1.0 a.png\n")
    with pytest.raises(DatasetError, match=r"t\.txt:2: expected one time stamp, found 2 fields"):
        read_times(path)
    path.write_text("1403636579813555456\n1403636579763555584\n")
    with pytest.raises(DatasetError, match=r"t\.txt:2: the time stamp is before the one above it"):
        read_times(path)


def test_a_table_with_a_name_that_is_no_utf_8(tmp_path: Path) -> None:
    """Reasons hold names of files, byte by byte."""
    path = tmp_path / "frames.csv"
    path.write_bytes(
        b"index,timestamp,map,state,reason\n0,0.5,0,OK,\n"
        b'1,1.5,,SKIPPED,"caf\xe9.png is no readable image"\n'
    )
    table = read_frame_table(path)
    assert table.indices.tolist() == [0, 1]
    assert table.has_pose.tolist() == [True, False]

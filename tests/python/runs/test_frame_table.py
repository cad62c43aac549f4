# SPDX-License-Identifier: BSD-3-Clause
"""What frames.csv says about the certainty of a pose."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from orbslam2py import DatasetError
from orbslam2py.runs.frame_table import pose_deviation, write_frames
from orbslam2py.runs.report_page.run_folder import read_frames
from orbslam2py.trajectory import read_frame_table
from support.made_up_rows import rows_of

pytestmark = pytest.mark.watchdog(20)


def test_standard_deviation_in_metres_and_degrees(tmp_path: Path) -> None:
    ok, lost = rows_of("kr")
    assert ok.record is not None
    degrees = np.radians(np.array([0.1, 0.2, 0.2]))
    covariance = np.diag(np.concatenate([degrees, [0.03, 0.0, 0.04]]) ** 2)
    known = replace(ok.record, covariance=covariance, visual_odometry=True)
    assert pose_deviation(known) == pytest.approx((0.05, 0.3))
    for unknown in (np.full((6, 6), np.nan), -np.eye(6), None):
        assert pose_deviation(replace(known, covariance=unknown)) is None
    write_frames(tmp_path / "f.csv", [replace(ok, record=known), ok, lost, *rows_of("s")])
    with (tmp_path / "f.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    names = ("std_position", "std_angle", "visual_odometry")
    assert [rows[0][name] for name in names] == ["0.050000000", "0.300000000", "1"]
    assert [rows[1][name] for name in names] == ["", "", "0"]
    assert [rows[2][name] for name in names] == ["", "", ""]
    assert [rows[3][name] for name in names] == ["", "", ""]


def test_turning_the_world_does_not_change_it() -> None:
    """The translation of a perturbation on the left, turned into the world, moves the centre."""
    rng = np.random.default_rng(3)
    R = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    R *= np.sign(np.linalg.det(R))
    t, A = rng.normal(size=3), 1e-4 * rng.normal(size=(6, 6))
    w, v = (A @ rng.normal(size=(6, 40_000))).T.reshape(-1, 2, 3).swapaxes(0, 1)
    zero = np.zeros(len(w))
    skew = np.array(
        [[zero, -w[:, 2], w[:, 1]], [w[:, 2], zero, -w[:, 0]], [-w[:, 1], w[:, 0], zero]]
    )
    turned = (np.eye(3) + skew.transpose(2, 0, 1)) @ R
    centres = -np.einsum("nji,nj->ni", turned, t + np.cross(w, t) + v)
    measured = np.sqrt(np.var(centres, axis=0).sum())
    (row,) = rows_of("k")
    assert row.record is not None
    deviation = pose_deviation(replace(row.record, covariance=A @ A.T))
    assert deviation is not None
    assert deviation[0] == pytest.approx(measured, rel=0.02)


def test_what_speaks_for_a_pose(tmp_path: Path) -> None:
    weak, untold = rows_of("wk")
    write_frames(tmp_path / "f.csv", [weak, untold])
    with (tmp_path / "f.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    names = ("evidence", "method", "found")
    assert [rows[0][name] for name in names] == ["weak", "aligned images", "0.125"]
    assert [rows[1][name] for name in names] == ["", "", ""]
    frames = read_frames(tmp_path / "f.csv")
    assert frames.is_weak.tolist() == [True, False]
    np.testing.assert_array_equal(frames.found, [0.125, np.nan])


def test_a_table_of_an_earlier_version_says_nothing_of_it(tmp_path: Path) -> None:
    write_frames(tmp_path / "f.csv", rows_of("wk"))
    with (tmp_path / "f.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    kept = [name for name in rows[0] if name not in ("evidence", "method", "found")]
    with (tmp_path / "f.csv").open("w", newline="") as stream:
        writer = csv.DictWriter(stream, kept, extrasaction="ignore")
        writer.writeheader()
        writer.writerows(rows)
    frames = read_frames(tmp_path / "f.csv")
    assert not frames.is_weak.any()
    assert np.isnan(frames.found).all()


def test_a_reason_with_a_name_that_is_no_utf_8(tmp_path: Path) -> None:
    """The table keeps the bytes of the name; who reads it is not stopped by them."""
    tracked, skipped = rows_of("ks")
    skipped = replace(skipped, reason="im/caf\udce9.png is no readable image")
    write_frames(tmp_path / "f.csv", [tracked, skipped])
    assert b"im/caf\xe9.png is no" in (tmp_path / "f.csv").read_bytes()
    assert len(read_frame_table(tmp_path / "f.csv")) == 2
    # A page may hold no half of a letter.
    assert read_frames(tmp_path / "f.csv").reason[1] == "im/caf\ufffd.png is no readable image"


def test_a_field_that_no_table_has(tmp_path: Path) -> None:
    write_frames(tmp_path / "f.csv", rows_of("k"))
    with (tmp_path / "f.csv").open("a") as stream:
        stream.write("1,2,0,OK," + "x" * 200_000 + "\n")
    with pytest.raises(DatasetError, match=r"f\.csv is no whole table of frames"):
        read_frames(tmp_path / "f.csv")

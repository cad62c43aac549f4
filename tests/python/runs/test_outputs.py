# SPDX-License-Identifier: BSD-3-Clause
"""Folders and files of a run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orbslam2py import DatasetError, run_sequence
from orbslam2py.runs import RunOptions, SystemOptions, run_picture
from orbslam2py.runs.outputs import (
    link_latest,
    mark_as_begun,
    prepare_output_folder,
    remove_earlier_results,
    write_ply,
)
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from support.files import names_in
from support.made_up_runs import made_up_run

pytestmark = pytest.mark.watchdog(20)


def test_output_folder_is_made_with_its_parents(tmp_path: Path) -> None:
    folder = prepare_output_folder(tmp_path / "a" / "b", force=False)
    assert folder.is_dir()
    assert list(folder.iterdir()) == []
    assert prepare_output_folder(folder, force=False) == folder, "empty: taken"
    (folder / "x").touch()
    with pytest.raises(DatasetError, match="not empty"):
        prepare_output_folder(folder, force=False)
    assert prepare_output_folder(folder, force=True) == folder


def test_link_to_the_latest_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("first", "second"):
        folder = Path("runs") / name
        folder.mkdir(parents=True)
        link_latest(folder)
        assert Path("runs/latest").readlink() == Path(name)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    link_latest(elsewhere)
    assert Path("runs/latest").readlink() == Path("second")
    assert names_in(Path("runs")) == ["first", "latest", "second"]


def test_a_real_folder_called_latest_is_left_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "runs" / "latest").mkdir(parents=True)
    (tmp_path / "runs" / "one").mkdir()
    link_latest(Path("runs/one"))
    assert not Path("runs/latest").is_symlink()
    assert names_in(Path("runs")) == ["latest", "one"], "nothing else is left behind"


@pytest.mark.parametrize("n", [0, 1, 1000])
def test_ply(tmp_path: Path, n: int) -> None:
    points = np.random.default_rng(0).normal(size=(n, 3))
    write_ply(tmp_path / "p.ply", points)
    header, _, body = (tmp_path / "p.ply").read_bytes().partition(b"end_header\n")
    assert header.startswith(b"ply\nformat binary_little_endian 1.0\n")
    assert f"element vertex {n}\n".encode() in header
    assert b"z forward [m]\n" in header
    np.testing.assert_array_equal(
        np.frombuffer(body, "<f4").reshape(n, 3), points.astype(np.float32)
    )


# ---- the unit of length --------------------------------------------------------------------------
class Untold(SyntheticSequence):
    """Nobody knows where the camera was."""

    def ground_truth(self) -> None:  # type: ignore[override]
        return None


@pytest.mark.picture
@pytest.mark.parametrize("kind", [SyntheticSequence, Untold])
def test_lengths_of_one_camera_are_metres_only_where_the_truth_tells(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: type[SyntheticSequence]
) -> None:
    drawn: dict[str, Any] = {}
    monkeypatch.setattr(run_picture, "draw_trajectory", lambda _, **values: drawn.update(values))
    sequence = kind(SyntheticOptions(world="corridor", sensor="mono", frames=40, size=(320, 240)))
    options = RunOptions("mono", SystemOptions(deterministic=True))
    done = run_sequence(sequence, options, output=tmp_path / "r")
    path = done.trajectory.positions
    length = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
    shown = np.linalg.norm(np.diff(drawn["positions"], axis=0), axis=1).sum()
    assert b"z forward [units]\n" in (tmp_path / "r/points.ply").read_bytes()[:300]
    if kind is Untold:
        assert (drawn["unit"], drawn["truth"]) == ("units", None)
        assert shown == pytest.approx(length)
        return
    true = SyntheticSequence(sequence.options).ground_truth().positions
    n = len(path)
    assert drawn["unit"] == "m"
    truth_length = np.linalg.norm(np.diff(true[-n:], axis=0), axis=1).sum()
    assert shown == pytest.approx(truth_length, rel=0.05)
    assert shown != pytest.approx(length, rel=0.05), "the unit is not a metre by chance"
    times, positions = drawn["truth"]
    assert len(times) == 40, "the truth of the whole recording, also before the map began"
    assert times[0] == pytest.approx(0.0)
    np.testing.assert_allclose(positions[-n:], drawn["positions"], atol=0.05)
    snapshot = done.result.snapshot.point_positions
    assert len(drawn["points"]) == len(snapshot)


def test_results_of_an_earlier_run_are_gone_when_a_new_one_begins(tmp_path: Path) -> None:
    """A run that is killed half way leaves nothing that looks like its result."""
    run = made_up_run(tmp_path / "r", "kkkkkkllkkkk", maps="0" * 8 + "1" * 4)
    results = {path.name for path in run.iterdir()} - {"settings.yaml"}
    assert {"report.json", "trajectory.txt", "trajectory_map0.txt", "frames.csv"} <= results
    assert "maps.png" in results
    for own in ("notes.txt", "office.orbmap", "trajectory_mine.txt"):
        (run / own).write_text("mine")
    remove_earlier_results(run)
    mark_as_begun(run)
    left = {path.name for path in run.iterdir()} - {"frames.csv"}
    assert left == {"settings.yaml", "notes.txt", "office.orbmap", "trajectory_mine.txt"}
    assert len((run / "frames.csv").read_text().splitlines()) == 1, "no frame"


def test_a_folder_without_a_run_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "points.ply").write_text("mine")
    (tmp_path / "trajectory.txt").write_text("mine")
    remove_earlier_results(tmp_path)
    assert len(list(tmp_path.iterdir())) == 2

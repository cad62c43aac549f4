# SPDX-License-Identifier: BSD-3-Clause
"""Maps of several runs: what belongs to which, how far the camera went, and in which order."""

from __future__ import annotations

import logging
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from orbslam2py.maps import (
    RecordedFrames,
    Run,
    SavedMap,
    export_trajectory,
    keyframe_path,
    load_map,
)
from orbslam2py.maps.keyframe_runs import runs_of_keyframes, way_along
from orbslam2py.trajectory import read_euroc, read_kitti, read_tum
from support.command_line import CommandLine
from support.made_up_map import made_up_map
from support.made_up_saved import made_up_saved, map_file


def of_runs(*sizes: int, later: float = 0.0) -> SavedMap:
    """One map whose keyframes were made by runs one after the other, each from time 0 on."""
    saved = made_up_saved(made_up_map(sum(sizes)))
    keyframes, whole = saved.contents.keyframes, saved.runs[0].frames
    times, runs, first = keyframes.timestamps.copy(), [], 0
    for number, size in enumerate(sizes):
        of_run = np.arange(first, first + size)
        times[of_run] = 0.5 * np.arange(size) + number * later
        mine = np.flatnonzero(np.isin(whole.keyframes, of_run))
        frames = RecordedFrames(
            np.repeat(times[of_run], 3) + np.tile([0, 0.1, 0.2], size),
            np.arange(3 * size), whole.keyframes[mine], whole.T_cr[mine], whole.lost[mine],
        )  # fmt: skip
        runs.append(Run("orbslam2py 0.1.0", "2026-01-02T03:04:05Z", frames=frames))
        first += size
    contents = replace(saved.contents, keyframes=replace(keyframes, timestamps=times))
    return replace(saved, contents=contents, runs=tuple(runs))


def test_keyframes_are_of_the_run_that_made_them() -> None:
    assert runs_of_keyframes(of_runs(3, 5)).tolist() == [0] * 3 + [1] * 5
    assert runs_of_keyframes(of_runs(2, 1, 3)).tolist() == [0, 0, 1, 2, 2, 2]
    saved = of_runs(3, 5)
    assert runs_of_keyframes(replace(saved, runs=())).tolist() == [0] * 8, "nothing tells"


def test_frames_of_a_run_may_hang_on_keyframes_of_another() -> None:
    """Found in the map of the first run, at a time that it made a keyframe at."""
    saved = of_runs(3, 5, later=0.5)
    frames = saved.runs[1].frames
    found = RecordedFrames(
        np.append([0.4, 0.5], frames.timestamps),
        np.arange(17),
        np.append([1, 1], frames.keyframes),
        np.concatenate([frames.T_cr[:2], frames.T_cr]),
        np.append([0, 0], frames.lost).astype(np.uint8),
    )
    runs = (saved.runs[0], replace(saved.runs[1], frames=found))
    assert runs_of_keyframes(replace(saved, runs=runs)).tolist() == [0] * 3 + [1] * 5
    no_frames = replace(saved.runs[0], frames=RecordedFrames.none())
    lost = replace(saved, runs=(no_frames, replace(saved.runs[1], frames=frames)))
    assert runs_of_keyframes(lost).tolist() == [1] * 8


@pytest.mark.parametrize("later", [0.0, 1000.0])
def test_nothing_leads_from_one_run_to_the_next(
    command: CommandLine, tmp_path: Path, later: float
) -> None:
    saved = of_runs(3, 5, later=later)
    steps = np.linalg.norm(np.diff(saved.contents.keyframes.T_wc[:, :3, 3], axis=0), axis=1)
    expected = steps.sum() - steps[2]
    assert way_along(saved, np.ones(8, bool)) == pytest.approx(expected)
    told = command("map", "info", map_file(tmp_path, saved)).out
    assert f"{expected:.2f} units in 2 runs from keyframe to keyframe\n" in told


@pytest.mark.parametrize("name", ["tum", "euroc"])
def test_paths_are_written_in_the_order_of_time(
    command: CommandLine, tmp_path: Path, name: str
) -> None:
    saved = of_runs(3, 5)
    done = command("map", "export", name, map_file(tmp_path, saved), "path")
    assert done.code == 0, done.err
    path = {"tum": read_tum, "euroc": read_euroc}[name]("path")
    assert path.timestamps.tolist() == [0, 0, 0.5, 0.5, 1, 1, 1.5, 2]
    np.testing.assert_allclose(
        path.T_wc, saved.contents.keyframes.T_wc[[0, 3, 1, 4, 2, 5, 6, 7]], atol=1e-8
    )
    told = " ".join(done.err.split())
    assert "path has several poses at 3 time stamps: the map is of runs whose times overlap" in told


def test_a_second_run_may_be_the_earlier_one(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    saved = of_runs(3, 5, later=-100.0)
    with caplog.at_level(logging.WARNING):
        export_trajectory(keyframe_path(saved.contents), tmp_path / "path", "kitti")
    order = [3, 4, 5, 6, 7, 0, 1, 2]
    expected = saved.contents.keyframes.T_wc[order]
    np.testing.assert_allclose(read_kitti(tmp_path / "path").T_wc, expected, atol=1e-8)
    assert caplog.records == []
    assert load_map(map_file(tmp_path, saved)).contents.first_difference(saved.contents) is None

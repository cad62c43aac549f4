# SPDX-License-Identifier: BSD-3-Clause
"""What plays recorded sequences with two versions in turns."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from benchmarks.harness.moved_right import with_moved_right_images
from benchmarks.versions import turns

CASE = turns.Case("made up, mono", "made_up", "mono")


def report(fps: float, ate: float | None) -> dict[str, Any]:
    return {
        "frames_per_second": fps,
        "slam_frames_per_second": 2 * fps,
        "milliseconds": {"track": {"median": 3.0}, "mapping": {"mean": 7.0}},
        "ate_rmse_m": ate,
    }


def test_both_versions_play_every_turn_one_after_the_other(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    runs: list[tuple[Any, ...]] = []

    def run_report(folder: Path, sensor: str, *options: str, python: str = "this") -> Any:
        runs.append((python, folder, sensor, *options))
        return report(10.0 if python == "other" else 25.0, 0.02)

    monkeypatch.setattr(turns, "run_report", run_report)
    tables: list[Any] = []
    arguments = argparse.Namespace(
        before="old", deterministic=True, turns=2, options="--effort thorough", settings=None
    )
    turns.print_turns(tables.append, [CASE], Path("all"), "other", arguments)
    place = Path("all/made_up")
    first, second = ["--deterministic", "--start", "0"], ["--deterministic", "--start", "1"]
    assert runs == [
        ("other", place, "mono", *first),
        ("this", place, "mono", *first, "--effort", "thorough"),
        ("other", place, "mono", *second),
        ("this", place, "mono", *second, "--effort", "thorough"),
    ]
    (table,) = tables
    cells = [next(iter(column.cells)) for column in table.columns]
    assert cells[:5] == ["made up, mono", "10.0", "25.0", "2.50", "2.50"]
    assert cells[-3:] == ["0.0200", "0.0200", "1.00"]


def test_right_images_are_moved_for_both_versions(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "sequences" / "kitti_06_head51_stereo"
    for name in ("image_0", "image_1"):
        (folder / name).mkdir(parents=True)
        cv2.imwrite(str(folder / name / "000000.png"), waves(0.0))
    seen: list[tuple[str, int, int]] = []

    def run_report(place: Path, sensor: str, *options: str, python: str = "this") -> Any:
        off = [
            int(
                np.abs(
                    cv2.imread(str(place / name / "000000.png"), 0) - waves(by).astype(int)
                ).max()
            )
            for name, by in (("image_0", 0.0), ("image_1", 0.25))
        ]
        seen.append((sensor, off[0], off[1]))
        return report(10.0, 0.02)

    monkeypatch.setattr(turns, "run_report", run_report)
    monkeypatch.setattr(turns, "needed_shared_folder", lambda: tmp_path)
    monkeypatch.setattr(turns, "python_of", lambda checkout: "other")
    monkeypatch.setattr(sys, "argv", ["turns", str(tmp_path), "--turns", "1", "--right-moved=0.25"])
    turns.main()
    assert [(sensor, left) for sensor, left, _ in seen] == [("stereo", 0)] * 2
    assert max(right for _, _, right in seen) <= 1
    np.testing.assert_array_equal(cv2.imread(str(folder / "image_1" / "000000.png"), 0), waves(0.0))


def test_right_images_that_cannot_be_moved_are_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(ValueError, match="has no right images"):
        with_moved_right_images(tmp_path, 0.1, tmp_path / "copy")
    (tmp_path / "image_1").mkdir()
    file = tmp_path / "image_1" / "000000.png"
    file.write_text("no image")
    with pytest.raises(ValueError, match=r"000000\.png is no image"):
        with_moved_right_images(tmp_path, 0.1, tmp_path / "copy")
    cv2.imwrite(str(file), waves(0.0))
    monkeypatch.setattr(cv2, "imwrite", lambda *_: False)
    with pytest.raises(OSError, match="cannot be written"):
        with_moved_right_images(tmp_path, 0.1, tmp_path / "another copy")


def waves(by: float) -> np.ndarray:
    """Waves of several lengths, so many pixels further left; as mirrored at the right border."""
    x = np.arange(144) + by
    lengths = (286 / 4, 286 / 11, 286 / 26)
    row = 128 + sum(30 * np.cos(2 * np.pi * x / length) for length in lengths)
    return np.rint(np.tile(row, (9, 1))).astype(np.uint8)


def test_medians_are_compared() -> None:
    before = [report(fps, ate) for fps, ate in ((10, 0.1), (20, 0.2), (90, 0.9))]
    cells = turns.row(before, [report(40, 0.1)])
    assert cells[:3] == ["20.0", "40.0", "2.00"]
    assert cells[-3:] == ["0.2000", "0.1000", "0.50"]


def test_without_truth_there_is_no_error_to_compare() -> None:
    cells = turns.row([report(10, None)], [report(10, None)])
    assert cells[-3:] == ["nan", "nan", "nan"]


def test_threads_have_seeds() -> None:
    assert turns.options_of_turn(3, deterministic=False) == ["--seed", "3"]


def test_both_versions_may_take_other_settings(tmp_path: Path) -> None:
    file = tmp_path / "a camera.yaml"
    options = turns.options_of_turn(0, deterministic=True, settings=file)
    assert options == ["--deterministic", "--start", "0", "--settings", str(file)]


def test_another_version_must_be_installed(tmp_path: Path) -> None:
    with pytest.raises(SystemExit, match="run make install there"):
        turns.python_of(tmp_path)
    python = tmp_path / ".venv" / "bin" / "python"
    python.parent.mkdir(parents=True)
    python.symlink_to(sys.executable)
    assert turns.python_of(tmp_path) == str(python)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--turns", "0"], "nothing to play"),
        (["--only", "nothing"], "nothing to play"),
        (["--settings", "nowhere.yaml"], "--settings nowhere.yaml: there is no such file"),
        (["--right-moved", "nan"], "--right-moved nan: less than 16 pixels"),
        (["--right-moved", "-16"], "--right-moved -16.0: less than 16 pixels"),
        (["--right-moved", "0.1", "--only", "mono"], "nothing to play"),
    ],
)
def test_wrong_options_are_told(
    options: list[str],
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(turns, "needed_shared_folder", lambda: tmp_path)
    monkeypatch.setattr(turns, "python_of", lambda checkout: "other")
    monkeypatch.setattr(sys, "argv", ["turns", str(tmp_path), *options])
    with pytest.raises(SystemExit):
        turns.main()
    assert said in capsys.readouterr().err

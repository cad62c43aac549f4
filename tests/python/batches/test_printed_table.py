# SPDX-License-Identifier: BSD-3-Clause
"""The table that ends ``orbslam2py batch``: what tells its rows apart is read at any width."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from orbslam2py.batches import BatchResult
from orbslam2py.cli.batches.printed_table import printed_table

LONG = "kitti_06_head51_stereo"


def row_of(number: int = 0, **more: Any) -> dict[str, Any]:
    row: dict[str, Any] = {"run": f"run{number:03d}", "setting": f"{LONG}-{number:03d}", "seed": 0}
    row |= {"sequence": LONG, "sensor": "stereo", "settings": None, "state": "done"}
    row |= {"path": f"/data/{LONG}", "option.max_frames": 51, "ate_rmse_m": 0.0123 + number / 1000}
    row |= {"tracked_fraction": 1.0, "frames_per_second": 12.3, "peak_memory_mb": 251.4}
    return row | more


def lines(rows: list[dict[str, Any]], width: int) -> list[str]:
    done = BatchResult(Path("out"), rows, 0, [])
    console = Console(width=width, record=True, file=io.StringIO())
    console.print(printed_table(done, width))
    shown = console.export_text().splitlines()
    assert not [line for line in shown if "…" in line], shown
    return shown


def cells(shown: list[str]) -> list[list[str]]:
    """The lines below the heading, cell by cell."""
    return [[cell.strip() for cell in line.split("│")[1:-1]] for line in shown if "│" in line]


def heading(shown: list[str]) -> list[str]:
    """The headings, each of which may have several lines."""
    parts = [line.split("┃")[1:-1] for line in shown if "┃" in line]
    return [" ".join(" ".join(one).split()) for one in zip(*parts, strict=True)]


FIGURES = ["ATE [m]", "tracked [%]", "frames/s", "memory [MB]"]


def sweep() -> list[dict[str, Any]]:
    points = [(d, s, n) for d in (True, False) for s in (1, 2) for n in (500, 1000)]
    names = ("option.deterministic", "option.stride", "sweep.ORBextractor.nFeatures")
    return [
        row_of(number, **dict(zip(names, point, strict=True)))
        for number, point in enumerate(points)
    ]


@pytest.mark.parametrize("width", [80, 100, 150])
def test_what_was_swept_has_columns(width: int) -> None:
    """What is the same in all rows takes no room."""
    shown = lines(sweep(), width)
    assert f"{LONG}: 8 runs, 0 failed" in "".join(shown)
    assert heading(shown) == ["deterministic", "stride", "nFeatures", *FIGURES]
    assert [cell[:4] for cell in cells(shown)] == [
        [str(d).lower(), str(s), str(n), f"{0.0123 + number / 1000:.4f}"]
        for number, (d, s, n) in enumerate(
            (d, s, n) for d in (True, False) for s in (1, 2) for n in (500, 1000)
        )
    ]


@pytest.mark.parametrize("width", [40, 60, 80])
def test_what_does_not_fit_beside_each_other_stands_below(width: int) -> None:
    """More is swept than a terminal is wide, and seeds have ranges."""
    keys = ("Camera.fx", "ORBextractor.nFeatures", "ORBextractor.scaleFactor", "ThDepth")
    rows = [
        row_of(
            2 * number + seed,
            setting=f"{LONG}-{number}",
            **{f"sweep.{key}": value + 0.125 for key in keys},
            **{"option.full_adjustment_time_limit": value, "sequence": f"{LONG}_{number}"},
        )
        for number, value in enumerate((500, 600))
        for seed in (0, 1)
    ]
    shown = lines(rows, width)
    text = "".join("".join(cell[0] for cell in cells(shown)).split())
    for number, value in enumerate((500, 600)):
        assert f"{LONG}_{number}" in text
        for name in ("fx", "nFeatures", "scaleFactor", "ThDepth"):
            assert f"{name}={value}.125" in text
        assert f"full_adjustment_time_limit={value}" in text
    assert all(len(line) <= width for line in shown)


def test_sequences_seeds_and_failures() -> None:
    rows = [
        row_of(2 * number + seed, sequence=name, setting=name, sensor=sensor)
        for number, (name, sensor) in enumerate((("日本", "mono"), ("desk [2]", "rgbd")))
        for seed in (0, 1)
    ]
    lost = row_of(9, sequence="lost", setting="lost", sensor=None, state="failed", ate_rmse_m=None)
    shown = lines([*rows, {**lost, "tracked_fraction": None, "frames_per_second": None}], 100)
    assert "5 runs, 1 failed" in "".join(shown)
    assert heading(shown) == ["sequence", "sensor", "runs", "failed", *FIGURES]
    assert [cell[:5] for cell in cells(shown)] == [
        ["日本", "mono", "2", "", "0.0128 (0.0123-0.0133)"],
        ["desk [2]", "rgbd", "2", "", "0.0148 (0.0143-0.0153)"],
        ["lost", "", "1", "1", ""],
    ]


def test_settings_are_called_by_their_files() -> None:
    rows = [row_of(n, settings=f"/data/{name}.yaml") for n, name in enumerate(("wide", "tele"))]
    assert [cell[0] for cell in cells(lines(rows, 80))] == ["wide", "tele"]


@pytest.mark.parametrize("others", [[], ["b"]])
def test_names_that_a_terminal_would_take_for_more(others: list[str]) -> None:
    """No bytes of another locale, no colours, no lines of their own."""
    names = ["caf\udce9 \x1b[31m\na", *others]
    rows = [row_of(n, sequence=name, setting=name) for n, name in enumerate(names)]
    assert cells(lines(rows, 80))[0][0] == "caf\ufffd \ufffd[31m\ufffda"


def test_rows_that_no_column_tells_apart_have_their_names() -> None:
    """As settings of one name in two folders, or other topics of a bag."""
    rows = [
        row_of(n, settings=f"/{name}/camera.yaml", setting=f"{LONG}-{name}_camera-{'x' * 60}")
        for n, name in enumerate("ab")
    ]
    shown = lines(rows, 80)
    text = "".join(cell[0] for cell in cells(shown))
    assert f"{LONG}-a_camera-{'x' * 60}{LONG}-b_camera-{'x' * 60}" in text


def test_one_run() -> None:
    shown = lines([row_of()], 80)
    assert heading(shown) == ["sequence", *FIGURES]
    assert cells(shown) == [[LONG, "0.0123", "100.0", "12.3", "251"]]


def test_none() -> None:
    assert "0 runs, 0 failed" in "".join(lines([], 80))

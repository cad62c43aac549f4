# SPDX-License-Identifier: BSD-3-Clause
"""Output of a run for the user: its progress, and the figures at the end."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn
from rich.table import Table

from orbslam2py._arguments import number_of
from orbslam2py.runs.report_page.explained import (
    ALIGNMENTS,
    compared_over,
    depth_words,
    loaded_map_words,
    relocalisations_words,
)
from orbslam2py.runs.report_page.imu_section import imu_words
from orbslam2py.runs.result import FrameRow
from orbslam2py.slam.system import System


def progress_bar(console: Console) -> Progress:
    """A bar that disappears at the end."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[status]}"),
        console=console,
        transient=True,
    )


class Display:
    """Updates the progress bar, at most ten times a second."""

    def __init__(self, bar: Progress, total: int | None) -> None:
        self._bar = bar
        self._task: TaskID = bar.add_task("tracking", total=total, status="")
        self._done = 0
        self._shown_at = 0.0

    def show(self, row: FrameRow, system: System) -> None:
        """Called after every frame."""
        self._done += 1
        now = self._bar.get_time()
        if now - self._shown_at < 0.1:
            return
        task = self._bar.tasks[self._task]
        speed = self._done / task.elapsed if task.elapsed else 0.0
        status = (
            f"{speed:5.1f} frames/s  {row.state}  {system.n_keyframes} keyframes  "
            f"{system.n_map_points} points"
        )
        if row.reason:
            status += escape(f"  ({row.reason})")
        self._bar.update(self._task, completed=self._done, status=status)
        self._shown_at = now


def report_table(report: dict[str, Any]) -> Table:
    """Return the main figures of report.json as text; the page has the others."""
    title = escape(f"{report['sequence']} ({report['sensor']})")
    table = Table(title=title, show_header=False)
    table.add_column(justify="left")
    table.add_column(justify="left")
    for group in (_tracking_rows, _map_rows, _error_rows, _cost_rows):
        for name, text in group(report):
            table.add_row(escape(name), escape(text))
        table.add_section()
    return table


_Rows = Iterator[tuple[str, str]]

#: Keys that hold frames by reason, and how the table calls them.
_COUNTED = {"initialisation_reasons": "no map yet", "lost_reasons": "lost"}
#: Keys that are shown only if they are not zero.
_UNUSUAL = {
    "skipped_frames": "skipped",
    "dropped_frames": "dropped",
    "weak_frames": "weak",
    "resets": "maps given up",
}


def _tracking_rows(report: dict[str, Any]) -> _Rows:
    if "tracked" in report:
        part = f" ({100 * report['tracked_fraction']:.1f} %)" if report["frames"] else ""
        yield "tracked", f"{report['tracked']} of {number_of(report['frames'], 'frame')}{part}"
    yield "lost", _describe_losses(report)
    if report.get("lost_at_end"):
        yield "lost at end", "yes"
    for key, name in _COUNTED.items():
        for reason, count in report.get(key, {}).items():
            yield f"{name}: {reason}", str(count)
    for key, name in _UNUSUAL.items():
        if report.get(key):
            yield name, str(report[key])
    if report.get("relocalisations"):
        yield "relocalisations", relocalisations_words(report)


def _map_rows(report: dict[str, Any]) -> _Rows:
    if report.get("loaded_map") is not None:
        yield "loaded map", loaded_map_words(report)
    if "keyframes" in report:
        points = number_of(report["map_points"], "map point")
        yield "map", f"{number_of(report['keyframes'], 'keyframe')}, {points}"
    unit = "units" if report["sensor"] == "mono" else "m"
    for loop in report.get("loops", []):
        yield "loop", _describe_loop(loop, unit)
    adjustments = report.get("full_adjustments")
    if adjustments:
        used = sum(entry["used"] for entry in adjustments)
        yield "full adjustments", f"{used} of {len(adjustments)} used"
    if report.get("final_adjustment") is not None:
        yield "final adjustment", _describe_adjustment(report["final_adjustment"])
    if report.get("depth") is not None:
        yield "depth", depth_words(report)
    if report.get("imu") is not None:
        yield "IMU", imu_words(report)


def _error_rows(report: dict[str, Any]) -> _Rows:
    if report.get("ate_rmse_m") is not None:
        how = ALIGNMENTS.get(report.get("ate_alignment", ""), "")
        parts = [f"{report['ate_rmse_m']:.4f} m", compared_over(report)]
        yield "error (ATE, RMSE)", " ".join(filter(None, parts)) + (f"; {how}" if how else "")
    if report.get("rpe_translation_rmse_m") is not None:
        moved, turned = report["rpe_translation_rmse_m"], report["rpe_rotation_rmse_deg"]
        yield "pose to pose (RPE, RMSE)", f"{moved:.4f} m, {turned:.3f} deg"
    if report.get("t_rel_percent") is not None:
        along, turned = report["t_rel_percent"], report["r_rel_deg_per_100m"]
        yield "KITTI's segments", f"{along:.2f} %, {turned:.3f} deg over 100 m"
    if report.get("matched_path_m") is not None:
        compared = f"{report['matched_path_m']:.2f}"
        if report.get("true_path_m") is not None:
            compared += f" of {report['true_path_m']:.2f}"
        yield "true path compared", f"{compared} m"


def _cost_rows(report: dict[str, Any]) -> _Rows:
    if report.get("slam_frames_per_second") is not None:
        yield "speed", f"{report['slam_frames_per_second']:.1f} frames a second"
    for stage, name in (
        ("track", "tracking an image"),
        ("mapping", "mapping a keyframe"),
        ("latency.total", "from exposure to pose"),
    ):
        if stage in report["milliseconds"]:
            times = report["milliseconds"][stage]
            yield name, f"median {times['median']:.1f} ms, p99 {times['p99']:.1f} ms"
    if report.get("peak_memory_mb") is not None:
        yield "memory", f"at most {report['peak_memory_mb']:.0f} MB"


def _describe_loop(loop: dict[str, Any], unit: str) -> str:
    matched, current = loop["keyframes"]
    text = f"keyframe {current} at {matched}: {loop['correction_m']:.3f} {unit}"
    text += f", {loop['correction_deg']:.2f} deg"
    if loop["scale"] != 1.0:
        text += f", scale {loop['scale']:.4f}"
    return text


def _describe_adjustment(entry: dict[str, Any]) -> str:
    before, after = entry["initial_cost"], entry["final_cost"]
    text = f"cost {before:.0f} to {after:.0f}, {sum(entry['milliseconds'].values()) / 1000:.1f} s"
    return text if entry["used"] else f"{text}, given up"


def _describe_losses(report: dict[str, Any]) -> str:
    if not report["lost"]:
        return "never"
    times = "once" if report["lost"] == 1 else f"{report['lost']} times"
    frames = number_of(report["lost_frames"], "frame")
    return (
        f"{times}, {frames}, {report['lost_seconds']:.1f} s in all, "
        f"{report['longest_loss_seconds']:.1f} s at the longest"
    )

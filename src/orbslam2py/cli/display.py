# SPDX-License-Identifier: BSD-3-Clause
"""What a person sees of a run: its progress, and the figures at the end."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn
from rich.table import Table

from orbslam2py._arguments import number_of
from orbslam2py.runs.report_page.explained import (
    compared_over,
    loaded_map_words,
    relocalisations_words,
)
from orbslam2py.runs.result import FrameRow
from orbslam2py.slam.system import System


def progress_bar(console: Console) -> Progress:
    """A bar that leaves no trace when it is done."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[status]}"),
        console=console,
        transient=True,
    )


class Display:
    """Keeps the progress bar up to date, at most ten times a second."""

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


def _describe_loop(loop: dict[str, Any], unit: str) -> str:
    matched, current = loop["keyframes"]
    text = f"keyframe {current} at {matched}: {loop['correction_m']:.3f} {unit}"
    text += f", {loop['correction_deg']:.2f} deg"
    if loop["scale"] != 1.0:
        text += f", scale {loop['scale']:.4f}"
    return text


#: Keys of report.json that the table leaves out: they are its title, or told by another row.
_UNTOLD = {
    *("sequence", "sensor", "milliseconds", "settings", "losses", "warnings"),
    *("options", "command", "command_folder", "machine"),
    *("lost_frames", "lost_seconds", "longest_loss_seconds"),
    *("matched_of_poses", "true_path_m"),
}

#: Keys that hold frames by reason, and how the table calls them.
_COUNTED = {"initialisation_reasons": "no map yet", "lost_reasons": "lost"}


def _rows_of(key: str, value: Any, report: dict[str, Any]) -> list[tuple[str, str]]:
    """What the table says about one key of report.json: names and texts."""
    if key in _UNTOLD or value is None:
        return []
    if key in _COUNTED:
        return [(f"{_COUNTED[key]}: {reason}", str(count)) for reason, count in value.items()]
    if key == "loops":
        unit = "units" if report["sensor"] == "mono" else "m"
        return [("loop", _describe_loop(loop, unit)) for loop in value]
    text = f"{value:.4f}" if isinstance(value, float) else str(value)
    if key in _IN_WORDS:
        return [_IN_WORDS[key](report)]
    if key == "final_adjustment":
        text = _describe_adjustment(value)
    elif key == "depth":
        text = f"median {value['median_m']:.2f} m with DepthMapFactor {value['factor']:g}"
    elif key == "lost":
        text = _describe_losses(report)
    elif key == "lost_at_end":
        text = "yes" if value else ""
    elif key == "full_adjustments":
        text = f"{sum(entry['used'] for entry in value)} of {len(value)} used" if value else ""
    return [(key.replace("_", " "), text)] if text else []


def _error_row(report: dict[str, Any]) -> tuple[str, str]:
    return "ate rmse m", " ".join([f"{report['ate_rmse_m']:.4f}", compared_over(report)]).strip()


def _poses_row(report: dict[str, Any]) -> tuple[str, str]:
    of_poses = number_of(report.get("matched_of_poses", report["matched_poses"]), "pose")
    text = f"{report['matched_poses']} of {of_poses} of the last map"
    return "poses compared with the truth", text


def _path_row(report: dict[str, Any]) -> tuple[str, str]:
    text = f"{report['matched_path_m']:.2f} m"
    if report.get("true_path_m") is not None:
        text = f"{report['matched_path_m']:.2f} of {report['true_path_m']:.2f} m"
    return "of the true path compared", text


def _loaded_row(report: dict[str, Any]) -> tuple[str, str]:
    return "loaded map", loaded_map_words(report)


def _relocalisations_row(report: dict[str, Any]) -> tuple[str, str]:
    return "relocalisations", relocalisations_words(report)


#: Keys that the table tells in words.
_IN_WORDS: dict[str, Callable[[dict[str, Any]], tuple[str, str]]] = {
    "ate_rmse_m": _error_row,
    "matched_poses": _poses_row,
    "matched_path_m": _path_row,
    "loaded_map": _loaded_row,
    "relocalisations": _relocalisations_row,
}


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


def report_table(report: dict[str, Any]) -> Table:
    """The figures of report.json, for reading."""
    title = escape(f"{report['sequence']} ({report['sensor']})")
    table = Table(title=title, show_header=False)
    table.add_column(justify="left")
    table.add_column(justify="right")
    for key, value in report.items():
        for name, text in _rows_of(key, value, report):
            table.add_row(escape(name), escape(text))
    table.add_section()
    for stage, numbers in report["milliseconds"].items():
        table.add_row(
            escape(f"{stage} [ms]"),
            f"median {numbers['median']:.2f}  mean {numbers['mean']:.2f}  p99 {numbers['p99']:.2f}",
        )
    return table

# SPDX-License-Identifier: BSD-3-Clause
"""``orbslam2py run``: the system over a recorded sequence, a video or a camera."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn
from rich.table import Table

from orbslam2py.cli.exit_codes import ExitCode
from orbslam2py.cli.interrupts import StopOnInterrupt
from orbslam2py.datasets import open_input
from orbslam2py.datasets.base import LiveSource, Sequence
from orbslam2py.runs.outputs import OutputWriter, link_latest, prepare_output_folder
from orbslam2py.runs.report import evaluate_run, make_report
from orbslam2py.runs.result import FrameRow, RunOptions, RunResult
from orbslam2py.runs.runner import SequenceRunner
from orbslam2py.settings.sensor import Sensor
from orbslam2py.slam.system import System
from orbslam2py.vocabulary.vocabulary import load_vocabulary

EXAMPLE = """
**Example**

    orbslam2py run rgbd_dataset_freiburg1_desk --sensor rgbd

    orbslam2py run dataset/sequences/06 --sensor stereo --output runs/06

    orbslam2py run video.mp4 --sensor mono --settings my.yaml

    orbslam2py run 0 --sensor mono --settings my.yaml
"""


def run(
    sequence: Annotated[
        str,
        typer.Argument(
            help="Folder of a TUM RGB-D, KITTI odometry or EuRoC sequence; folder of images; "
            "video file; number of a camera (ends with Ctrl-C)."
        ),
    ],
    sensor: Annotated[Sensor, typer.Option(help="What the images come from.")],
    settings: Annotated[
        str | None,
        typer.Option(
            help="Built-in name (tum1, kitti04-12, euroc, ...) or ORB-SLAM YAML file; "
            "found by itself where the sequence tells.",
            metavar="NAME_OR_FILE",
        ),
    ] = None,
    vocabulary: Annotated[
        Path | None, typer.Option(help="Vocabulary file; the one of the package if not given.")
    ] = None,
    output: Annotated[
        Path | None, typer.Option(help="Folder for the results [runs/SEQUENCE-TIME].")
    ] = None,
    deterministic: Annotated[
        bool, typer.Option("--deterministic", help="Map inline: the same bytes in every run.")
    ] = False,
    realtime: Annotated[
        bool,
        typer.Option("--realtime", help="Follow the time stamps; drop frames as a camera would."),
    ] = False,
    start: Annotated[int, typer.Option(help="First frame.", min=0)] = 0,
    stride: Annotated[int, typer.Option(help="Take every so many frames.", min=1)] = 1,
    max_frames: Annotated[
        int | None, typer.Option(help="Take at most so many frames.", min=1)
    ] = None,
    fps: Annotated[
        float | None,
        typer.Option(
            help="Images per second of a folder of images [that of the settings] or a video [its "
            "own time stamps]; what a camera is asked for.",
        ),
    ] = None,
    times: Annotated[
        Path | None,
        typer.Option(
            help="File with a time stamp per image of a folder or video: decimal seconds or whole "
            "nanoseconds."
        ),
    ] = None,
    mask: Annotated[
        Path | None,
        typer.Option(
            help="Where to look: an 8-bit image, 0 = ignore, or a folder with one per image.",
            metavar="FILE_OR_FOLDER",
        ),
    ] = None,
    localize: Annotated[
        int | None,
        typer.Option(
            help="Switch to localization mode after so many frames: the map stays as it is.",
            min=1,
            metavar="N",
        ),
    ] = None,
    loop_closing: Annotated[
        bool,
        typer.Option(
            "--loop-closing/--no-loop-closing",
            help="Recognise places seen before and take out the drift.",
        ),
    ] = True,
    full_adjustment: Annotated[
        bool,
        typer.Option(
            "--full-adjustment/--no-full-adjustment", help="After a loop, refine the whole map."
        ),
    ] = True,
    full_adjustment_time_limit: Annotated[
        float | None,
        typer.Option(
            help="Seconds after which that ends with what it has reached.", metavar="SECONDS"
        ),
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of all random draws.", min=0)] = 0,
    force: Annotated[
        bool, typer.Option("--force", help="Write into an output folder that is not empty.")
    ] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="Only errors.")] = False,
) -> None:
    """Track a recorded sequence, a video or a camera; write trajectory, map and report."""
    log_to(Console(stderr=True), quiet=quiet)  # opening warns already
    images = open_input(sequence, sensor, settings=settings, fps=fps, times=times, mask=mask)
    options = RunOptions(
        *(sensor, deterministic, realtime, start, stride, max_frames, seed, localize),
        loop_closing=loop_closing,
        full_adjustment=full_adjustment,
        full_adjustment_time_limit=full_adjustment_time_limit,
    )
    code = run_and_write(
        images, options, vocabulary=vocabulary, output=output, force=force, quiet=quiet
    )
    raise typer.Exit(code)


run.__doc__ = f"{run.__doc__}\n{EXAMPLE}"


def run_and_write(
    sequence: Sequence | LiveSource,
    options: RunOptions,
    *,
    vocabulary: Path | None = None,
    output: Path | None = None,
    force: bool = False,
    quiet: bool = False,
) -> ExitCode:
    """Run, write all files, show a table; returns the exit code."""
    console = Console(quiet=quiet)
    errors = Console(stderr=True)
    log_to(errors, quiet=quiet)
    runner = SequenceRunner(sequence, sequence.settings, load_vocabulary(vocabulary), options)
    folder = prepare_output_folder(output, sequence.name, force=force)
    link_latest(folder)

    writer = OutputWriter(folder)
    with StopOnInterrupt() as interrupt:
        with _progress_bar(console) as bar:
            display = _Display(bar, runner.result.n_frames)
            result = runner.run(display.show, interrupt.event)
        evaluation = evaluate_run(result)
        report = make_report(result, evaluation)
        writer.write_all(result, report, evaluation)
    console.print(_table(report))
    console.print(f"Results are in [bold]{escape(str(folder))}[/]", highlight=False, soft_wrap=True)
    code = _conclude(result, writer, errors)
    interrupted = interrupt.event.is_set() and not result.is_live  # also while writing
    if code is not ExitCode.FAILED and interrupted:
        return ExitCode.INTERRUPTED
    return code


def _conclude(result: RunResult, writer: OutputWriter, errors: Console) -> ExitCode:
    for problem in writer.problems:
        _print_error(errors, "Error", problem)
    if result.error is not None:
        what = str(result.error) or type(result.error).__name__
        _print_error(errors, "Error", f"{what} (what was done until then is saved)")
    if result.error is not None or writer.problems:
        return ExitCode.FAILED
    if result.n_tracked == 0 and not result.interrupted:
        _print_error(errors, "Nothing could be tracked", result.why_nothing_was_tracked())
        return ExitCode.NOTHING_TRACKED
    return ExitCode.OK


def _print_error(console: Console, title: str, text: str) -> None:
    console.print(f"[bold red]{title}:[/] {escape(text)}", highlight=False, soft_wrap=True)


class _ConsoleHandler(logging.Handler):
    """Prints warnings like errors, in one line each: paths can be copied from it."""

    def __init__(self, console: Console) -> None:
        super().__init__()
        self._console = console

    def emit(self, record: logging.LogRecord) -> None:
        colour = "red" if record.levelno >= logging.ERROR else "yellow"
        title = f"[bold {colour}]{record.levelname.capitalize()}:[/]"
        text = escape(self.format(record))
        self._console.print(f"{title} {text}", highlight=False, soft_wrap=True)


def log_to(console: Console, *, quiet: bool) -> None:
    """Print the package's warnings (errors, if quiet) on a console."""
    logger = logging.getLogger("orbslam2py")
    logger.handlers = [_ConsoleHandler(console)]
    logger.propagate = False
    logger.setLevel(logging.ERROR if quiet else logging.WARNING)


def _progress_bar(console: Console) -> Progress:
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[status]}"),
        console=console,
        transient=True,
    )


class _Display:
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


def _describe_loop(loop: dict[str, Any]) -> str:
    matched, current = loop["keyframes"]
    text = f"keyframe {current} at {matched}: {loop['correction_m']:.3f} m"
    text += f", {loop['correction_deg']:.2f} deg"
    if loop["scale"] != 1.0:
        text += f", scale {loop['scale']:.4f}"
    return text


def _table(report: dict[str, Any]) -> Table:
    title = escape(f"{report['sequence']} ({report['sensor']})")
    table = Table(title=title, show_header=False)
    table.add_column(justify="left")
    table.add_column(justify="right")
    for key, value in report.items():
        if key in {"sequence", "sensor", "milliseconds", "settings"} or value is None:
            continue
        if key == "initialisation_reasons":
            for reason, count in value.items():
                table.add_row(f"no map yet: {escape(reason)}", str(count))
            continue
        if key == "loops":
            for loop in value:
                table.add_row("loop", _describe_loop(loop))
            continue
        if key == "full_adjustments":
            used = sum(entry["used"] for entry in value)
            if value:
                table.add_row(key.replace("_", " "), f"{used} of {len(value)} used")
            continue
        text = f"{value:.4f}" if isinstance(value, float) else str(value)
        table.add_row(key.replace("_", " "), escape(text))
    table.add_section()
    for stage, numbers in report["milliseconds"].items():
        table.add_row(
            f"{stage} [ms]",
            f"median {numbers['median']:.2f}  mean {numbers['mean']:.2f}  p99 {numbers['p99']:.2f}",
        )
    return table

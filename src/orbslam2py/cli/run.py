# SPDX-License-Identifier: BSD-3-Clause
"""``orbslam2py run``: the system over a recorded sequence, a video or a camera."""

from __future__ import annotations

import contextlib
import shlex
import sys
from pathlib import Path
from typing import Annotated

import typer
import typer.core
from rich.console import Console
from rich.markup import escape

from orbslam2py._files import describe_error
from orbslam2py.cli.display import (
    Display,
    log_to,
    print_error,
    progress_bar,
    report_table,
    tell_repeated,
)
from orbslam2py.cli.exit_codes import ExitCode
from orbslam2py.cli.interrupts import StopOnInterrupt
from orbslam2py.cli.run_arguments import read_initial_pose
from orbslam2py.cli.viewing import (
    ViewerExit,
    ViewerFlag,
    ViewerHost,
    ViewerOptions,
    ViewerPort,
    Viewing,
)
from orbslam2py.cli.watching import RecordOption, VideoOption, file_watchers, watch_all
from orbslam2py.datasets import open_input
from orbslam2py.datasets.base import LiveSource, Sequence
from orbslam2py.maps import load_map
from orbslam2py.maps.setup_check import check_sensor
from orbslam2py.runs.options import RunOptions
from orbslam2py.runs.outputs import new_output_folder
from orbslam2py.runs.remedies import why_nothing_was_tracked
from orbslam2py.runs.result import FrameRow
from orbslam2py.runs.run import FinishedRun, run_sequence
from orbslam2py.settings import Settings
from orbslam2py.settings.sensor import Sensor
from orbslam2py.slam.options import SystemOptions
from orbslam2py.slam.system import System
from orbslam2py.vocabulary.vocabulary import load_vocabulary

EXAMPLE = """
**Example**

    orbslam2py run rgbd_dataset_freiburg1_desk --sensor rgbd

    orbslam2py run dataset/sequences/06 --sensor stereo --output runs/06

    orbslam2py run video.mp4 --sensor mono --settings my.yaml

    orbslam2py run 0 --sensor mono --settings my.yaml

    orbslam2py run monday.mp4 --sensor mono --settings my.yaml --save office.orbmap

    orbslam2py run tuesday.mp4 --load office.orbmap --localize
"""


def run(
    sequence: Annotated[
        str,
        typer.Argument(
            help="Folder of a TUM RGB-D, KITTI odometry or EuRoC sequence; folder of images; "
            "video file; number of a camera (ends with Ctrl-C)."
        ),
    ],
    sensor: Annotated[
        Sensor | None,
        typer.Option(help="What the images come from [the richest there are images for]."),
    ] = None,
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
            "nanoseconds, with the images' file names or without (rgb.txt, data.csv)."
        ),
    ] = None,
    mask: Annotated[
        Path | None,
        typer.Option(
            help="Where to look: an 8-bit image, 0 = ignore, or a folder with one per image.",
            metavar="FILE_OR_FOLDER",
        ),
    ] = None,
    load: Annotated[
        Path | None,
        typer.Option(
            help="Begin in a map that was saved before; its settings serve if --settings gives no "
            "others.",
            metavar="FILE",
        ),
    ] = None,
    initial_pose: Annotated[
        str | None,
        typer.Option(
            help="Where in the loaded map the camera may be: tried before all else.",
            metavar="X,Y,Z[,QX,QY,QZ,QW]",
        ),
    ] = None,
    allow_other_setup: Annotated[
        bool,
        typer.Option(
            "--allow-other-setup",
            help="Load the map although it is of another camera or other visual words.",
        ),
    ] = False,
    localize: Annotated[
        int | None,
        typer.Option(
            help="Localization mode, in which the map stays as it is: after so many frames; "
            "without a number from the first on, in a loaded map.",
            min=0,
            metavar="[N]",
        ),
    ] = None,
    save: Annotated[
        Path | None, typer.Option(help="Save the last map in this file.", metavar="FILE")
    ] = None,
    autosave: Annotated[
        float | None,
        typer.Option(help="Save it every so many seconds on the way as well.", metavar="SECONDS"),
    ] = None,
    save_images: Annotated[
        bool,
        typer.Option("--save-images", help="Keep a small grey image of every keyframe in the map."),
    ] = False,
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
    final_adjustment: Annotated[
        bool,
        typer.Option(
            "--final-adjustment", help="At the end, refine the finished map before it is written."
        ),
    ] = False,
    seed: Annotated[int, typer.Option(help="Seed of all random draws.", min=0)] = 0,
    video: VideoOption = None,
    record: RecordOption = None,
    force: Annotated[
        bool, typer.Option("--force", help="Write into an output folder that is not empty.")
    ] = False,
    no_report: Annotated[
        bool, typer.Option("--no-report", help="Do not write the page report.html.")
    ] = False,
    viewer: ViewerFlag = False,
    viewer_port: ViewerPort = None,
    viewer_host: ViewerHost = None,
    viewer_exit: ViewerExit = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="Only errors.")] = False,
) -> None:
    """Track a recorded sequence, a video or a camera; write trajectory, map and report."""
    look = ViewerOptions(viewer, viewer_port, viewer_host, viewer_exit)
    log_to(Console(stderr=True), quiet=quiet)  # opening warns already
    loaded = None if load is None else load_map(load, images=True)
    chosen: Settings | str | None = settings
    if loaded is not None and settings is None:
        if sensor is not None:
            check_sensor(loaded, sensor)
        sensor, chosen = loaded.sensor, loaded.settings
    images = open_input(sequence, sensor, settings=chosen, fps=fps, times=times, mask=mask)
    options = RunOptions(
        images.sensor,
        SystemOptions(
            deterministic=deterministic,
            loop_closing=loop_closing,
            full_adjustment=full_adjustment,
            full_adjustment_time_limit=full_adjustment_time_limit,
            keyframe_images=save_images,
            seed=seed,
        ),
        realtime=realtime,
        start=start,
        stride=stride,
        max_frames=max_frames,
        localize_after=localize,
        final_adjustment=final_adjustment,
        load_map=loaded,
        initial_pose=None if initial_pose is None else read_initial_pose(initial_pose),
        allow_other_setup=allow_other_setup,
        save_map=save,
        autosave=autosave,
    )
    code = run_and_show(
        images,
        options,
        vocabulary=vocabulary,
        output=output,
        force=force,
        report_page=not no_report,
        viewer=look,
        video=video,
        record=record,
        quiet=quiet,
    )
    raise typer.Exit(code)


run.__doc__ = f"{run.__doc__}\n{EXAMPLE}"


def run_and_show(
    sequence: Sequence | LiveSource,
    options: RunOptions,
    *,
    vocabulary: Path | None = None,
    output: Path | None = None,
    force: bool = False,
    report_page: bool = True,
    viewer: ViewerOptions | None = None,
    quiet: bool = False,
    video: Path | None = None,
    record: Path | None = None,
) -> ExitCode:
    """Run, with a progress bar and a table at the end; returns the exit code."""
    console = Console(quiet=quiet)
    errors = Console(stderr=True)
    log_to(errors, quiet=quiet)
    n_frames = options.n_frames(sequence)
    words = load_vocabulary(vocabulary)  # until here a Ctrl-C leaves nothing behind
    with contextlib.ExitStack() as page:
        with StopOnInterrupt() as interrupt:
            files = page.enter_context(file_watchers(sequence, options, video, record))
            viewing = Viewing(viewer or ViewerOptions(), sequence, interrupt.event)
            page.enter_context(viewing)
            with progress_bar(console) as bar:
                display = Display(bar, n_frames)

                def progress(row: FrameRow, system: System) -> None:
                    display.show(row, system)
                    viewing.count(row)
                    files.count(row)

                done = run_sequence(
                    sequence,
                    options,
                    vocabulary=words,
                    output=output or new_output_folder(sequence.name),
                    force=force,
                    report_page=report_page,
                    command=shlex.join(["orbslam2py", *sys.argv[1:]]),
                    progress=progress,
                    control=viewing.control,
                    watch=watch_all(viewing.watch, files.watch),
                )
        tell_repeated()
        console.print(report_table(done.report))
        folder = escape(str(done.folder))
        console.print(f"Results are in [bold]{folder}[/]", highlight=False, soft_wrap=True)
        html = done.folder / "report.html" if done.folder is not None else None
        if report_page and html is not None and html.is_file():
            text = f"To look at them: [bold]{escape(str(html))}[/]"
            console.print(text, highlight=False, soft_wrap=True)
        files.tell(console)
        code = _conclude(done, errors)
        viewing.stay(console, done.folder)
    interrupted = interrupt.event.is_set() and not done.result.is_live  # also while writing
    if code is not ExitCode.FAILED and interrupted:
        return ExitCode.INTERRUPTED
    return code


def _conclude(done: FinishedRun, errors: Console) -> ExitCode:
    result = done.result
    for problem in done.problems:
        print_error(errors, "Error", problem)
    if result.error is not None:
        what = describe_error(result.error)
        print_error(errors, "Error", f"{what} (what was done until then is saved)")
    if result.error is not None or done.problems:
        return ExitCode.FAILED
    if result.n_tracked == 0 and not result.interrupted:
        print_error(errors, "Nothing could be tracked", why_nothing_was_tracked(result.rows))
        return ExitCode.NOTHING_TRACKED
    return ExitCode.OK

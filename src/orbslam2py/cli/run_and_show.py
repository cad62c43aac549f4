# SPDX-License-Identifier: BSD-3-Clause
"""A run on the terminal: a progress bar, a table at the end, the exit code."""

from __future__ import annotations

import contextlib
import re
import shlex
import sys
from collections.abc import Iterable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import cast

from rich.console import Console
from rich.markup import escape

from orbslam2py._files import describe_error
from orbslam2py.cli.display import Display, progress_bar, report_table
from orbslam2py.cli.exit_codes import ExitCode
from orbslam2py.cli.interrupts import StopOnInterrupt
from orbslam2py.cli.messages import log_to, print_error, tell_repeated
from orbslam2py.cli.publishing import Publishing, PublishOptions
from orbslam2py.cli.targets import check_apart
from orbslam2py.cli.viewing import ViewerOptions, Viewing
from orbslam2py.cli.watching import file_watchers, watch_all
from orbslam2py.datasets.base import LiveSource, Sequence
from orbslam2py.errors import OrbSlamError
from orbslam2py.live import LiveStream
from orbslam2py.maps import MapFile
from orbslam2py.runs.feeds import is_sequence
from orbslam2py.runs.options import RunOptions
from orbslam2py.runs.outputs import new_output_folder, prepare_output_folder
from orbslam2py.runs.remedies import why_nothing_was_tracked
from orbslam2py.runs.result import FrameRow, RunResult
from orbslam2py.runs.run import FinishedRun, run_sequence
from orbslam2py.slam.system import System
from orbslam2py.vocabulary.vocabulary import load_vocabulary

#: A password in the address of a camera; reports are given to others.
_PASSWORD = re.compile(r"(\w://[^\s/:@]*:)[^\s/@]*@")


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
    publish: PublishOptions | None = None,
    record_input: Path | None = None,
    inputs: Iterable[Path] = (),
) -> ExitCode:
    """Run, with a progress bar and a table at the end; returns the exit code.

    No written file may be among the `inputs`.
    """
    console = Console(quiet=quiet)
    errors = Console(stderr=True)
    log_to(errors, quiet=quiet)
    n_frames = options.n_frames(sequence)
    words = load_vocabulary(vocabulary)  # until here a Ctrl-C leaves nothing behind
    written = {"--video": video, "--record": record, "--record-input": record_input}
    check_apart({**written, "--save": options.save_map}, inputs)
    output = output or new_output_folder(sequence.name)
    with contextlib.ExitStack() as page:
        if any(
            path is not None and path.resolve().parent == output.resolve()
            for path in written.values()
        ):
            settings = sequence.settings.to_yaml()
            is_new = not output.exists()
            prepare_output_folder(output, force=force, settings=settings)
            if is_new:
                page.callback(_remove_if_empty, output)  # if there is no run after all
            force = True
        there_before = _identity_of(options.save_map)
        with StopOnInterrupt() as interrupt:
            files = page.enter_context(file_watchers(sequence, options, video, record))
            in_real_time = options.realtime or not is_sequence(sequence)
            input_recorder = _input_recorder(record_input, sequence)
            viewing = Viewing(
                viewer or ViewerOptions(), sequence, interrupt.event, in_real_time=in_real_time
            )
            page.enter_context(viewing)
            publishing = page.enter_context(
                Publishing(
                    publish or PublishOptions(),
                    sequence,
                    in_time=in_real_time,
                    map_path=options.save_map,
                    output=output,
                )
            )
            with progress_bar(console) as bar:
                display = Display(bar, n_frames)

                def progress(row: FrameRow, system: System) -> None:
                    display.show(row, system)
                    viewing.count(row)
                    files.count(row)

                done = run_sequence(
                    publishing.sequence,
                    options,
                    vocabulary=words,
                    output=output,
                    force=force,
                    report_page=report_page,
                    command=_command(),
                    progress=progress,
                    control=viewing.control,
                    watch=watch_all(
                        viewing.watch, files.watch, publishing.watch, lambda _: input_recorder
                    ),
                )
        tell_repeated()
        console.print(report_table(done.report))
        _tell_folder(console, done, report_page=report_page)
        if options.save_map is not None:
            about_map = _about_map(done.result, options.save_map, there_before)
            console.print(about_map, highlight=False, soft_wrap=True)
        files.tell(console)
        if record_input is not None and record_input.is_file():
            what = f"What came in is in [bold]{escape(str(record_input))}[/]"
            console.print(what, highlight=False, soft_wrap=True)
        code = _conclude(done, errors)
        viewing.stay(console, done.folder)
    interrupted = interrupt.event.is_set() and not done.result.is_live  # also while writing
    if code is not ExitCode.FAILED and interrupted:
        return ExitCode.INTERRUPTED
    return code


def _command() -> str:
    """Return the line that repeats the run, without passwords."""
    return _PASSWORD.sub(r"\1PASSWORD@", shlex.join(["orbslam2py", *sys.argv[1:]]))


def _input_recorder(
    path: Path | None, source: Sequence | LiveSource
) -> AbstractContextManager[object]:
    """Make what records the input of a live source; it begins when it is entered."""
    if path is None:
        return contextlib.nullcontext()
    from orbslam2py.live import InputRecorder  # noqa: PLC0415  # its packages may be missing

    return InputRecorder(path, cast(LiveStream, source))


def _tell_folder(console: Console, done: FinishedRun, *, report_page: bool) -> None:
    folder = escape(str(done.folder))
    console.print(f"Results are in [bold]{folder}[/]", highlight=False, soft_wrap=True)
    html = done.folder / "report.html" if done.folder is not None else None
    if report_page and html is not None and html.is_file():
        text = f"To look at them: [bold]{escape(str(html))}[/]"
        console.print(text, highlight=False, soft_wrap=True)


def _remove_if_empty(folder: Path) -> None:
    with contextlib.suppress(OSError):
        folder.rmdir()


def _identity_of(path: Path | None) -> tuple[int, int] | None:
    """Return the identity of a file, to recognise a replacement; None if there is none."""
    if path is None or not path.exists():
        return None
    status = path.stat()
    return status.st_dev, status.st_ino


def _about_map(result: RunResult, path: Path, before: tuple[int, int] | None) -> str:
    """Print the contents of the map file; if the last save failed, it has the earlier ones."""
    named = f"[bold]{escape(str(path))}[/]"
    if result.saved_map is not None:
        return f"Map saved in {named}"
    now = _identity_of(path)
    if now is None:
        return "The map was not saved"
    if now == before:
        return f"The map was not saved; {named} is as it was before the run"
    try:
        n = len(MapFile(path).runs[-1].frames)
    except OrbSlamError:
        return f"{named} holds an older state of the map, if any"
    return f"{named} holds an older state of the map, with {n} of {result.n_frames} frames"


def _conclude(done: FinishedRun, errors: Console) -> ExitCode:
    result = done.result
    for problem in done.problems:
        print_error(errors, "Error", problem)
    if result.error is not None:
        what = describe_error(result.error)
        saved = "the other results are" if result.last_save_failed else "the results until then are"
        print_error(errors, "Error", f"{what} ({saved} saved)")
    if result.error is not None or done.problems:
        return ExitCode.FAILED
    if result.n_tracked == 0 and not result.interrupted:
        doubted = bool(result.calibration_warnings)
        why = why_nothing_was_tracked(result.rows, calibration_is_doubted=doubted)
        print_error(errors, "Nothing could be tracked", why)
        return ExitCode.NOTHING_TRACKED
    return ExitCode.OK

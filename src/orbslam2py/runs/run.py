# SPDX-License-Identifier: BSD-3-Clause
"""Run the system over a sequence and write its results: the command ``run`` for Python."""

from __future__ import annotations

import contextlib
import logging
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from orbslam2py import _core as core
from orbslam2py._arguments import path_of, shown
from orbslam2py.datasets import RecordedSequence
from orbslam2py.datasets.base import LiveSource, Sequence
from orbslam2py.errors import DatasetError, SettingsError
from orbslam2py.maps.map_file import MapFile
from orbslam2py.maps.map_writer import check_map_target
from orbslam2py.runs.control import RunControl
from orbslam2py.runs.input_folders import check_not_among_images
from orbslam2py.runs.losses import find_losses, last_loss_warning
from orbslam2py.runs.options import RunOptions
from orbslam2py.runs.outputs import (
    OutputWriter,
    is_name_of_result,
    link_latest,
    mark_as_begun,
    prepare_output_folder,
    remove_earlier_results,
    sole_writer,
)
from orbslam2py.runs.report import RunEvaluation, evaluate_run, make_report
from orbslam2py.runs.result import RunResult
from orbslam2py.runs.runner import Progress, SequenceRunner, Watch
from orbslam2py.settings.settings import Settings
from orbslam2py.slam.options import Setup
from orbslam2py.trajectory.trajectory import Trajectory
from orbslam2py.vocabulary.vocabulary import load_vocabulary

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class FinishedRun:
    """The result of a run, also of an interrupted one."""

    result: RunResult
    """Rows, trajectories and map; why it ended early."""
    evaluation: RunEvaluation | None
    """Comparison with ground truth, if there is one."""
    report: dict[str, Any]
    """All figures, as in ``report.json``."""
    folder: Path | None
    """The folder of the files; None if none was given."""
    problems: tuple[str, ...]
    """Files that could not be written, and the locations of their copies."""

    @property
    def trajectory(self) -> Trajectory:
        """Number of frames of the main map with a pose, after the last optimisation."""
        return self.result.tracked_trajectory()


def run_sequence(
    sequence: Sequence | LiveSource,
    options: RunOptions | None = None,
    *,
    vocabulary: core.Vocabulary | str | Path | None = None,
    output: str | Path | None = None,
    force: bool = False,
    progress: Progress | None = None,
    stop: threading.Event | None = None,
    report_page: bool = True,
    command: str | None = None,
    control: RunControl | None = None,
    watch: Watch | None = None,
) -> FinishedRun:
    """Run the system over a sequence, evaluate the result and write its files.

    Parameters
    ----------
    sequence : Sequence or LiveSource
        Images, time stamps and settings, as from `orbslam2py.open_sequence`.
    options : RunOptions, optional
        Which frames, and how; None: all, with the sequence's sensor.
    vocabulary : Vocabulary or path, optional
        Visual words; None: the vocabulary of the package.
    output : str or Path, optional
        Folder for the results; None: no files.
    force : bool
        Accept an output folder that contains files; results of an earlier run in it are removed at
        the beginning. Files with the names of results that are from no run are never replaced, and
        nothing is written among the sequence's own images.
    progress : callable, optional
        ``progress(row, system)``, called after every frame.
    stop : threading.Event, optional
        An event that ends the run after the present frame when set; the results so far are written.
    report_page : bool
        Also write ``report.html`` and its images.
    command : str, optional
        The command line of the run, for its report.
    control : RunControl, optional
        Instead of `stop`: can also pause the run and process single frames.
    watch : callable, optional
        Called with the system; the context manager that it returns is entered before the first
        frame, and left after the shutdown of the system. For viewers, recordings, videos.

    Returns
    -------
    FinishedRun
        Also if the run was stopped or failed: see `RunResult.interrupted` and `RunResult.error`.

    Raises
    ------
    DatasetError
        If the options do not fit the sequence, its first images are missing, its time stamps are no
        text, or the folder cannot be used.
    SettingsError, VocabularyError, MapFileError
        If these cannot be used, or the map could not be saved at the end.

    Examples
    --------
    >>> sequence = orb.open_sequence("rgbd_dataset_freiburg1_desk", "rgbd")  # doctest: +SKIP
    >>> orb.run_sequence(sequence, output="runs/desk").report["ate_rmse_m"]  # doctest: +SKIP
    0.0158
    """
    if isinstance(sequence, RecordedSequence):
        sequence.require_images()
    if not hasattr(sequence, "settings"):
        raise DatasetError(
            f"the sequence is {shown(sequence)}; give what orbslam2py.open_sequence returns"
        )
    if not isinstance(sequence.settings, Settings):
        raise SettingsError(
            f"the settings of the sequence are {shown(sequence.settings)}; give it Settings, as "
            "Settings.load('camera.yaml', sensor) returns"
        )
    if options is None:
        options = RunOptions(sequence.settings.sensor)
    elif not isinstance(options, RunOptions):
        raise SettingsError(f"options are {shown(options)}; give orbslam2py.runs.RunOptions(...)")
    folder = None if output is None else path_of(output, "output")
    if folder is not None:
        check_not_among_images(folder, sequence)
    if not isinstance(vocabulary, core.Vocabulary):
        vocabulary = load_vocabulary(vocabulary)
    if options.load_map is not None:  # before anything is made
        Setup.of(
            sequence.settings,
            options.sensor,
            vocabulary,
            options.load_map,
            options.initial_pose,
            options.allow_other_setup,
        )
        if isinstance(options.load_map, MapFile):
            options.load_map.check()
    runner = SequenceRunner(sequence, sequence.settings, vocabulary, options)
    runner.result.command = command
    settings = sequence.settings.to_yaml()
    with _prepared(folder, options.save_map, settings, force=force):
        result = runner.run(progress, stop, control=control, watch=watch)
        warning = last_loss_warning(find_losses(result.rows))
        if warning is not None:
            _log.warning("%s", warning)
            result.warnings.append(warning)
        evaluation = evaluate_run(result)
        report = make_report(result, evaluation)
        problems: tuple[str, ...] = ()
        if folder is not None:
            writer = OutputWriter(folder)
            writer.write_all(result, report, evaluation, page=report_page)
            problems = tuple(writer.problems)
    return FinishedRun(result, evaluation, report, folder, problems)


@contextlib.contextmanager
def _prepared(
    folder: Path | None, saved_map: str | Path | None, settings: str, *, force: bool
) -> Iterator[None]:
    """Create the folder of the results, and check that results and map can be written."""
    target = None if saved_map is None else path_of(saved_map, "save_map")
    is_among_results = (
        target is not None and folder is not None and target.resolve().parent == folder.resolve()
    )
    if target is not None and not is_among_results:
        check_map_target(target)
    if folder is None:
        yield
        return
    if target is not None and is_among_results and is_name_of_result(target.name):
        raise DatasetError(
            f"{target} is the name of one of the run's results; give the map another name"
        )
    prepare_output_folder(folder, force=force, settings=settings)
    if target is not None and is_among_results:
        check_map_target(target)  # its folder may not have been there before
    with sole_writer(folder):
        remove_earlier_results(folder)
        mark_as_begun(folder)
        link_latest(folder)
        yield

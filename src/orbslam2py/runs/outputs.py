# SPDX-License-Identifier: BSD-3-Clause
"""Files of the results of a run."""

from __future__ import annotations

import contextlib
import fnmatch
import json
import logging
import os
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

try:
    import fcntl
except ImportError:  # not on Windows
    fcntl = None  # type: ignore[assignment]

from orbslam2py._files import atomic_write, reason_of
from orbslam2py.errors import DatasetError
from orbslam2py.maps.ply import write_ply
from orbslam2py.runs.frame_errors import truth_of_frames, worst_frames
from orbslam2py.runs.frame_table import begin_frames, has_no_frames, write_frames
from orbslam2py.runs.imu_table import has_imu_states, write_imu_states
from orbslam2py.runs.report import RunEvaluation
from orbslam2py.runs.report_page import write_report_page
from orbslam2py.runs.report_page.frame_images import (
    choose_frames,
    has_any_images,
    write_frame_images,
)
from orbslam2py.runs.result import RunResult
from orbslam2py.runs.run_picture import anchored_points, draw_maps_of_run, draw_run
from orbslam2py.trajectory import Trajectory, write_kitti, write_tum
from orbslam2py.trajectory.frame_times import is_frame_table

_log = logging.getLogger(__name__)

#: Input of the run.
_SETTINGS = "settings.yaml"

#: Files that a run may have no content for.
_NOT_ALWAYS = (
    *("trajectory.txt", "trajectory_online.txt", "trajectory_kitti.txt", "keyframes.txt"),
    *("trajectory.png", "maps.png", "trajectory_map*.txt", "groundtruth_aligned.txt"),
    *("report.html", "frame_images.zip", "imu_states.csv", "imu.yaml"),
)

#: By it a folder is known as that of a run: the first to come, without frames, the last to go.
_MARK = "frames.csv"

#: All results; the settings are not among them, which may be those that the run was given.
_RESULTS = (*_NOT_ALWAYS, "points.ply", "map.npz", "report.json", _MARK)


def new_output_folder(name: str) -> Path:
    """Return a new folder: ``runs/<name>-<time>``, below the working folder."""
    stem = Path("runs") / f"{name}-{time.strftime('%Y%m%d-%H%M%S')}"
    folder = stem
    for number in range(2, 100):
        if not folder.exists():
            break
        folder = stem.with_name(f"{stem.name}-{number}")
    return folder


def is_name_of_result(name: str) -> bool:
    """Return whether a run writes a file of this name into its folder."""
    return name == _SETTINGS or any(fnmatch.fnmatchcase(name, pattern) for pattern in _RESULTS)


def prepare_output_folder(folder: Path, *, force: bool, settings: str = "") -> Path:
    """Create the folder of the results, and check that it is writable.

    Parameters
    ----------
    folder : Path
        The folder.
    force : bool
        Accept a folder that contains files. Files with the names of results must be from a run.
    settings : str
        Text of the settings file that will be written; an identical file may exist.

    Raises
    ------
    DatasetError
        If it is not empty (without `force`), not a folder, or not writable, or if files that are
        from no run would be replaced.
    """
    if folder.exists() and not folder.is_dir():
        raise DatasetError(f"{folder} is not a folder; give another one with --output")
    if folder.exists() and any(folder.iterdir()) and not force and not _is_only_begun(folder):
        raise DatasetError(
            f"{folder} is not empty; give another --output, or --force to overwrite "
            "(output, force=True)"
        )
    if folder.is_dir() and (name := _other_work(folder, settings)):
        raise DatasetError(
            f"{folder} holds {name}, which would be replaced, but no run that has written it (no "
            f"{_MARK} of one); give another --output"
        )
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / ".write-test"
        try:
            probe.write_bytes(b"x")
        finally:
            probe.unlink(missing_ok=True)  # on a full disk it is made, and stays empty
    except OSError as error:
        raise DatasetError(
            f"cannot write to {folder}: {reason_of(error)}; give another folder with --output"
        ) from error
    return folder


@contextlib.contextmanager
def sole_writer(folder: Path) -> Iterator[None]:
    """Lock a folder against other runs; the lock ends with the process.

    Raises
    ------
    DatasetError
        If another run is writing there.
    """
    if fcntl is None:
        yield
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise DatasetError(
                f"another run is writing into {folder}; wait for its end, or give another --output"
            ) from None
        except OSError as error:  # not every network disk has locks
            _log.debug("%s cannot be locked: %s", folder, error)
        yield
    finally:
        os.close(handle)


def remove_earlier_results(folder: Path) -> None:
    """Remove the results of an earlier run, so that they do not look like those of the new run.

    Only in the folder of a run, and only files that runs write; the settings and the table of
    frames are kept.
    """
    if not holds_run(folder):
        return
    for path in _results_in(folder):
        if path.is_file() and path.name != _MARK:
            with contextlib.suppress(OSError):
                path.unlink()


def mark_as_begun(folder: Path) -> None:
    """Write an empty table, so that the files of a killed run are recognised as such.

    Raises
    ------
    DatasetError
        If it cannot be written.
    """
    try:
        begin_frames(folder / _MARK)
    except OSError as error:
        raise DatasetError(
            f"cannot write to {folder}: {reason_of(error)}; give another folder with --output"
        ) from error


def holds_run(folder: Path) -> bool:
    """Return whether a folder contains a run."""
    return is_frame_table(folder / _MARK)


def _is_only_begun(folder: Path) -> bool:
    """Return whether a killed run has left only its mark."""
    return [path.name for path in folder.iterdir()] == [_MARK] and has_no_frames(folder / _MARK)


def _results_in(folder: Path) -> Iterator[Path]:
    return (path for name in _RESULTS for path in sorted(folder.glob(name)))


def _other_work(folder: Path, settings: str) -> str | None:
    """Return a file that has the name of a result but is none."""
    if holds_run(folder):
        return None
    own = folder / _SETTINGS
    if own.is_file() and own.read_bytes() != settings.encode():
        return own.name
    return next((path.name for path in _results_in(folder)), None)


def link_latest(folder: Path) -> None:
    """Let ``runs/latest`` link to the newest run in ``runs`` (if links are possible)."""
    link = Path("runs") / "latest"
    if folder.resolve().parent != link.parent.resolve():
        return
    temporary = link.with_name(f".latest-{os.getpid()}")
    try:
        temporary.symlink_to(os.path.relpath(folder.resolve(), link.parent.resolve()))
        temporary.replace(link)
    except OSError as error:
        _log.debug("no link runs/latest: %s", error)
        with contextlib.suppress(OSError):
            temporary.unlink()


class OutputWriter:
    """Writes every result file of a run; a failure does not prevent the other files.

    Parameters
    ----------
    folder : Path
        The folder.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        #: Messages about files that could not be written, with the place of their copy.
        self.problems: list[str] = []
        self._rescue: Path | None = None
        self._written: set[str] = set()

    def write_all(
        self,
        result: RunResult,
        report: dict[str, Any],
        evaluation: RunEvaluation | None,
        *,
        page: bool = True,
    ) -> None:
        """Write all files of the run; the page and its images only on request."""
        self._write(_MARK, lambda path: write_frames(path, result.rows))
        if has_imu_states(result.rows):
            self._write("imu_states.csv", lambda path: write_imu_states(path, result.rows))
        self._write(_SETTINGS, result.settings.save)
        if result.imu_settings is not None:
            self._write("imu.yaml", result.imu_settings.save)
        self._write_trajectories(result, evaluation)
        points = anchored_points(result)
        unit = "m" if result.is_metric else "units"
        self._write("points.ply", lambda path: write_ply(path, points, unit=unit))
        if result.drawing is not None:
            self._write("map.npz", result.drawing.save)
        if len(result.tracked_trajectory()):
            self._write("trajectory.png", lambda path: draw_run(path, result, evaluation, report))
        if sum(not one.lost.all() for one in result.trajectories) > 1:
            self._write("maps.png", lambda path: draw_maps_of_run(path, result, report))
        self._write(
            "report.json", lambda path: _write_text(path, json.dumps(report, indent=2) + "\n")
        )
        self._remove_stale()  # before the page, which reads the folder
        if page:
            self._write_page(result, evaluation)

    def _write_page(self, result: RunResult, evaluation: RunEvaluation | None) -> None:
        worst = None if evaluation is None else worst_frames(result, evaluation)
        frames = choose_frames(result, worst)
        if frames and has_any_images(result):
            self._write("frame_images.zip", lambda path: write_frame_images(path, result, frames))
        # It is made from the other files, wherever they could be written: of one that is kept
        # elsewhere the folder has only the beginning.
        folders = [*([] if self._rescue is None else [self._rescue]), self.folder]
        self._write("report.html", lambda path: write_report_page(path, folders))

    def _remove_stale(self) -> None:
        """Remove files of an earlier run that this run does not have."""
        for path in (path for name in _NOT_ALWAYS for path in self.folder.glob(name)):
            if path.name not in self._written:
                with contextlib.suppress(OSError):
                    path.unlink()

    def _write_trajectories(self, result: RunResult, evaluation: RunEvaluation | None) -> None:
        main = result.trajectories[result.main_map]
        others = dict(enumerate(result.trajectories))
        del others[result.main_map]
        for number, trajectory in others.items():
            self._write_tum(f"trajectory_map{number}.txt", result, trajectory)
        self._write_tum("trajectory.txt", result, main)
        self._write_tum("trajectory_online.txt", result, result.online_trajectory())
        self._write_tum("keyframes.txt", result, result.keyframes)
        if evaluation is not None:
            truth = truth_of_frames(result, evaluation)
            self._write("groundtruth_aligned.txt", lambda path: write_tum(path, *truth))
        paths = [f"trajectory_map{n}.txt" for n, t in others.items() if not t.lost.all()]
        if main.lost.all() and paths:
            _log.warning(
                "no trajectory.txt: the last map has no pose; the path until then is in %s",
                ", ".join(paths),
            )
        if not main.lost.all():
            n_frames = len(result.rows)
            self._write("trajectory_kitti.txt", lambda path: write_kitti(path, main, n_frames))

    def _write_tum(self, name: str, result: RunResult, trajectory: Trajectory) -> None:
        if trajectory.lost.all():  # also if there are no poses at all
            return
        texts = [result.rows[int(i)].timestamp for i in trajectory.indices]
        self._write(name, lambda path: write_tum(path, trajectory, texts))

    def _write(self, name: str, write: Callable[[Path], object]) -> None:
        self._written.add(name)
        try:
            write(self.folder / name)
        except OSError as error:
            self._keep_elsewhere(name, write, error)
        except Exception as error:
            _log.exception("unexpected error; please report it")
            self.problems.append(f"cannot make {name}: {str(error) or type(error).__name__}")

    def _keep_elsewhere(self, name: str, write: Callable[[Path], object], error: OSError) -> None:
        message = f"cannot write {self.folder / name}: {reason_of(error)}"
        try:
            if self._rescue is None:
                self._rescue = Path(tempfile.mkdtemp(prefix="orbslam2py-"))
            write(self._rescue / name)
            message += f"; kept in {self._rescue / name}"
        except OSError as second:
            message += f"; neither in the temporary folder ({reason_of(second)})"
        self.problems.append(message)


def _write_text(path: Path, text: str) -> None:
    with atomic_write(path) as stream:
        stream.write(text)

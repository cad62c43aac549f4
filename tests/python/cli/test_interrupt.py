# SPDX-License-Identifier: BSD-3-Clause
"""Ctrl-C at any moment: exit code 130, results written, no hang, no traceback."""

from __future__ import annotations

import errno
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from orbslam2py.trajectory import read_tum
from support.command_line import RUN_FILES, Results
from support.forked import Forked

pytestmark = pytest.mark.watchdog(60)

N = 20

# Runs the command; sends Ctrl-C to itself when a function is called for the n-th time, or, if it is
# to be sent no times, tells that it came so far.
_DRIVER = """
import importlib, os, signal, sys

module, name, n, times, *arguments = sys.argv[1:]
owner = importlib.import_module(module)
for part in name.split(".")[:-1]:
    owner = getattr(owner, part)
name = name.split(".")[-1]
original = getattr(owner, name)
left = int(n)

def interrupting(*arguments, **named):
    global left
    left -= 1
    if left == 0:
        for _ in range(int(times)):
            os.kill(os.getpid(), signal.SIGINT)
        if times == "0":
            print("so far", flush=True)
    return original(*arguments, **named)

setattr(owner, name, interrupting)
signal.signal(signal.SIGINT, signal.default_int_handler)
sys.argv = ["orbslam2py", *arguments]
from orbslam2py.cli import main
print("ready", flush=True)
main()
"""


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    options = SyntheticOptions(world="corridor", sensor="rgbd", frames=N, size=(320, 240), speed=2)
    return SyntheticSequence(options).write(tmp_path_factory.mktemp("sequences") / "lap")


@pytest.fixture
def lap(original: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(original, tmp_path / "lap"))


@pytest.fixture(scope="module")
def slow_lap(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Recorded over 20 s: in real time no run ends before it is interrupted."""
    options = SyntheticOptions(
        world="corridor", sensor="rgbd", frames=N, size=(320, 240), fps=1.0, speed=0.1
    )
    return SyntheticSequence(options).write(tmp_path_factory.mktemp("slow") / "lap")


@pytest.fixture(scope="module")
def forked(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Forked]:
    made = Forked(tmp_path_factory.mktemp("forked"))
    yield made
    made.close()


RUN = ["run", "lap", "--sensor", "rgbd", "--output", "r"]


def run(
    forked: Forked, folder: Path, module: str, name: str, n: int, times: int, *options: str
) -> tuple[int, str]:
    """The same as `start` and `finish`, but with the package loaded before."""
    ended = forked.run(_DRIVER, [module, name, str(n), str(times), *RUN, *options], folder)
    return ended.code, without_faults(ended.err)


def start(
    folder: Path, module: str, name: str, n: int, times: int, *options: str, before: str = ""
) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", before + _DRIVER, module, name, str(n), str(times), *RUN, *options],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def finish(process: subprocess.Popen[str]) -> tuple[int, str]:
    try:
        _, err = process.communicate(timeout=40)
    finally:
        process.kill()
        process.wait()
    return process.returncode, without_faults(err)


def without_faults(err: str) -> str:
    assert "Traceback" not in err, err
    assert "terminate" not in err, err
    return err


MOMENTS = [
    # In the thread that reads images, in tracking, in mapping, at the end, while writing.
    ("orbslam2py.datasets.tum", "read_depth", 9, ()),
    ("orbslam2py._core", "match_local_map", 10, ()),
    ("orbslam2py._core", "local_bundle_adjustment", 1, ()),
    ("orbslam2py._core", "process_new_keyframe", 2, ("--deterministic",)),
    ("orbslam2py", "System.wait_until_idle", 1, ()),
    ("orbslam2py", "System.shutdown", 1, ()),
    ("orbslam2py.runs.report", "evaluate_trajectory", 1, ()),
    ("orbslam2py.runs.run_picture", "draw_trajectory", 1, ()),
    ("orbslam2py.runs.outputs", "OutputWriter._remove_stale", 1, ()),
]


@pytest.mark.parametrize(
    ("module", "name", "n", "options"), MOMENTS, ids=[moment[1] for moment in MOMENTS]
)
def test_once(
    lap: Path, forked: Forked, module: str, name: str, n: int, options: tuple[str, ...]
) -> None:
    code, err = run(forked, lap.parent, module, name, n, 1, *options)
    assert code == 130, err
    results = Results(lap.parent / "r")
    assert {path.name for path in results.folder.iterdir()} == RUN_FILES
    report = results.report
    rows = results.frames
    assert report["tracked"] == len(rows) == len(read_tum(results.folder / "trajectory.txt"))
    assert 1 <= len(rows) <= N
    assert report["seen_frames"] == len(rows)
    assert report["frames"] == N
    if report["interrupted"]:
        assert f"interrupted; saving the results so far ({len(rows)} of {N} frames)" in err
    else:
        assert len(rows) == N
    if module == "orbslam2py._core" and name == "match_local_map":
        assert len(rows) <= 11, "the run ends with the present frame"


def test_while_the_vocabulary_is_loaded(lap: Path, forked: Forked) -> None:
    code, err = run(forked, lap.parent, "orbslam2py.cli.run_and_show", "load_vocabulary", 1, 1)
    assert (code, err) == (130, "")
    assert not (lap.parent / "r").exists(), "nothing was computed"


def test_while_libraries_are_loaded(lap: Path) -> None:
    code, err = finish(start(lap.parent, "importlib.metadata", "version", 1, 1))
    assert (code, err.strip()) == (130, "")


@pytest.mark.parametrize("library", ["rich.table", "cv2.version"])
def test_while_one_library_is_loaded(lap: Path, library: str) -> None:
    """OpenCV drops every exception while it looks for its version."""
    press = (
        "import os, signal, sys\n"
        "def press(event, arguments):\n"
        f"    if event == 'import' and arguments[0] == {library!r}:\n"
        "        os.kill(os.getpid(), signal.SIGINT)\n"
        "sys.addaudithook(press)\n"
    )
    code, err = finish(start(lap.parent, "time", "ctime", 1, 1, before=press))
    assert (code, err.strip()) == (130, "")
    assert not (lap.parent / "r").exists(), "nothing was computed"


def test_while_arguments_are_read(lap: Path) -> None:
    """Python drops what is raised in a callback of a weak reference, which each import has."""
    press = (
        "import os, signal, weakref, typer.core\n"
        "read = typer.core.TyperGroup.parse_args\n"
        "class Lock: pass\n"
        "def press(_):\n"
        "    os.kill(os.getpid(), signal.SIGINT)\n"
        "    for _ in range(100): pass\n"  # meanwhile it is handled
        "def reading(*arguments):\n"
        "    lock = Lock()\n"
        "    watched = weakref.ref(lock, press)\n"
        "    del lock\n"
        "    return read(*arguments)\n"
        "typer.core.TyperGroup.parse_args = reading\n"
    )
    code, err = finish(start(lap.parent, "time", "ctime", 1, 1, before=press))
    assert (code, err.strip()) == (130, "")
    assert not (lap.parent / "r").exists(), "nothing was computed"


def open_for_a_reader(pipe: Path) -> int:
    """Open a pipe for writing once somebody reads from it."""
    end = time.monotonic() + 30
    while True:
        try:
            return os.open(pipe, os.O_WRONLY | os.O_NONBLOCK)
        except OSError as error:
            if error.errno != errno.ENXIO or time.monotonic() > end:
                raise
        time.sleep(0.01)


def test_while_an_image_does_not_come(lap: Path) -> None:
    """A network drive that hangs: here a pipe into which nobody writes is read in its place."""
    pipe = lap.parent / "pipe"
    os.mkfifo(pipe)
    name = sorted((lap / "rgb").iterdir())[12].name
    hang = (
        "import pathlib\n"
        "read = pathlib.Path.read_bytes\n"
        f"pathlib.Path.read_bytes = lambda self: read("
        f"pathlib.Path({str(pipe)!r}) if self.name == {name!r} else self)\n"
    )
    process = start(lap.parent, "orbslam2py.cli.display", "Display.show", 12, 0, before=hang)
    writing = open_for_a_reader(pipe)
    try:
        assert process.stdout is not None
        assert [process.stdout.readline() for _ in range(2)] == ["ready\n", "so far\n"]
        process.send_signal(signal.SIGINT)
        code, err = finish(process)
    finally:
        os.close(writing)
    assert code == 130
    assert "an image is still being read" in err
    assert Results(lap.parent / "r").report["tracked"] == 12
    assert {path.name for path in (lap.parent / "r").iterdir()} == RUN_FILES


def test_twice_while_writing_gives_up(lap: Path, forked: Forked) -> None:
    place = "orbslam2py.runs.run_picture"
    code, _ = run(forked, lap.parent, place, "draw_trajectory", 1, 2)
    assert code == 130
    names = {path.name for path in (lap.parent / "r").iterdir()}
    assert "trajectory.txt" in names
    assert not any(name.endswith(".tmp") for name in names)


@pytest.mark.parametrize("delay", [0.05, 0.5, 1.2])
def test_any_moment(slow_lap: Path, tmp_path: Path, delay: float) -> None:
    (tmp_path / "lap").symlink_to(slow_lap)
    process = start(tmp_path, "time", "ctime", 1, 1, "--realtime")
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    time.sleep(delay)
    process.send_signal(signal.SIGINT)
    code, err = finish(process)
    assert code == 130, err
    report = tmp_path / "r" / "report.json"
    assert report.is_file() == (tmp_path / "r").is_dir()


def test_ignored_in_the_background(lap: Path) -> None:
    """Where a shell has made a job deaf to Ctrl-C it stays deaf."""
    code = (
        "import os, signal, sys\n"
        "signal.signal(signal.SIGINT, signal.SIG_IGN)\n"
        "print('ready', flush=True)\n"
        "os.execv(sys.executable, [sys.executable, '-m', 'orbslam2py', *sys.argv[1:]])\n"
    )
    arguments = [*RUN, "--realtime", "--quiet"]
    process = subprocess.Popen(
        [sys.executable, "-c", code, *arguments],
        cwd=lap.parent,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    time.sleep(1.0)
    process.send_signal(signal.SIGINT)
    code_at_end, err = finish(process)
    assert (code_at_end, err) == (0, "")
    report = Results(lap.parent / "r").report
    assert (report["frames"], report["interrupted"]) == (N, False)

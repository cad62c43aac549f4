# SPDX-License-Identifier: BSD-3-Clause
"""Programs that save a map and are killed at a random moment: every file must open and be whole.

    python -m benchmarks.map_files.kills --runs 1000

Each run saves or autosaves a growing map again and again until SIGKILL. Afterwards the file is
missing (the first save had not ended), or it is loaded whole, its invariants hold, and it is at
least as large as the last commit that the program reported. The programs are forks of this one, so
that a run costs little more than the time until it is killed; `--first` continues earlier runs.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import random
import signal
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

from benchmarks.map_files.mapping import corridor, mapped
from orbslam2py import System
from orbslam2py import _core as core
from orbslam2py.datasets import Frame
from orbslam2py.maps import SavedMap, load_map, restore_contents, save_map

#: So many keyframes may have been culled since the last reported save.
CULLED = 3
#: Frames of the corridor that are tracked, those of the map to begin with among them.
FRAMES = 60
#: Seconds until the kill, from the first save on.
LONGEST = 0.4


def forked(work: Callable[[int], object]) -> tuple[int, int]:
    """Let a child do some work; its process id, and where it can be heard.

    Parameters
    ----------
    work
        Gets the descriptor that it may write to.
    """
    heard, tells = os.pipe()
    process = os.fork()
    if process == 0:
        try:
            work(tells)
        finally:
            os._exit(1)
    os.close(tells)
    return process, heard


def victim(path: Path, start: SavedMap, frames: list[Frame], how: str, tells: int) -> NoReturn:
    """Map and save until the process is killed; reports the number of saved keyframes."""
    with System(load_map=start, wait_for_mapping=True) as slam:
        if how == "autosave":
            slam.autosave(path, every=0.005)
        for number, frame in enumerate(frames):
            slam.track_rgbd(frame.images.image, frame.images.depth, frame.timestamp)
            if how == "save" or number % 10 == 9:
                n = len(slam.map_contents().keyframes)
                slam.save_map(path)
                os.write(tells, f"{n}\n".encode())
        while True:
            slam.save_map(path)


def what_was_told(first: bytes, heard: int) -> list[int]:
    """Numbers of keyframes; a last line may be cut short."""
    with os.fdopen(heard, "rb") as stream:
        return [int(line) for line in (first + stream.read()).split(b"\n")[:-1]]


def one_run(
    folder: Path, start: SavedMap, frames: list[Frame], how: str, seconds: float
) -> tuple[str, str]:
    """Kill a victim; what became of its file, and what is wrong with it."""
    for old in folder.glob("*map.orbmap*"):
        old.unlink()
    path = folder / "map.orbmap"
    process, heard = forked(lambda tells: victim(path, start, frames, how, tells))
    first = os.read(heard, 1)  # it is at work: from here on
    time.sleep(seconds)
    with contextlib.suppress(ProcessLookupError):
        os.kill(process, signal.SIGKILL)
    _, status = os.waitpid(process, 0)
    told = what_was_told(first, heard)
    if not first or not os.WIFSIGNALED(status):
        return "failed", "the program ended before it was killed"
    if not path.exists():
        return "missing", "a save had ended, but there is no file"
    try:
        contents = load_map(path).contents
        violations = core.check_invariants(restore_contents(contents), require_words=False)
    except Exception as error:
        return "refused", str(error)
    if violations:
        return "inconsistent", violations[0]
    if told and len(contents.keyframes) < told[-1] - CULLED:
        return "old", f"{len(contents.keyframes)} keyframes, {told[-1]} had been saved"
    return "whole", ""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--first", type=int, default=0, help="number of the first run")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--folder", type=Path, help="where the files are written, such as a tmpfs")
    arguments = parser.parse_args()
    bad = 0
    with tempfile.TemporaryDirectory(dir=arguments.folder) as name:
        folder = Path(name)
        # In a child: a parent of forks must have no threads, not even idle ones.
        process, heard = forked(lambda _: save_start(folder / "start.orbmap"))
        os.close(heard)
        os.waitpid(process, 0)
        start = load_map(folder / "start.orbmap")
        sequence = corridor(FRAMES)
        frames = list(sequence)
        for run in range(arguments.first, arguments.first + arguments.runs):
            draws = random.Random(arguments.seed * 1_000_003 + run)
            how = ("save", "autosave")[run % 2]
            result, why = one_run(folder, start, frames, how, draws.uniform(0, LONGEST))
            if result != "whole":
                bad += 1
                print(f"run {run}, {how}: {result}: {why}", flush=True)
    print(f"{arguments.runs} killed, {bad} bad files")
    return 1 if bad else 0


def save_start(path: Path) -> None:
    """The map that all runs begin with."""
    save_map(mapped(20), path)


if __name__ == "__main__":
    sys.exit(main())

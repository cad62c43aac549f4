# SPDX-License-Identifier: BSD-3-Clause
"""Programs that save a map and are killed at a random moment: every file must open and be whole.

    python -m benchmarks.map_files.kills --runs 1000

Each run saves or autosaves a growing map again and again until SIGKILL. Afterwards the file is
missing (the first save had not ended), or it is loaded whole, its invariants hold, and it is at
least as large as the last commit that the program told of.
"""

from __future__ import annotations

import argparse
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.map_files.mapping import corridor, mapped
from orbslam2py import System
from orbslam2py import _core as core
from orbslam2py.maps import load_map, restore_contents, save_map

#: So many keyframes may have been culled since the last save that was told of.
CULLED = 3


def victim(folder: Path, how: str) -> None:
    """Map and save until somebody kills us; tells how many keyframes were saved."""
    start = load_map(folder / "start.orbmap")
    sequence = corridor(80)
    path = folder / "map.orbmap"
    with System(load_map=start, wait_for_mapping=True) as slam:
        if how == "autosave":
            slam.autosave(path, every=0.005)
        for frame in sequence:
            slam.track_rgbd(frame.images.image, frame.images.depth, frame.timestamp)
            if how == "save" or frame.index % 10 == 9:
                n = len(slam.map_contents().keyframes)
                slam.save_map(path)
                print(n, flush=True)
        while True:
            slam.save_map(path)


def one_run(folder: Path, how: str, seconds: float) -> tuple[str, str]:
    """Kill a victim; what became of its file, and what is wrong with it."""
    for old in folder.glob("*map.orbmap*"):
        old.unlink()
    command = [sys.executable, "-m", "benchmarks.map_files.kills", "--victim", str(folder), how]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        process.stdout.readline()  # it is at work: from here on
        time.sleep(seconds)
        process.send_signal(signal.SIGKILL)
        told = [int(line) for line in process.stdout.read().split()]
    path = folder / "map.orbmap"
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
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--folder", type=Path, help="where the files are written, such as a tmpfs")
    parser.add_argument("--victim", nargs=2, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.victim:
        victim(Path(arguments.victim[0]), arguments.victim[1])
    draws = random.Random(arguments.seed)
    bad = 0
    with tempfile.TemporaryDirectory(dir=arguments.folder) as name:
        folder = Path(name)
        save_map(mapped(20), folder / "start.orbmap")
        for run in range(arguments.runs):
            how = ("save", "autosave")[run % 2]
            result, why = one_run(folder, how, draws.uniform(0, 1.5))
            if result != "whole":
                bad += 1
                print(f"run {run}, {how}: {result}: {why}", flush=True)
    print(f"{arguments.runs} killed, {bad} bad files")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())

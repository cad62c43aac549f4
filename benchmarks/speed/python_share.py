# SPDX-License-Identifier: BSD-3-Clause
"""How much of a frame's time is Python between the C++ steps.

Every function, method and property of the extension that orchestration uses is replaced by one that
also notes its time; the rest of the track call is Python. Mapping runs inline (deterministic mode),
so that no other thread's use of the interpreter is counted on either side. The noting itself costs
time outside the noted time as well: in every second frame each call is followed by a noted call
that does nothing, and by how much that makes the frame's Python longer is taken off once.
C++ objects are kept alive until the call is over, so that freeing their memory, which is no work of
Python's, counts on neither side.

    python -m benchmarks.speed.python_share FOLDER rgbd
"""

from __future__ import annotations

import inspect
import json
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.harness import reference
from benchmarks.harness.arguments import new_parser
from benchmarks.harness.folders import MISSING, sequence_folder, shared_folder
from benchmarks.harness.runs import run_module
from benchmarks.harness.tables import new_table, verdict
from orbslam2py import Sensor, System, open_sequence
from orbslam2py import _core as core

#: A single camera has no second image.
WITH_DEPTH = (Sensor.STEREO, Sensor.RGBD)

#: All classes of the extension.
_CLASSES = tuple(
    kind
    for kind in vars(core).values()
    if inspect.isclass(kind) and kind.__module__ == core.__name__
)


def _nothing() -> None:
    pass


class CoreClock:
    """Seconds spent inside the extension."""

    def __init__(self) -> None:
        self.seconds = 0.0
        self.calls = 0
        self.kept: list[object] = []
        self.note_twice = False
        self._note_nothing = self._noted(_nothing)

    def _noted(self, function: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any, **options: Any) -> Any:
            begin = time.perf_counter()
            result = function(*arguments, **options)
            self.seconds += time.perf_counter() - begin
            self.calls += 1
            self.kept.append((arguments, result))
            return result

        return call

    def timed(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """The same function, noting its time."""
        noted = self._noted(function)

        def call(*arguments: Any, **options: Any) -> Any:
            if self.note_twice:
                self._note_nothing()
            return noted(*arguments, **options)

        return call

    def install(self) -> None:
        """Replace the functions and methods of the extension, for the rest of the process."""
        for name, function in list(vars(core).items()):
            if inspect.isbuiltin(function):
                setattr(core, name, self.timed(function))
        for kind in _CLASSES:
            for name, member in list(vars(kind).items()):
                if type(member) is property:
                    setattr(kind, name, property(self.timed(member.fget), member.fset))
                elif name in ("__init__", "__matmul__") or (
                    not name.startswith("_")
                    and callable(member)
                    and not isinstance(member, staticmethod)
                ):
                    setattr(kind, name, self.timed(member))


@dataclass(frozen=True)
class PythonShare:
    """Medians over the frames of a sequence; means with the keyframes."""

    frames: int
    milliseconds: float
    """Of a track call."""
    python_milliseconds: float
    noting_milliseconds: float
    """Cost of the measurement, already taken off both."""
    calls: float
    """Of the extension, per frame."""

    @property
    def share(self) -> float:
        return self.python_milliseconds / self.milliseconds


def measure(folder: Path, sensor: Sensor, *, tracking_only: bool) -> PythonShare:
    """Track a sequence; with `tracking_only` leave out the frames that became keyframes."""
    sequence = open_sequence(folder, sensor)
    # All images first: no decoding thread competes.
    images = [sequence.load(i) for i in range(len(sequence))]
    clock = CoreClock()
    clock.install()
    once: list[tuple[float, float, int]] = []
    # Python's seconds in frames that are not keyframes, noted once and twice.
    between_of: tuple[list[float], list[float]] = ([], [])
    with System(sequence.settings, sensor, deterministic=True) as system:
        track = system.track_stereo if sensor is Sensor.STEREO else system.track_rgbd
        for i, (image, timestamp) in enumerate(zip(images, sequence.timestamps, strict=True)):
            second = image.right if sensor is Sensor.STEREO else image.depth
            clock.seconds, clock.calls, clock.note_twice = 0.0, 0, bool(i % 2)
            begin = time.perf_counter()
            record = track(image.image, second, float(timestamp))
            elapsed = time.perf_counter() - begin
            clock.kept.clear()
            between = elapsed - clock.seconds
            if not record.is_keyframe:
                between_of[clock.note_twice].append(between)
            if i == 0:
                continue  # what is loaded once counts as start of the run
            if not clock.note_twice and not (tracking_only and record.is_keyframe):
                once.append((elapsed, between, clock.calls))
    # Mapping happens at keyframes only: medians would not see it.
    average = np.median if tracking_only else np.mean
    elapsed, between, calls = (float(value) for value in average(once, axis=0))
    noting = max(0.0, float(np.median(between_of[True]) - np.median(between_of[False])))
    return PythonShare(
        len(once), 1e3 * (elapsed - noting), 1e3 * (between - noting), 1e3 * noting, calls
    )


# ---- table ---------------------------------------------------------------------------------------
def python_tables() -> Iterator[object]:
    """The share in every sequence, each measured in a separate process."""
    if shared_folder() is None:
        yield f"[yellow]Python's share: left out, {MISSING}"
        return
    table = new_table(
        "Python's share of a frame: between the C++ steps",
        ["sequence", "frames"],
        ["ms a frame", "Python ms", "calls of C++", "share", "limit", "met"],
        "Every function, method and property of the extension is wrapped to\n"
        "note its time, the rest of the track call is Python (benchmarks/speed/python_share.py).\n"
        "Mapping inline: no other thread uses the interpreter. Freeing C++ objects counts on "
        "neither side.",
    )
    for figure in reference.SEQUENCES:
        for label, options in (
            ("all, with mapping: mean", []),
            ("not keyframes: median", ["--tracking-only"]),
        ):
            folder = str(sequence_folder(figure.folder))
            share = run_module("benchmarks.speed.python_share", folder, figure.sensor, *options)
            table.add_row(
                figure.name,
                label,
                f"{share['milliseconds']:.2f}",
                f"{share['python_milliseconds']:.3f}",
                f"{share['calls']:.0f}",
                f"{100 * share['share']:.1f} %",
                f"{100 * reference.PYTHON_SHARE:g} %",
                verdict(share["share"] < reference.PYTHON_SHARE),
            )
    yield table


# ---- command line --------------------------------------------------------------------------------
def main() -> None:
    parser = new_parser(__doc__)
    parser.add_argument("folder", type=Path, help="a sequence")
    parser.add_argument("sensor", type=Sensor, choices=WITH_DEPTH, help="of the sequence")
    parser.add_argument("--tracking-only", action="store_true", help="leave out new keyframes")
    arguments = parser.parse_args()
    share = measure(arguments.folder, arguments.sensor, tracking_only=arguments.tracking_only)
    print(json.dumps({**asdict(share), "share": share.share}))


if __name__ == "__main__":
    main()

# SPDX-License-Identifier: BSD-3-Clause
"""Our speed beside the original's, carried to this machine by a yardstick.

The yardstick is OpenCV's own ORB in one thread. It is measured in turns with each step, so that
both see the same state of the machine; "there" means the machine of the reference's figures.

    python -m benchmarks.speed.compare                 everything that this checkout allows
    python -m benchmarks.speed.compare --only steps    only a part

The curve of the costs of loops goes to build/bench/loop_cost.png.
"""

from __future__ import annotations

import argparse
import os
import platform
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
from rich.console import Console

from benchmarks.harness import reference
from benchmarks.harness.tables import new_table, verdict
from benchmarks.harness.yardstick import Yardstick
from benchmarks.loops import cost as loop_cost
from benchmarks.speed import single_steps as steps
from benchmarks.speed import vocabularies
from benchmarks.speed.sequences import lock_tables, program_rows, python_table, sequence_tables
from benchmarks.speed.single_steps import Row

PARTS = ("steps", "vocabularies", "sequences", "python", "locks", "loops")


def steps_table(title: str, rows: list[Row]) -> object:
    table = new_table(
        title,
        ["step"],
        [
            "here ms\nmedian (min)",
            "yardsticks\nours",
            "there ms\nours",
            "there ms\nreference",
            "yardsticks\nreference",
            "ours /\nreference",
            "there ms\ntarget",
            "met",
        ],
    )
    notes = []
    for row in rows:
        m, figure = row.measured, row.figure
        theirs, target = figure.milliseconds, figure.target
        unit = m.yardstick_there
        table.add_row(
            row.name,
            f"{m.ours.median:.3g} ({m.ours.least:.3g})",
            f"{m.ours.median / m.yardstick.median:.3g}",
            f"{m.carried:.3g}",
            f"{theirs:.4g}" if theirs else "",
            f"{theirs / unit:.3g}" if theirs else "",
            f"{m.carried / theirs:.2f}" if theirs else "",
            f"{target:.3g}" if target else "",
            _verdict(row),
        )
        if row.note:
            notes.append(f"{row.name}: {row.note}")
    table.caption = "\n".join(notes)
    table.caption_justify = "left"
    return table


def loop_tables(yardstick: Yardstick, build: Path, pictures: Path) -> Iterator[object]:
    """Steps of closing a loop, by size of the map; draws the curve."""
    missing = loop_cost.missing_programs(build)
    if missing:
        yield (
            f"[yellow]Loops: left out, {build} lacks {', '.join(missing)} "
            "(cmake --preset release, then cmake --build build/release --target benchmarks)"
        )
        return
    measured = loop_cost.measure(yardstick, build)
    yield steps_table(
        f"Closing a loop in a map of {loop_cost.LIMIT_SIZE} keyframes",
        list(loop_cost.rows(measured)),
    )
    yield loop_cost.sizes_table(measured)
    picture = pictures / "loop_cost.png"
    loop_cost.draw(measured, picture)
    yield f"Curve: {picture}"
    yield loop_cost.tracking_table()


def _verdict(row: Row) -> str:
    target = row.figure.target
    if target is None:
        return ""
    return "stand-in" if row.stand_in else verdict(row.measured.carried <= target)


def machine(console: Console, yardstick: Yardstick) -> None:
    """What the figures were measured on."""
    model = next(
        (
            line.split(":", 1)[1].strip()
            for line in Path("/proc/cpuinfo").read_text().splitlines()
            if line.startswith("model name")
        ),
        platform.processor(),
    )
    load = ", ".join(f"{value:.1f}" for value in os.getloadavg())
    console.print(
        f"{model}, {os.cpu_count()} processors, load {load}; Python {platform.python_version()}, "
        f"opencv-python {cv2.__version__}"
    )
    for name, (n, there) in reference.YARDSTICK.items():
        measured = yardstick.compare(lambda name=name: yardstick.run(name), name, 15)  # type: ignore[misc]
        console.print(
            f"yardstick {name} ({n} features): {measured.yardstick.median:.2f} ms here "
            f"(least {measured.yardstick.least:.2f}), {there} there"
        )
        if measured.yardstick.median > 1.2 * measured.yardstick.least:
            console.print(
                "[yellow]Other programs disturb: short steps suffer less than the yardstick, long "
                "ones more. Trust the least times, or come back later."
            )
    if not yardstick.exact:
        console.print(
            "[yellow]The extra data are missing (ORBSLAM2PY_SHARED): synthetic images stand in for "
            "the photographs, and the sequences are left out. Figures carried over are rough."
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--only", choices=PARTS, action="append", help="only this part (repeatable)"
    )
    parser.add_argument("--runs", type=int, default=5, help="runs of each sequence")
    parser.add_argument(
        "--build", type=Path, default=Path("build/release"), help="build folder of the benchmarks"
    )
    parser.add_argument(
        "--pictures", type=Path, default=Path("build/bench"), help="folder of the curves"
    )
    parser.add_argument("--width", type=int, default=150, help="columns of the output")
    arguments = parser.parse_args()
    chosen = set(arguments.only or PARTS)
    console = Console(width=arguments.width)
    yardstick = Yardstick()
    machine(console, yardstick)

    with tempfile.TemporaryDirectory() as folder:
        large = None
        if chosen & {"steps", "vocabularies"}:
            large = vocabularies.make_large_vocabulary()
        if "steps" in chosen:
            sources: list[Callable[[Yardstick], Iterator[Row]]] = [
                steps.extraction_rows,
                steps.stereo_rows,
                steps.pose_rows,
                steps.bundle_rows,
                lambda y: steps.words_rows(y, large),
                lambda y: program_rows(y, arguments.build),
            ]
            rows = [row for source in sources for row in source(yardstick)]
            console.print(steps_table("Single steps, one thread", rows))
        if "vocabularies" in chosen and large is not None:
            files = vocabularies.VocabularyFiles.write(large, Path(folder))
            rows = list(vocabularies.vocabulary_rows(yardstick, files))
            console.print(steps_table("Vocabulary until the first image is described", rows))
    library = arguments.build / "benchmarks" / "cpp" / "liblock_times.so"
    for part, tables in (
        ("sequences", lambda: sequence_tables(yardstick, arguments.runs)),
        ("python", python_table),
        ("locks", lambda: lock_tables(library)),
        ("loops", lambda: loop_tables(yardstick, arguments.build, arguments.pictures)),
    ):
        if part in chosen:
            for table in tables():
                console.print(table)
    console.print(
        "Not here, because they take minutes: benchmarks.memory (memory over 100 000 frames), "
        "benchmarks.accuracy.accuracy (errors of all sequences), "
        "benchmarks.accuracy.place_recognition"
    )


if __name__ == "__main__":
    sys.exit(main())

# SPDX-License-Identifier: BSD-3-Clause
"""Our speed beside the original's, carried to this machine by a yardstick.

The yardstick is OpenCV's own ORB in one thread. It is measured in turns with each step, so that
both see the same state of the machine; "there" means the machine of the reference's figures.

    python -m benchmarks.speed.compare                 everything that this checkout allows
    python -m benchmarks.speed.compare --only steps    only a part

The curve of the costs of loops goes to build/bench/loop_cost.png.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

from benchmarks.harness.arguments import add_build, add_counts, add_width, console_of, new_parser
from benchmarks.harness.machine import print_machine
from benchmarks.harness.steps import steps_table
from benchmarks.harness.yardstick import Yardstick
from benchmarks.loops.cost import loop_tables
from benchmarks.speed import single_steps, vocabularies
from benchmarks.speed.locks import lock_tables
from benchmarks.speed.python_share import python_tables
from benchmarks.speed.sequences import sequence_tables
from benchmarks.speed.viewer_cost import viewer_tables
from benchmarks.speed.viewer_share import share_tables
from orbslam2py import _core as core

PARTS = ("steps", "vocabularies", "sequences", "python", "viewer", "locks", "loops")


def single_step_tables(
    yardstick: Yardstick, build: Path, large: core.Vocabulary
) -> Iterator[object]:
    """One table of all steps."""
    rows = [
        *single_steps.extraction_rows(yardstick),
        *single_steps.stereo_rows(yardstick),
        *single_steps.pose_rows(yardstick),
        *single_steps.bundle_rows(yardstick),
        *single_steps.words_rows(yardstick, large),
        *single_steps.fuse_rows(yardstick, build),
    ]
    yield steps_table("Single steps, one thread", rows)


def vocabulary_tables(yardstick: Yardstick, large: core.Vocabulary) -> Iterator[object]:
    """Files are written for the time of the measurement."""
    with tempfile.TemporaryDirectory() as folder:
        files = vocabularies.VocabularyFiles.write(large, Path(folder))
        rows = vocabularies.vocabulary_rows(yardstick, files)
        yield steps_table("Vocabulary until the first image is described", rows)


def main() -> None:
    parser = new_parser(__doc__)
    parser.add_argument(
        "--only", choices=PARTS, action="append", help="only this part (repeatable)"
    )
    add_counts(parser, runs=(5, "runs of each sequence"))
    add_build(parser)
    add_width(parser)
    arguments = parser.parse_args()
    chosen = arguments.only or PARTS
    console = console_of(arguments)
    yardstick = Yardstick()
    print_machine(console, yardstick)
    build = arguments.build
    large = None
    if {"steps", "vocabularies"} & set(chosen):
        large = vocabularies.make_large_vocabulary()
    parts = {
        "steps": lambda: single_step_tables(yardstick, build, large),
        "vocabularies": lambda: vocabulary_tables(yardstick, large),
        "sequences": lambda: sequence_tables(yardstick, arguments.runs),
        "python": python_tables,
        "viewer": lambda: chain(viewer_tables(arguments.runs), share_tables(10.0)),
        "locks": lambda: lock_tables(build),
        "loops": lambda: loop_tables(yardstick, build, arguments.pictures),
    }
    for part, tables in parts.items():
        if part in chosen:
            for table in tables():
                console.print(table)
    console.print(
        "Not here, because they take minutes: benchmarks.memory (memory over 100 000 frames), "
        "benchmarks.accuracy.accuracy (errors of all sequences), "
        "benchmarks.accuracy.place_recognition, benchmarks.loops.quality"
    )


if __name__ == "__main__":
    main()

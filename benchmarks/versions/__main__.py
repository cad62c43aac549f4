# SPDX-License-Identifier: BSD-3-Clause
"""This version beside another one: how long each takes to build, and its kernels of images.

Built are the package as ``pip install .`` configures it and the C++ part of ``make test``, from
nothing and without the compiler cache. The extensions that come of it then extract features and
match stereo pairs in turns, with every vector unit that they and this processor have.

    python -m benchmarks.versions
    python -m benchmarks.versions --before v0.1.0 --only package
"""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from benchmarks.harness.arguments import add_counts, add_width, console_of, new_parser
from benchmarks.harness.tables import new_table, verdict
from benchmarks.versions.building import CHECKOUT, GOAL, PARTS, TIMES, build, unpack
from benchmarks.versions.kernels import kernel_tables


def main() -> None:
    """Build, measure, and print tables."""
    parser = new_parser(__doc__)
    parser.add_argument("--only", nargs="+", choices=PARTS, default=PARTS, help="[all]")
    parser.add_argument("--before", metavar="COMMIT", help="the other version")
    add_counts(
        parser,
        jobs=(os.cpu_count() or 1, "compilers at a time"),
        slowest=(8, "files named"),
        rounds=(100, "times that each kernel is run"),
    )
    add_width(parser)
    arguments = parser.parse_args()
    console = console_of(arguments)
    table = new_table("Building", ["what", "version"], ["processor minutes", "goal", "met"])
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        versions = {"this": CHECKOUT}
        if arguments.before:
            versions = {arguments.before: unpack(arguments.before, folder)} | versions
        for part in arguments.only:
            goal = GOAL if part == "package" else GOAL * TIMES
            for version, source in versions.items():
                built = build(part, source, folder / f"{part}-{version}", arguments.jobs)
                told = f"{goal:.1f}", verdict(built.minutes <= goal)
                table.add_row(part, version, f"{built.minutes:.1f}", *told)
                for seconds, file in built.slowest[: arguments.slowest]:
                    console.print(f"{part}, {version}: {seconds:6.1f} s {file}", highlight=False)
        console.print(table)
        if "package" in arguments.only:
            extensions = {
                version: (source, folder / f"package-{version}")
                for version, source in versions.items()
            }
            for kernels in kernel_tables(extensions, folder, arguments.rounds):
                console.print(kernels)


if __name__ == "__main__":
    main()

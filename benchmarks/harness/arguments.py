# SPDX-License-Identifier: BSD-3-Clause
"""Command lines of the programs: options that several have are described here."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from rich.console import Console

from orbslam2py.settings.sensor import WITHOUT_RIG

SENSORS = tuple(str(sensor) for sensor in WITHOUT_RIG)


def new_parser(doc: str | None) -> argparse.ArgumentParser:
    """Parser whose help begins with the words of the module."""
    program = sys.modules["__main__"].__spec__
    return argparse.ArgumentParser(
        prog=None if program is None else f"python -m {program.name}",
        description=doc,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )


def add_width(parser: argparse.ArgumentParser, columns: int = 150) -> None:
    """Option of the tables."""
    parser.add_argument("--width", type=int, default=columns, help="columns of the output")


def add_build(parser: argparse.ArgumentParser) -> None:
    """Options of what runs C++ programs and draws curves."""
    parser.add_argument(
        "--build", type=Path, default=Path("build/release"), help="build folder of the benchmarks"
    )
    parser.add_argument(
        "--pictures", type=Path, default=Path("build/bench"), help="folder of the curves"
    )


def add_sensors(parser: argparse.ArgumentParser) -> None:
    """Option of what runs with several sensors: any of them, all by default."""
    parser.add_argument("--sensors", nargs="+", choices=SENSORS, default=SENSORS, help="[all]")


def add_counts(parser: argparse.ArgumentParser, **counts: tuple[int, str]) -> None:
    """Options that count something: default and help by name."""
    for name, (default, words) in counts.items():
        option = f"--{name.replace('_', '-')}"
        parser.add_argument(option, type=int, default=default, help=f"{words} [{default}]")


def console_of(arguments: argparse.Namespace) -> Console:
    """Where tables go."""
    return Console(width=arguments.width)

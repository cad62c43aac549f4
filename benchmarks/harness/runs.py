# SPDX-License-Identifier: BSD-3-Clause
"""Runs in separate processes: whole sequences, programs of this package, C++ programs."""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.harness.folders import built

Record = dict[str, float]
"""Counters of one C++ benchmark."""


def run_report(
    folder: Path,
    sensor: str,
    *options: str,
    environment: dict[str, str] | None = None,
    python: str = sys.executable,
) -> dict[str, Any]:
    """``orbslam2py run`` with these options; returns report.json.

    Parameters
    ----------
    folder
        Of the sequence.
    sensor
        What it is run with.
    options
        Further ones of the command.
    environment
        Variables that differ.
    python
        The interpreter, of another version perhaps.

    Raises
    ------
    RuntimeError
        With the program's words, if it fails.
    """
    with tempfile.TemporaryDirectory() as output:
        command = [python, "-m", "orbslam2py", "run", str(folder), "--sensor", sensor]
        _output_of([*command, *options, "--output", output, "--force", "--quiet"], environment)
        report: dict[str, Any] = json.loads((Path(output) / "report.json").read_text())
        return report


def median_of(reports: Sequence[dict[str, Any]], *keys: str) -> float:
    """Median of what the reports hold under these keys, one in the other; NaN where none does."""
    values = []
    for report in reports:
        value: Any = report
        for key in keys:
            value = value[key]
        if value is not None:
            values.append(float(value))
    return statistics.median(values) if values else float("nan")


def run_module(name: str, *options: str) -> dict[str, Any]:
    """A program of this package that prints JSON; returns what it printed.

    Raises
    ------
    RuntimeError
        With the program's words, if it fails.
    """
    printed: dict[str, Any] = json.loads(_output_of([sys.executable, "-m", name, *options]))
    return printed


def benchmark_records(build: Path, program: str, pattern: str, *options: str) -> dict[str, Record]:
    """Run benchmarks of a Google Benchmark program.

    Returns
    -------
    dict
        Counters by the benchmark's name without the numbers of iterations.

    Raises
    ------
    RuntimeError
        With the program's words, if it fails.
    """
    command = [str(built(build, program)), "--benchmark_format=json"]
    command += [f"--benchmark_filter={pattern}", *options]
    rows = json.loads(_output_of(command))["benchmarks"]
    failed = [row for row in rows if row.get("error_occurred")]
    if failed or not rows:
        raise RuntimeError(f"{' '.join(command)}: {failed or 'nothing was measured'}")
    return {row["name"].split("/iterations:")[0].split("/manual")[0]: row for row in rows}


def _output_of(command: Sequence[str], environment: dict[str, str] | None = None) -> str:
    done = subprocess.run(
        command,
        capture_output=True,
        text=True,
        env={**os.environ, **(environment or {})},
        check=False,
    )
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)}: {done.stderr}")
    return done.stdout

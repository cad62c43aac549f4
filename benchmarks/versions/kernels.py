# SPDX-License-Identifier: BSD-3-Clause
"""Kernels of images of several versions, measured in turns."""

from __future__ import annotations

import os
import shutil
import statistics
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.table import Table

from benchmarks.harness import reference
from benchmarks.harness.tables import new_table
from benchmarks.harness.yardstick import Yardstick
from benchmarks.speed.single_steps import stereo_pair


@dataclass(frozen=True)
class Contender:
    """One version with one vector unit."""

    server: subprocess.Popen[str]
    version: str
    unit: str

    def milliseconds(self, command: str) -> float:
        """Processor time of one piece of work."""
        assert self.server.stdin is not None
        assert self.server.stdout is not None
        self.server.stdin.write(command + "\n")
        self.server.stdin.flush()
        answer = self.server.stdout.readline()
        if not answer:
            raise SystemExit(f"the extension of {self.version} has ended at: {command}")
        return float(answer)


def kernel_tables(
    extensions: dict[str, tuple[Path, Path]], folder: Path, rounds: int
) -> Iterator[Table]:
    """Tables of extraction and of stereo matching.

    Parameters
    ----------
    extensions : dict
        Source and build folder of each version, the older one first.
    folder : Path
        Where packages and images are written.
    rounds : int
        Times that each kernel is run.
    """
    images = folder / "images.npz"
    extraction, stereo = write_images(images)
    servers = {}
    for version, (source, build) in extensions.items():
        package = package_of(source, build, folder / f"run-{version}")
        servers[version] = {kind: start(package, images, kind) for kind in ("best", "portable")}
    units = {version: units_of(both["best"]) for version, both in servers.items()}
    for both in servers.values():
        units_of(both["portable"])  # its first line
    extracting = [
        Contender(servers[version]["best"], version, unit)
        for version, names in units.items()
        for unit in names
    ]
    commands = {image: f"extract {image} {n}" for image, n in extraction.items()}
    yield in_turns("Extraction", extracting, commands, rounds, with_unit=True)
    matching = [
        Contender(both[kind], version, units[version][-1 if kind == "best" else 0])
        for version, both in servers.items()
        for kind in ("best", "portable")
    ]
    commands = {pair: f"stereo {pair}_left {pair}_right {n}" for pair, n in stereo.items()}
    yield in_turns("Stereo matching", matching, commands, rounds, with_unit=False)
    for both in servers.values():
        for server in both.values():
            server.communicate()


def in_turns(
    title: str,
    contenders: list[Contender],
    commands: dict[str, str],
    rounds: int,
    *,
    with_unit: bool,
) -> Table:
    """Medians of all, an image by each in turn."""
    base = next((one for one in contenders if one.unit == "avx2"), contenders[0])
    table = new_table(
        f"{title}, milliseconds of processor time",
        ["version", "vector unit"],
        list(commands),
        f"in brackets: as multiples of {base.version} with {base.unit}",
    )
    medians: dict[Contender, dict[str, float]] = {contender: {} for contender in contenders}
    for name, command in commands.items():
        times: dict[Contender, list[float]] = {contender: [] for contender in contenders}
        for _ in range(rounds):
            for one in contenders:
                words = f"{command} {one.unit}" if with_unit else command
                times[one].append(one.milliseconds(words))
        for one, measured in times.items():
            medians[one][name] = statistics.median(measured)
    for one, row in medians.items():
        cells = [f"{ms:.2f} ({ms / medians[base][name]:.2f})" for name, ms in row.items()]
        table.add_row(one.version, one.unit, *cells)
    return table


def write_images(file: Path) -> tuple[dict[str, int], dict[str, int]]:
    """Images of the comparison into a file; numbers of features of single images and of pairs."""
    single = {image: reference.YARDSTICK[image][0] for image in reference.EXTRACTION}
    images = Yardstick().images
    arrays = {image: np.asarray(images[image]) for image in single}
    pairs = {}
    for name in reference.STEREO:
        pair = stereo_pair(name)
        pairs[name] = pair.n_features
        arrays |= {f"{name}_left": pair.left, f"{name}_right": pair.right}
        arrays |= {f"{name}_left_fx": np.float64(pair.fx), f"{name}_left_bf": np.float64(pair.bf)}
    np.savez(file, **arrays)  # type: ignore[arg-type]
    return single, pairs


def package_of(source: Path, build: Path, folder: Path) -> Path:
    """A folder for PYTHONPATH: a version's Python files, and its extension in their midst."""
    package = folder / "orbslam2py"
    shutil.copytree(
        source / "src" / "orbslam2py", package, ignore=shutil.ignore_patterns("*.so", "__pycache__")
    )
    for extension in build.rglob("*.so"):
        at = [path.parent for path in package.rglob("*.pyx") if path.stem in extension.name]
        shutil.copy(extension, at[0] if at else package)
    return folder


def start(package: Path, images: Path, kind: str) -> subprocess.Popen[str]:
    """A process with that package, with the best kernels or the portable ones."""
    environment = os.environ | {"PYTHONPATH": str(package)}
    if kind == "portable":
        environment["ORBSLAM2PY_PORTABLE_KERNELS"] = "1"
    return subprocess.Popen(
        [sys.executable, Path(__file__).with_name("extension_server.py"), package, images],
        env=environment,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )


def units_of(server: subprocess.Popen[str]) -> list[str]:
    """Its first message."""
    assert server.stdout is not None
    return server.stdout.readline().split()

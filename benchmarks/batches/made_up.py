# SPDX-License-Identifier: BSD-3-Clause
"""Made-up sequences on disk, written once."""

from __future__ import annotations

from pathlib import Path

from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence


def write_sequences(
    folder: Path,
    count: int,
    frames: int,
    size: tuple[int, int],
    *,
    sensors: tuple[str, ...] = ("rgbd",),
    worlds: tuple[str, ...] = ("corridor",),
) -> list[Path]:
    """Write sequences that differ in world, sensor and seed; those that are there stay.

    Returns
    -------
    list of Path
        Their folders.
    """
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for number in range(count):
        world, sensor = worlds[number % len(worlds)], sensors[number % len(sensors)]
        options = SyntheticOptions(
            world=world, sensor=sensor, frames=frames, size=size, seed=number
        )
        path = folder / f"{world}-{sensor}-{number}-{frames}x{size[0]}x{size[1]}"
        if not path.is_dir():
            SyntheticSequence(options, threads=2).write(path)
        paths.append(path)
    return paths

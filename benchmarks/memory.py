# SPDX-License-Identifier: BSD-3-Clause
"""Does memory grow while the camera sees the same place again and again?

A short path through the synthetic room is rendered once at 160x120 and then fed forth and back, as
RGB-D images, for as many frames as wanted. Once the place is mapped only the trajectory should
grow. Resident memory is read after ``malloc_trim``, so that freed blocks do not count.

    python -m benchmarks.memory --frames 100000
"""

from __future__ import annotations

import json
import sys
import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from rich.table import Table

from benchmarks.harness.arguments import add_counts, add_width, console_of, new_parser
from benchmarks.harness.process_memory import resident_mb
from benchmarks.harness.tables import in_words, new_table
from orbslam2py import System
from orbslam2py.settings import OrbSettings
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence

TARGET_KB_PER_FRAME = 0.5
SIZE = (160, 120)
SETTLED_AFTER = 1000
#: More than 500 keypoints are needed to begin a map; so small an image has them only with low
#: thresholds and a shallow pyramid.
FEATURES = OrbSettings(n_features=700, scale_factor=1.2, n_levels=4, ini_th_fast=12, min_th_fast=4)


@dataclass(frozen=True)
class Sample:
    """State after so many frames."""

    frame: int
    resident_kb: float
    keyframes: int
    points: int
    seconds: float


@dataclass(frozen=True)
class MemoryResult:
    """Growth since `SETTLED_AFTER` frames."""

    samples: list[Sample]
    n_lost: int
    n_resets: int

    @property
    def kb_per_frame(self) -> float:
        """Kilobytes (1000 bytes) a frame between the first and the last sample."""
        first, last = self.samples[0], self.samples[-1]
        return (last.resident_kb - first.resident_kb) / (last.frame - first.frame)


def measure(n_frames: int, n_views: int, *, every: int, deterministic: bool) -> MemoryResult:
    """Feed `n_frames` images; sample memory after `SETTLED_AFTER` and `every` further frames."""
    options = SyntheticOptions(sensor="rgbd", frames=n_views, size=SIZE, noise=1.0)
    sequence = SyntheticSequence(options)
    settings = replace(sequence.settings, orb=FEATURES)
    views = [sequence.load(i) for i in range(n_views)]
    there_and_back = [*views, *views[-2:0:-1]]
    samples: list[Sample] = []
    n_lost = 0
    begin = time.perf_counter()
    with System(
        settings, "rgbd", deterministic=deterministic, wait_for_mapping=not deterministic
    ) as system:
        for i in range(n_frames):
            images = there_and_back[i % len(there_and_back)]
            record = system.track_rgbd(images.image, images.depth, i * 0.05)
            n_lost += record.T_cw is None
            done = i + 1
            if done >= SETTLED_AFTER and (done % every == 0 or done in (SETTLED_AFTER, n_frames)):
                system.wait_until_idle()
                samples.append(
                    Sample(
                        done,
                        1e3 * resident_mb(trimmed=True),
                        system.n_keyframes,
                        system.n_map_points,
                        time.perf_counter() - begin,
                    )
                )
        n_resets = system.n_resets
    return MemoryResult(samples, n_lost, n_resets)


def memory_table(result: MemoryResult) -> Table:
    table = new_table(
        f"Memory over the same place, {SIZE[0]}x{SIZE[1]} RGB-D",
        [],
        ["frames", "resident MB", "keyframes", "points", "seconds", "kB/frame so far"],
    )
    first = result.samples[0]
    for sample in result.samples:
        grown = (sample.resident_kb - first.resident_kb) / max(1, sample.frame - first.frame)
        table.add_row(
            str(sample.frame),
            f"{sample.resident_kb / 1000:.1f}",
            str(sample.keyframes),
            str(sample.points),
            f"{sample.seconds:.0f}",
            f"{grown:.3f}",
        )
    return table


def main() -> None:
    parser = new_parser(__doc__)
    add_counts(
        parser,
        frames=(100_000, "images shown"),
        views=(40, "different images along the path"),
        every=(10_000, "frames between two samples"),
    )
    parser.add_argument("--deterministic", action="store_true", help="map inline, no threads")
    parser.add_argument("--json", type=Path, help="also write the figures here")
    add_width(parser, 100)
    arguments = parser.parse_args()
    if arguments.frames < 2 * SETTLED_AFTER:
        parser.error(f"--frames must be {2 * SETTLED_AFTER} or more")
    result = measure(
        arguments.frames,
        arguments.views,
        every=arguments.every,
        deterministic=arguments.deterministic,
    )
    console = console_of(arguments)
    console.print(memory_table(result))
    met = result.kb_per_frame <= TARGET_KB_PER_FRAME and not result.n_resets
    console.print(
        f"{result.kb_per_frame:.3f} kB a frame after the first {SETTLED_AFTER} "
        f"(target {TARGET_KB_PER_FRAME}: {in_words(met)}); "
        f"{result.n_lost} frames without a pose, {result.n_resets} resets"
    )
    if arguments.json is not None:
        figures = {**asdict(result), "kb_per_frame": result.kb_per_frame}
        arguments.json.write_text(json.dumps(figures, indent=1) + "\n")
    sys.exit(0 if met else 1)


if __name__ == "__main__":
    main()

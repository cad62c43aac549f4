# SPDX-License-Identifier: BSD-3-Clause
"""Which calibrations are reported as wrong within the first 49 images.

Every real sequence with the settings of every other one and with all built-in ones, with and
without the calibration that comes with it; right calibrations of all kinds, which must not be
reported; and wrong ones on made-up images.

    python -m benchmarks.calibration_fit.table matrix
    python -m benchmarks.calibration_fit.table right wrong
"""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

import orbslam2py as orb
from benchmarks.calibration_fit.cameras import N_IMAGES, Case, right_cases, wrong_cases
from benchmarks.harness.arguments import add_width, console_of, new_parser
from benchmarks.harness.folders import sequence_folder
from benchmarks.harness.tables import new_table
from orbslam2py.calibration.self_calibration import Change
from orbslam2py.datasets import Images
from orbslam2py.runs.calibration_watch import CalibrationWatch
from orbslam2py.settings import BUILTIN_NAMES, Settings, builtin_settings
from orbslam2py.settings.builtin import builtin_sensors
from orbslam2py.settings.sensor import WITHOUT_RIG

PARTS = ("matrix", "right", "wrong")


@dataclass(frozen=True)
class Judgement:
    """Report of the check, and its figures."""

    name: str
    told: str
    row_difference: str
    focal: str
    centre: str
    radial: str


def judge(
    name: str, settings: Settings, images: Iterable[Images], known: Settings | None = None
) -> Judgement:
    """Show images to a watch."""
    watch = CalibrationWatch(settings, settings.sensor, known=known)
    for one in islice(images, N_IMAGES):
        watch.look(one)
    misfit = watch.finish()
    gains = watch.gains
    rows = [one.row_difference for one in watch.rows]
    return Judgement(
        name,
        "" if misfit is None else misfit.seen,
        f"{np.median(rows):.2f}" if rows else "",
        "" if gains is None else f"{np.exp(gains.focal.values[0]):.2f} {_gain(gains.focal)}",
        "" if gains is None else f"{np.linalg.norm(gains.centre.values):.2f} {_gain(gains.centre)}",
        "" if gains is None else f"{gains.radial.values[0]:+.2f} {_gain(gains.radial)}",
    )


def _gain(change: Change) -> str:
    return f"({change.gain:.2f})"


def sequences() -> Iterator[tuple[str, orb.Sensor, object]]:
    """All real sequences, with every sensor they have images for."""
    folder = sequence_folder("")
    for path in sorted(Path(folder).iterdir()):
        for sensor in WITHOUT_RIG:
            try:
                yield path.name, sensor, orb.open_sequence(path, sensor)
            except orb.OrbSlamError:
                continue


def matrix() -> Iterator[Judgement]:
    """Every sequence with all settings there are for its sensor."""
    opened = [(n, s, q) for n, s, q in sequences() if _own(q) is not None]
    for name, sensor, sequence in opened:
        own = _own(sequence)
        images = [sequence.load(i) for i in range(min(N_IMAGES, len(sequence)))]  # type: ignore[attr-defined]
        candidates = [
            (built, builtin_settings(built, sensor))
            for built in BUILTIN_NAMES
            if sensor in builtin_sensors(built)
        ]
        candidates += [(n, q.settings) for n, s, q in opened if s is sensor]  # type: ignore[attr-defined]
        for other, settings in candidates:
            for known in (own, None):
                beside = "" if known is None else ", beside"
                yield judge(f"{name} {sensor} <- {other}{beside}", settings, images, known)


def _own(sequence: object) -> Settings | None:
    try:
        return sequence.default_settings()  # type: ignore[attr-defined, no-any-return]
    except orb.OrbSlamError:
        return None


def windows() -> Iterator[Judgement]:
    """Later parts of the real sequences with their own settings."""
    for name, sensor, sequence in sequences():
        own = _own(sequence)
        if own is None:
            continue
        n = len(sequence)  # type: ignore[arg-type]
        for start in range(0, max(1, n - N_IMAGES + 1), 40):
            part = (sequence.load(i) for i in range(start, min(n, start + N_IMAGES)))  # type: ignore[attr-defined]
            yield judge(f"{name} {sensor} from {start}", own, part, own)


def made_up(cases: Iterable[Case]) -> Iterator[Judgement]:
    """Cases of synthetic worlds."""
    for case in cases:
        yield judge(case.name, case.settings, case.images())


def main() -> None:
    """Print the tables that were asked for."""
    logging.getLogger("orbslam2py").setLevel(logging.ERROR)
    parser = new_parser(__doc__ or "")
    parser.add_argument("parts", nargs="*", default=PARTS, help=f"of {', '.join(PARTS)}")
    add_width(parser)
    arguments = parser.parse_args()
    console = console_of(arguments)
    for part in arguments.parts:
        judgements = {
            "matrix": lambda: list(matrix()),
            "right": lambda: [*windows(), *made_up(right_cases())],
            "wrong": lambda: list(made_up(wrong_cases())),
        }[part]()
        numbers = ("rows [px]", "focal (gain)", "centre (gain)", "radial (gain)")
        told = sum(bool(one.told) for one in judgements)
        caption = f"{told} of {len(judgements)} reported"
        head = ("images <- settings", "reported")
        table = new_table(f"calibrations: {part}", head, numbers, caption)
        for one in judgements:
            figures = (one.row_difference, one.focal, one.centre, one.radial)
            table.add_row(one.name, one.told[:40], *figures)
        console.print(table)


if __name__ == "__main__":
    main()

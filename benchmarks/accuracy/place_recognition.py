# SPDX-License-Identifier: BSD-3-Clause
"""How well vocabularies distinguish places: every image asks, the L1 score ranks all others.

Recall at precision 1 is the share of the right pairs whose score is above that of every wrong pair;
average precision is the area under the precision-recall curve over all pairs.

    python -m benchmarks.accuracy.place_recognition src/orbslam2py/data/default.bvoc deeper.bvoc
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from benchmarks.harness.arguments import add_counts, add_width, console_of, new_parser
from benchmarks.harness.folders import sequence_folder
from benchmarks.harness.tables import new_table
from orbslam2py import _core as core
from orbslam2py.vocabulary import default_vocabulary_path, load_vocabulary


@dataclass
class Places:
    """Images, and which pairs (i > j) count as right and which as wrong."""

    name: str
    images: list[Path]
    right: np.ndarray
    wrong: np.ndarray


def euroc_places(folder: Path) -> Places:
    """EuRoC keyframes: more than 10 s apart; right within 1 m and 30 degrees."""
    with (folder / "mav0/cam0/data.csv").open() as file:
        rows = [row for row in csv.reader(file) if row and not row[0].startswith("#")]
    truth = np.loadtxt(folder / "groundtruth_cam0_tum.txt")
    times = np.array([int(row[0]) / 1e9 for row in rows])
    nearest = np.abs(truth[:, 0][None, :] - times[:, None]).argmin(axis=1)
    known = np.abs(truth[nearest, 0] - times) < 0.05
    images = [folder / "mav0/cam0/data" / row[1] for row, k in zip(rows, known, strict=True) if k]
    times, poses = times[known], truth[nearest[known]]
    distance = np.linalg.norm(poses[:, None, 1:4] - poses[None, :, 1:4], axis=2)
    cosine = np.abs(np.einsum("ik,jk->ij", poses[:, 4:8], poses[:, 4:8]))
    angle = np.degrees(2 * np.arccos(np.clip(cosine, 0, 1)))
    apart = np.tril(np.abs(times[:, None] - times[None, :]) > 10, -1)
    near = (distance < 1) & (angle < 30)
    return Places("EuRoC V1_01 keyframes", images, apart & near, apart & ~near)


def corridor_places(folder: Path) -> Places:
    """A corridor lap driven twice: image k shows the place of k - 41 .. k - 39."""
    images = sorted((folder / "images").iterdir())
    index = np.arange(len(images))
    gap = index[:, None] - index[None, :]
    right = (gap >= 39) & (gap <= 41)
    # Neighbours of the true place overlap with it, and the last images show the start a third time
    # (80 images later); both count neither way.
    wrong = (gap > 10) & (np.abs(gap - 40) > 10) & (gap < 70)
    return Places("RTAB-Map corridor", images, right, wrong)


def describe_all(images: list[Path], n_features: int) -> list[np.ndarray]:
    extractor = core.OrbExtractor(core.OrbOptions(n_features=n_features))
    return [
        extractor.extract(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)).descriptors
        for path in images
    ]


def score_all(vocabulary: core.Vocabulary, descriptors: list[np.ndarray]) -> np.ndarray:
    bags = [vocabulary.transform(rows)[0] for rows in descriptors]
    return np.array([[core.similarity(a, b) for b in bags] for a in bags])


def recall_at_precision_one(scores: np.ndarray, places: Places) -> float:
    return float(np.mean(scores[places.right] > scores[places.wrong].max()))


def average_precision(scores: np.ndarray, places: Places) -> float:
    values = np.concatenate([scores[places.right], scores[places.wrong]])
    labels = np.repeat([True, False], [places.right.sum(), places.wrong.sum()])
    labels = labels[np.argsort(-values, kind="stable")]
    precision = np.cumsum(labels) / np.arange(1, len(labels) + 1)
    return float(precision[labels].mean())


def best_match_is_right(scores: np.ndarray, places: Places) -> float:
    """Share of the images with a right pair whose best scored partner is a right one."""
    allowed = np.where(places.right | places.wrong, scores, -1)
    asking = np.flatnonzero(places.right.any(axis=1))
    return float(np.mean([places.right[i, allowed[i].argmax()] for i in asking]))


def main() -> None:
    parser = new_parser(__doc__)
    parser.add_argument(
        "vocabulary",
        nargs="*",
        type=Path,
        default=[default_vocabulary_path()],
        help="files to compare [the package's]",
    )
    add_counts(parser, features=(1000, "features per image"))
    add_width(parser, 160)
    arguments = parser.parse_args()
    sets = [
        euroc_places(sequence_folder("euroc_V1_01_keyframes")),
        corridor_places(sequence_folder("rtabmap_samples_loop")),
    ]
    table = new_table(
        "Place recognition",
        ["images", "right pairs", "vocabulary", "words"],
        ["recall at precision 1", "average precision", "best match right"],
    )
    for places in sets:
        descriptors = describe_all(places.images, arguments.features)
        for path in arguments.vocabulary:
            vocabulary = load_vocabulary(path)
            scores = score_all(vocabulary, descriptors)
            table.add_row(
                f"{places.name} ({len(places.images)})",
                str(int(places.right.sum())),
                path.name,
                str(vocabulary.n_words),
                f"{recall_at_precision_one(scores, places):.3f}",
                f"{average_precision(scores, places):.3f}",
                f"{best_match_is_right(scores, places):.3f}",
            )
    console_of(arguments).print(table)


if __name__ == "__main__":
    main()

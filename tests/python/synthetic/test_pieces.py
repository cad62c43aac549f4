# SPDX-License-Identifier: BSD-3-Clause
"""A way in pieces: in another order, in the dark between; the truth keeps with the images."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from orbslam2py import SettingsError, open_sequence
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence

N, FPS = 60, 20.0


def made(**options: object) -> SyntheticSequence:
    given = {"size": (160, 120), "frames": N, "world": "corridor", "sensor": "rgbd"}
    return SyntheticSequence(SyntheticOptions(**{**given, **options}))  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def whole() -> SyntheticSequence:
    return made()


def of_way(sequence: SyntheticSequence, whole: SyntheticSequence) -> list[int]:
    """Which image of the whole way each image is, by its true pose; -1 in the dark."""
    truth = whole.ground_truth().positions
    found = []
    for i, place in enumerate(sequence.ground_truth().positions):
        away = np.linalg.norm(truth - place, axis=1)
        assert away.min() < 1e-12
        found.append(-1 if sequence.covered(i) else int(away.argmin()))
    return found


def test_pieces_come_in_the_order_that_is_asked_for(whole: SyntheticSequence) -> None:
    sequence = made(pieces=3, order=(2, 0), gap=0.5)
    dark = round(0.5 * FPS)
    assert of_way(sequence, whole) == [*range(40, 60), *[-1] * dark, *range(20)]
    np.testing.assert_allclose(np.diff(sequence.timestamps), 1 / FPS, atol=1e-9)
    standing = sequence.ground_truth().positions[20 : 20 + dark]
    np.testing.assert_array_equal(standing, np.tile(whole.T_wc(59)[:3, 3], (dark, 1)))


def test_an_image_is_that_of_its_place_on_the_way(whole: SyntheticSequence) -> None:
    sequence = made(pieces=3, order=(2, 0), gap=0.5)
    for i, place in ((0, 40), (35, 5)):
        images, there = sequence.load(i), whole.load(place)
        np.testing.assert_array_equal(images.image, there.image)
        np.testing.assert_array_equal(images.depth, there.depth)
        np.testing.assert_array_equal(sequence.exact_depth(i), whole.exact_depth(place))
    black = sequence.load(25)
    assert black.image.max() < 60
    assert not black.depth.any()


def test_neighbours_share_what_overlaps(whole: SyntheticSequence) -> None:
    sequence = made(pieces=3, order=(1, 2), gap=0, overlap=0.25)
    assert of_way(sequence, whole) == [*range(15, 45), *range(35, 60)]


@pytest.mark.parametrize("n", [1, 2, 7])
def test_all_pieces_come_shuffled_by_the_seed(n: int, whole: SyntheticSequence) -> None:
    once, again = made(pieces=n, gap=0, seed=3), made(pieces=n, gap=0, seed=3)
    numbers = once._arrangement.of_way.tolist()
    assert numbers == again._arrangement.of_way.tolist()
    assert sorted(numbers) == list(range(N))
    assert (numbers == list(range(N))) == (n == 1)
    if n == 7:
        assert numbers != made(pieces=n, gap=0, seed=4)._arrangement.of_way.tolist()


def test_three_dark_seconds_are_usual() -> None:
    assert len(made(pieces=2)) == N + 3 * FPS


def test_a_hand_comes_when_it_is_asked_to() -> None:
    sequence = made(cover=(0.5, 1.0))
    covered = [sequence.covered(i) for i in range(N)]
    assert covered[10:30] == [True] * 20
    assert not any(covered[:6])
    assert not any(covered[34:])
    assert not any(made(cover=(0.5, 0.0)).covered(i) for i in range(N))


def test_the_truth_of_a_written_sequence_keeps_with_its_images(tmp_path: Path) -> None:
    sequence = made(pieces=2, order=(1, 0), gap=0.25, frames=12)
    sequence.write(tmp_path / "cut", "tum")
    read = open_sequence(tmp_path / "cut", "rgbd")
    assert len(read) == len(sequence) == 17
    # In TUM's files z is up.
    truth = read.ground_truth().positions[:, [0, 2, 1]] * (1, -1, 1)
    np.testing.assert_allclose(truth, sequence.ground_truth().positions, atol=1e-6)
    np.testing.assert_array_equal(read.load(7).depth, 0)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"order": (0,)}, "order applies to a way in pieces; give pieces"),
        ({"gap": 1.0}, "gap applies to a way in pieces"),
        ({"pieces": 1, "gap": 3.0}, "gap is the time between pieces, and only one comes"),
        ({"pieces": 3, "order": (1,), "gap": 0.5}, "gap is the time between pieces"),
        ({"pieces": 1, "overlap": 1.0}, "overlap is what pieces share, and there is only one"),
        ({"pieces": 2, "order": (0, 2)}, "order is 2; allowed: whole numbers 0 to 1"),
        ({"pieces": 2, "order": (1, 1)}, "twice"),
        ({"pieces": 2, "order": ()}, "give numbers of pieces"),
        ({"pieces": 2, "order": 1}, "give numbers of pieces"),
        ({"pieces": 1.5}, "pieces is 1.5"),
        ({"pieces": N + 1}, "61, of a way of 60 images; take fewer"),
        ({"cover": (1, 2, 3)}, "cover has 3 numbers"),
        ({"cover": (-1, 2)}, "beginning of cover is -1"),
    ],
    ids=str,
)
def test_what_cannot_be_is_refused(options: dict[str, object], message: str) -> None:
    with pytest.raises(SettingsError, match=message):
        made(**options)

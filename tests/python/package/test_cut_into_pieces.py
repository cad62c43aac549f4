# SPDX-License-Identifier: BSD-3-Clause
"""The programs of ``benchmarks.several_maps``: what they cut, count and keep."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from benchmarks.several_maps import draws, recorded
from benchmarks.several_maps.cases import CASES, COVERED, DifferentRooms
from benchmarks.several_maps.meeting import Outcome, judged
from benchmarks.several_maps.pieces import Found, Pieces
from benchmarks.several_maps.rows import Rows

import orbslam2py as orb
from orbslam2py.datasets import Images
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence


@dataclass
class Numbered:
    """Images that show their number."""

    def load(self, index: int, /) -> Images:
        return Images(np.full((2, 2), index + 1, np.uint8))


def outcome(**values: object) -> Outcome:
    usual = {"n_maps": 1, "merges": 1, "found_again": 0, "tracked": 1.0, "violations": 0}
    errors = {"error": 0.01, "worst": 0.01, "uncut": 0.01, "scales": []}
    return Outcome(**{**usual, **errors, **values})  # type: ignore[arg-type]


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_cases_see_something_twice_and_are_dark_between(case: object) -> None:
    order = case.order(400, np.random.default_rng(3))  # type: ignore[attr-defined]
    seen = [index for index in order if index is not None]
    assert min(seen) >= 0 and max(seen) < 400
    assert (len(order) - len(seen)) % COVERED == 0 and len(order) > len(seen)
    assert order[0] is not None and order[-1] is not None


def test_covered_frames_are_black_and_belong_to_no_place() -> None:
    pieces = Pieces(Numbered(), (4, None, 2), 0.5)
    assert [int(pieces.load(p).image[0, 0]) for p in range(3)] == [5, 0, 3]
    path = orb.Trajectory(np.array([0.0, 0.5, 1.0]), np.tile(np.eye(4), (3, 1, 1)))
    assert pieces.found(path).indices.tolist() == [4, 2]
    assert pieces.n_seen == 2


def test_errors_are_those_of_the_frames_whose_place_is_known() -> None:
    truth = np.random.default_rng(0).normal(size=(20, 3))
    truth[7] = np.nan
    found = Found(np.arange(20), np.where(np.isnan(truth), 9.0, truth))
    assert found.error(truth, monocular=False) == pytest.approx(0.0, abs=1e-9)
    moved = Found(found.indices, found.positions + np.eye(3)[np.arange(20) % 3])
    assert moved.error(truth, monocular=False) > 0.3
    assert np.isnan(found.among(np.arange(4)).error(truth, monocular=False))


def test_one_wrong_map_of_ten_fails_a_case_and_one_that_did_not_meet_does_not() -> None:
    case = CASES[0]
    assert judged(case, [outcome()] * 9 + [outcome(n_maps=2)])[1]
    assert not judged(case, [outcome()] * 8 + [outcome(n_maps=2)] * 2)[1]
    assert not judged(case, [outcome()] * 9 + [outcome(worst=4.4)])[1]
    assert not judged(case, [outcome(tracked=0.9)] * 10)[1]
    assert not judged(case, [outcome(error=0.014)] * 10)[1]
    assert not judged(case, [outcome()] * 9 + [outcome(violations=1)])[1]


def test_what_was_run_is_not_run_again(tmp_path: Path) -> None:
    path = tmp_path / "rows.jsonl"
    assert Rows(path).get("a", lambda: {"value": 1})["value"] == 1
    with path.open("a") as file:
        file.write('{"key": "b", "val')  # cut short
    again = Rows(path)
    assert again.get("a", lambda: pytest.fail("it stands in the file"))["value"] == 1
    assert again.get("b", lambda: {"value": 2})["value"] == 2
    assert Rows(path).get("b", lambda: pytest.fail("it stands in the file"))["value"] == 2


@pytest.mark.parametrize(
    "content", [b"root:x:0:0:root\nbin:x:1:1", b'{"other": 1}\n', b"precious", b"\x89PNG\xff\xfe"]
)
def test_another_file_is_not_written_over(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "precious"
    path.write_bytes(content)
    with pytest.raises(SystemExit, match="no file of runs"):
        Rows(path)
    assert path.read_bytes() == content


@pytest.mark.parametrize("n_pieces", range(draws.FEWEST, draws.MOST + 1))
def test_pieces_at_random_places_show_every_frame_once(n_pieces: int) -> None:
    order = draws.order_of(60, n_pieces, np.random.default_rng(n_pieces))
    assert sorted(index for index in order if index is not None) == list(range(60))


def test_a_draw_that_fails_is_a_row(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(draws, "TIMEOUT", 0.01)
    row = draws.run_apart(5, 20)
    assert "took longer" in row["failure"] and row["pieces"] == 7
    assert not draws.cells_of([row])[1]


@pytest.mark.parametrize("version", recorded.VERSIONS, ids=lambda version: version.__name__)
def test_versions_of_recordings_end_with_what_joins_their_pieces(version: object) -> None:
    order = version(100, 30, np.random.default_rng(1))  # type: ignore[operator]
    seen = [index for index in order if index is not None]
    assert min(seen) >= 0 and max(seen) < 100
    assert len(seen) > len(set(seen)), "something is seen twice"


def test_the_second_of_two_different_rooms_has_another_wallpaper() -> None:
    options = SyntheticOptions(world="two-rooms", sensor="mono", size=(64, 64))
    alike, different = SyntheticSequence(options), DifferentRooms(options)
    assert np.array_equal(alike.load(0).image, different.load(0).image)
    last = len(alike) - 1
    assert not np.array_equal(alike.load(last).image, different.load(last).image)

# SPDX-License-Identifier: BSD-3-Clause
"""Several maps of a run and of a map file in pictures: each in its colour."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from orbslam2py import Sensor, run_sequence
from orbslam2py._palette import PAPER_MAPS, Colour, hexadecimal, lighter, paper_map_colour
from orbslam2py.maps import load_map, save_map
from orbslam2py.maps.edits.parts import put_together
from orbslam2py.runs import RunOptions, SystemOptions
from orbslam2py.runs.map_picture import draw_map
from orbslam2py.runs.several_maps import DrawnMap, draw_maps, maps_of_file
from orbslam2py.runs.several_maps.panels import MOST_PANELS
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from support.made_up_runs import made_up_run
from support.made_up_saved import made_up_saved

pytestmark = [pytest.mark.watchdog(60), pytest.mark.page]


def n_pixels(path: Path, colour: Colour) -> int:
    """Pixels of exactly a colour."""
    picture = cv2.imread(str(path))
    assert picture is not None
    return int((picture[:, :, ::-1] == np.array(colour)).all(axis=2).sum())


def seen(path: Path) -> list[bool]:
    """Whether anything is drawn in the colour of each map."""
    return [n_pixels(path, colour) > 100 for colour in PAPER_MAPS]


def circle(number: int, n: int = 60) -> DrawnMap:
    angle = np.linspace(0, 2 * np.pi, n)
    positions = np.stack([np.cos(angle), 0 * angle, np.sin(angle)], axis=1)
    return DrawnMap(
        number=number,
        state="rests",
        positions=positions,
        gaps=np.zeros(n, bool),
        keyframes=positions[::5],
        points=1.2 * positions,
        loops=np.zeros((0, 2, 3)),
    )


@pytest.mark.parametrize("n", [1, 2, 3, 5])
def test_each_map_has_its_colour(tmp_path: Path, n: int) -> None:
    draw_maps(tmp_path / "maps.png", [circle(k) for k in range(n)], title="t", main=0)
    assert seen(tmp_path / "maps.png") == [k < n for k in range(len(PAPER_MAPS))]


def test_of_very_many_maps_the_longest_are_drawn(tmp_path: Path) -> None:
    maps = [circle(6 * k, 40) for k in range(MOST_PANELS)] + [circle(1, 30), circle(2, 50)]
    draw_maps(tmp_path / "maps.png", maps, title="t")
    assert seen(tmp_path / "maps.png") == [True, False, True, False, False, False]


def test_a_title_says_what_a_map_is() -> None:
    assert circle(3).title == "map 3, rests: 12 keyframes, 60 points"
    given_up = replace(circle(3), state="given up", keyframes=np.zeros((0, 3)))
    assert given_up.title == "map 3, given up: 60 poses"


@pytest.mark.picture
def test_a_run_with_several_maps_has_a_picture_of_them(tmp_path: Path) -> None:
    run = made_up_run(tmp_path / "r", "kkkkkkllkkkkkkkk", maps="0" * 8 + "1" * 8)
    assert seen(run / "maps.png")[:3] == [True, True, False]
    shade = lighter(paper_map_colour(0), 0.72)
    assert n_pixels(run / "trajectory.png", shade) > 500, hexadecimal(shade)
    alone = made_up_run(tmp_path / "alone", "kkkkkkllkkkkkkkk")
    assert not (alone / "maps.png").exists()
    assert n_pixels(alone / "trajectory.png", shade) == 0


def test_the_others_keep_their_keyframes_and_points(tmp_path: Path) -> None:
    options = SyntheticOptions(
        world="corridor", sensor="rgbd", size=(320, 240), pace=2.0, frames=240,
        pieces=6, order=(0, 5), gap=1.0,
    )  # fmt: skip
    system = SystemOptions(deterministic=True, new_map_after=0.5)
    done = run_sequence(
        SyntheticSequence(options),
        output=tmp_path / "r",
        options=RunOptions(Sensor.RGBD, system=system),
    )
    result = done.result
    assert [one.map_index for one in result.maps] == [0, 1]
    (other,) = result.other_maps
    assert {result.main_map, other.map_index} == {0, 1}
    there = next(one for one in result.maps if one.map_index == other.map_index)
    assert len(other.keyframe_ids) == there.n_keyframes > 5
    assert len(other.point_ids) == there.n_map_points > 100
    assert seen(tmp_path / "r" / "maps.png")[:3] == [True, True, False]
    page = (tmp_path / "r" / "report.html").read_text()
    assert 'id="plot-maps"' in page
    assert 'id="map-0"' in page
    assert 'id="map-1"' in page


def test_a_file_with_several_maps_is_drawn(tmp_path: Path) -> None:
    one = made_up_saved()
    save_map(put_together([one, one, one]), tmp_path / "all.orbmap")
    saved = load_map(tmp_path / "all.orbmap")
    maps = maps_of_file(saved)
    assert [drawn.number for drawn in maps] == [0, 1, 2]
    for drawn in maps:
        assert len(drawn.keyframes) == one.n_keyframes
        assert len(drawn.points) == one.n_points
        np.testing.assert_allclose(drawn.keyframes, maps[0].keyframes, atol=1e-9)
        assert len(drawn.loops) == len(one.contents.loop_edges)
    draw_map(tmp_path / "all.png", saved, title="all.orbmap")
    assert seen(tmp_path / "all.png")[:4] == [True, True, True, False]

# SPDX-License-Identifier: BSD-3-Clause
"""What differs between two saved maps is said in words."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from orbslam2py.maps import keep_keyframes, map_differences
from support.made_up_map import made_up_map
from support.made_up_saved import made_up_saved

SAVED = made_up_saved(made_up_map(), images=True)
CONTENTS = SAVED.contents


def test_the_same() -> None:
    assert map_differences(SAVED, made_up_saved(made_up_map(), images=True)) == []


def test_names_and_versions_do_not_count() -> None:
    other = replace(
        SAVED,
        source="elsewhere",
        vocabulary=replace(SAVED.vocabulary, name="renamed.bvoc"),
        runs=(replace(SAVED.runs[0], program="orbslam2py 9", started="later"),),
    )
    assert map_differences(SAVED, other) == []


def test_every_array_is_compared() -> None:
    for name, array in CONTENTS.arrays():
        if not len(array) or not array.size:
            continue
        group, _, field = name.rpartition(".")
        changed = array.copy()
        changed.reshape(-1)[-1] = ~changed.reshape(-1)[-1] if array.dtype == bool else 99
        if not group:
            contents = replace(CONTENTS, **{field: changed})
        else:
            part = replace(getattr(CONTENTS, group), **{field: changed})
            contents = replace(CONTENTS, **{group: part})
        (line,) = map_differences(SAVED, replace(SAVED, contents=contents))
        assert line.startswith(f"{name}: 1 of " if field != "ids" else f"{group}: "), line


def test_numbers_say_by_how_much() -> None:
    positions = CONTENTS.points.positions.copy()
    positions[[3, 5], 1] += [0.25, -0.5]
    points = replace(CONTENTS.points, positions=positions)
    other = replace(SAVED, contents=replace(CONTENTS, points=points))
    n = len(positions)
    expected = [f"points.positions: 2 of {n} rows, by at most 0.5"]
    assert map_differences(SAVED, other) == expected


def test_other_keyframes_are_told_once() -> None:
    cropped = replace(SAVED, contents=keep_keyframes(CONTENTS, np.arange(8) < 6))
    lines = map_differences(SAVED, cropped)
    assert "keyframes: 8 and 6; 2 only in the first, 0 only in the second" in lines
    assert sum(line.startswith("keyframes") for line in lines) == 1


@pytest.mark.parametrize("attribute", ["next_keyframe", "next_point"])
def test_the_next_ids(attribute: str) -> None:
    value = getattr(CONTENTS, attribute)
    other = replace(SAVED, contents=replace(CONTENTS, **{attribute: value + 1}))
    assert map_differences(SAVED, other) == [f"{attribute}: {value} and {value + 1}"]


def test_what_is_beside_the_map() -> None:
    camera = replace(SAVED.settings.camera, fps=12.0)
    run = SAVED.runs[0]
    shorter = replace(run.frames, **{f: getattr(run.frames, f)[1:] for f in vars(run.frames)})
    lost = replace(run.frames, lost=1 - run.frames.lost)
    images = dict(SAVED.images)
    images[3] = b"another"
    cases = [
        (replace(SAVED, settings=replace(SAVED.settings, camera=camera)), "settings: 'Camera.fps"),
        (replace(SAVED, vocabulary=replace(SAVED.vocabulary, hash="0")), "vocabulary: 0123456789"),
        (replace(SAVED, runs=()), "runs: 1 and 0"),
        (replace(SAVED, runs=(replace(run, frames=shorter),)), "frames of run 0: 24 and 23"),
        (replace(SAVED, runs=(replace(run, frames=lost),)), "lost of run 0: 24 of 24 rows"),
        (replace(SAVED, images=images), "images: those of 1 of 8 keyframes"),
        (replace(SAVED, images={}), "images: of 8 and 0 keyframes"),
    ]
    for other, words in cases:
        (line,) = map_differences(SAVED, other)
        assert line.startswith(words)


def test_minus_zero_is_not_zero() -> None:
    positions = np.zeros_like(CONTENTS.points.positions)
    zero, minus = (
        replace(SAVED, contents=replace(CONTENTS, points=replace(CONTENTS.points, positions=p)))
        for p in (positions, -positions)
    )
    (line,) = map_differences(zero, minus)
    assert line == "points.positions: bits of zeros or of NaN"

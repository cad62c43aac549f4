# SPDX-License-Identifier: BSD-3-Clause
"""``orbslam2py map``: looking at map files, checking and comparing them."""

from __future__ import annotations

from contextlib import closing
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from orbslam2py.maps import keep_keyframes, load_map, map_differences
from orbslam2py.maps.map_rows import all_rows
from orbslam2py.maps.map_writer import MapWriter
from support.command_line import CommandLine
from support.made_up_map import FIRST_TIME, LENS, made_up_map
from support.made_up_saved import made_up_saved, map_file


def lines_of(text: str) -> dict[str, str]:
    return {line[:20].rstrip(): line[20:] for line in text.splitlines()}


# ---- info ----------------------------------------------------------------------------------------
def test_info(command: CommandLine, tmp_path: Path) -> None:
    saved = made_up_saved(made_up_map(lens=LENS, colours=True, noise=1.0), images=True)
    file = map_file(tmp_path, saved)
    done = command("map", "info", file)
    assert done.code == 0
    told = lines_of(done.out)
    contents = saved.contents
    size = file.stat().st_size / 1e6
    assert told["file"] == f"{file} ({size:.2f} MB)"
    assert told["camera"] == "mono, 320 x 240, fx 300"
    assert told["vocabulary"] == "0123456789abcdef (small.bvoc)"
    assert told["keyframes"] == "8 (0 were culled)"
    assert told["points"] == str(len(contents.points))
    assert told["observations"].startswith(f"{len(contents.observations)}, 6.")
    # The median of a two-dimensional error with a deviation of 1 pixel in each direction is 1.18.
    assert 0.9 < float(told["reprojection error"].split()[1]) < 1.4
    assert told["loops"] == "1 (closed, or where two maps became one)"
    assert told["times"].startswith(f"{FIRST_TIME:.3f} to ")
    assert told["times"].endswith("(3.5 s), from 2011-05-10 12:38:22 UTC")
    length = np.linalg.norm(np.diff(contents.keyframes.T_wc[:, :3, 3], axis=0), axis=1).sum()
    assert told["path"] == f"{length:.2f} units from keyframe to keyframe"
    assert told["cameras stood in"] == "0,0,0 to 2.238,0.059,0.685 units"
    assert told["colours"] == "of 7 keyframes"
    assert told["images"] == "of 8 keyframes"
    assert told["run 0"] == "2026-01-02T03:04:05Z, orbslam2py 0.1.0, 24 frames, 3 of them lost"


def test_info_of_a_map_with_metres(command: CommandLine, tmp_path: Path) -> None:
    file = map_file(tmp_path, made_up_saved(made_up_map(depth=True)))
    told = lines_of(command("map", "info", file).out)
    assert told["camera"].startswith("rgbd")
    assert told["path"].split()[1] == "m"


@pytest.mark.parametrize("with_frames", [True, False])
def test_picture(command: CommandLine, tmp_path: Path, with_frames: bool) -> None:
    saved = made_up_saved()
    if with_frames:  # two runs, one after the other
        saved = replace(saved, runs=(saved.runs[0], saved.runs[0]))
    else:
        saved = replace(saved, runs=())
    file = map_file(tmp_path, saved)
    done = command("map", "info", file, "--picture", "a.png")
    assert done.code == 0
    assert "Look at a.png" in done.out
    picture = cv2.imread("a.png")
    assert picture.shape[0] > 500
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 20
    again = command("map", "info", file, "--picture", "a.png")
    assert again.code == 2
    assert "a.png exists; use --force" in again.err
    assert command("map", "info", file, "--picture", "a.png", "--force").code == 0


# ---- verify --------------------------------------------------------------------------------------
def test_verify_whole_files(command: CommandLine, tmp_path: Path) -> None:
    first = map_file(tmp_path, made_up_saved(images=True))
    second = map_file(tmp_path, made_up_saved(made_up_map(5, depth=True)), "b.orbmap")
    done = command("map", "verify", first, second)
    assert done.code == 0, done.err
    whole, other = done.out.splitlines()
    assert whole.startswith(f"{first} is whole: 8 keyframes, ")
    assert other.startswith(f"{second} is whole: 5 keyframes, ")


def test_verify_ends_at_a_damaged_file(command: CommandLine, tmp_path: Path) -> None:
    good = map_file(tmp_path)
    bad = tmp_path / "bad.orbmap"
    content = bytearray(good.read_bytes())
    middle = len(content) // 2
    content[middle : middle + 64] = bytes(64 * [0x5A])
    bad.write_bytes(content)
    done = command("map", "verify", good, bad)
    assert done.code == 2
    assert f"{good} is whole" in done.out
    assert str(bad) in done.err
    assert "use a copy of" in done.err


# ---- compare -------------------------------------------------------------------------------------
def test_compare(command: CommandLine, tmp_path: Path) -> None:
    first = map_file(tmp_path)
    same = map_file(tmp_path, name="same.orbmap")
    done = command("map", "compare", first, same)
    assert (done.code, done.out) == (0, f"{first} and {same} hold the same\n")
    saved = made_up_saved()
    points = replace(saved.contents.points, positions=saved.contents.points.positions + 0.5)
    other = map_file(
        tmp_path, replace(saved, contents=replace(saved.contents, points=points)), "o.orbmap"
    )
    done = command("map", "compare", first, other)
    assert done.code == 1
    n = len(points)
    assert done.out.splitlines() == [
        f"points.positions: {n} of {n} rows, by at most 0.5",
        f"{first} and {other} differ",
    ]


def test_saving_what_was_loaded_changes_nothing(command: CommandLine, tmp_path: Path) -> None:
    first = map_file(tmp_path, made_up_saved(images=True))
    second = map_file(tmp_path, load_map(first, images=True), "b.orbmap")
    assert command("map", "compare", first, second).code == 0


# ---- compact -------------------------------------------------------------------------------------
def test_compact_in_place(command: CommandLine, tmp_path: Path) -> None:
    saved = made_up_saved(made_up_map(8, 200), images=True)
    file = map_file(tmp_path, saved)
    copy = map_file(tmp_path, saved, "copy.orbmap")
    before = file.stat().st_size
    done = command("map", "compact", file, "--without-images")
    assert done.code == 0
    assert file.stat().st_size < before
    assert f"{before / 1e6:.2f} MB before" in done.out
    done = command("map", "compare", file, copy)
    assert done.out.splitlines()[0] == "images: of 0 and 8 keyframes"


def test_compact_elsewhere(command: CommandLine, tmp_path: Path) -> None:
    file = map_file(tmp_path, made_up_saved(images=True))
    assert command("map", "compact", file, "-o", "b.orbmap", "--quiet").code == 0
    assert command("map", "compare", file, "b.orbmap").code == 0
    done = command("map", "compact", file, "-o", "b.orbmap")
    assert done.code == 2
    assert "b.orbmap exists; use --force" in done.err


def test_what_autosaving_left_goes(command: CommandLine, tmp_path: Path) -> None:
    """Pages of what was deleted stay in the file until it is written anew."""
    saved = made_up_saved(made_up_map(9, 300))
    smaller = replace(saved, contents=keep_keyframes(saved.contents, np.arange(9) < 2), runs=())
    file = tmp_path / "a.orbmap"
    with closing(MapWriter(file)) as writer:
        writer.commit(all_rows(replace(saved, runs=())))
        writer.commit(all_rows(smaller))
    before = file.stat().st_size
    assert command("map", "compact", file).code == 0
    assert file.stat().st_size < before / 2
    assert map_differences(load_map(file), smaller) == []

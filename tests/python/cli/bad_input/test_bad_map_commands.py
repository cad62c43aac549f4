# SPDX-License-Identifier: BSD-3-Clause
"""Commands for map files that make no sense, and files that are none."""

from __future__ import annotations

from pathlib import Path

import pytest

from support.command_line import CommandLine
from support.made_up_map import RATIONAL_LENS, made_up_map
from support.made_up_saved import made_up_saved, map_file


@pytest.fixture(autouse=True)
def _files(tmp_path: Path) -> None:
    saved = made_up_saved()
    map_file(tmp_path, saved)
    map_file(tmp_path, made_up_saved(made_up_map(5, depth=True)), "metric.orbmap")
    map_file(tmp_path, made_up_saved(made_up_map(2, lens=RATIONAL_LENS)), "rational.orbmap")
    (tmp_path / "none.orbmap").write_bytes(b"")
    (tmp_path / "text.orbmap").write_text("not a map")
    (tmp_path / "folder").mkdir()
    (tmp_path / "two.txt").write_text("0 0 0 1 1 1\n1 0 0 2 2 2\n")
    (tmp_path / "words.txt").write_text("0 0 0 1 1 1\n1 0 0 x 2 2\n")
    (tmp_path / "five.txt").write_text("0 0 0 1 1\n")
    (tmp_path / "late.txt").write_text("0 1 1 1\n99 1 1 1\n1 2 1 2\n")
    (tmp_path / "one_place.txt").write_text("0 0 0 1 1 1\n" * 4)
    (tmp_path / "rows.txt").write_text("1 0 0 0 0 1 0 0 0 0 1 0\n")
    (tmp_path / "body.csv").write_text(
        "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],"
        "q_RS_w [],q_RS_x [],q_RS_y [],q_RS_z []\n"
        "1403636579758555392,0,0,0,1,0,0,0\n"
    )
    (tmp_path / "other_day.txt").write_text("1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n")


CROP, ALIGN = "map crop a.orbmap -o out", "map align a.orbmap -o out"
OPTIMIZE = "map optimize a.orbmap -o out"
LENGTH = f"{ALIGN} --length 1 --between"
EXPORT = "map export colmap a.orbmap out"


@pytest.mark.parametrize(
    ("arguments", "thing", "remedy"),
    [
        ("map info missing.orbmap", "missing.orbmap", "check the name"),
        ("map info none.orbmap", "none.orbmap is empty", "save the map again"),
        ("map info text.orbmap", "text.orbmap is not a map file", "save_map"),
        ("map info folder", "folder is a folder", "give the map file"),
        ("map info a.orbmap --picture nowhere/a.png", "nowhere", "no such folder"),
        ("map info a.orbmap --map 0", "--map says of which map the picture", "--picture FILE"),
        ("map verify text.orbmap", "text.orbmap is not a map file", "save_map"),
        ("map compare a.orbmap text.orbmap", "text.orbmap is not a map file", "save_map"),
        ("map compact none.orbmap", "none.orbmap is empty", "save the map again"),
        (CROP, "say what to keep", "--from and --to"),
        (f"{CROP} --from 1 --low 0,0,0 --high 1,1,1", "say what to keep", "either"),
        (f"{CROP} --low 0,0,0", "a box has two corners", "--high"),
        (f"{CROP} --from 1 --points", "--points needs a box", "--low and --high"),
        (f"{CROP} --low 0,0 --high 1,1,1", "--low is '0,0'", "like 1.5,0,-2"),
        (f"{CROP} --low 0,0,0 --high 1,x,1", "--high is '1,x,1'", "like 1.5,0,-2"),
        (f"{CROP} --low 0,0,nan --high 1,1,1", "--low is '0,0,nan'", "like 1.5,0,-2"),
        (f"{CROP} --low 90,90,90 --high 91,91,91", "no camera stood in the box", "they stood in"),
        (f"{CROP} --from 90", "no keyframe is of --from 90 s after", "the nearest is of 3.500 s"),
        (f"{CROP} --to -1", "no keyframe is of --to -1 s after the", "the nearest is of 0.000 s"),
        (
            f"{CROP} --from 1.1 --to 1.4",
            "no keyframe is of --from 1.1 --to 1.4 s after the first one",
            "the nearest are of 1.000 and 1.500 s",
        ),
        (f"{CROP} --from 2 --to 1", "--from 2 is later than --to 1", "give the earlier first"),
        (f"{CROP} --from nan", "--from is nan", "give seconds since the first keyframe"),
        (f"{CROP} --to nan", "--to is nan", "give seconds since the first keyframe"),
        (f"{CROP} --only --points", "--points needs a box", "--low and --high"),
        (f"{CROP} --only --from 1 --low 0,0,0 --high 1,1,1", "say what to keep", "either"),
        ("map export nerfstudio rational.orbmap out", "rational lens (k4 to k6)", "--images"),
        ("map merge a.orbmap -o out", "a.orbmap alone", "name two map files or more"),
        ("map crop a.orbmap -o a.orbmap --to 1", "a.orbmap exists", "--force"),
        ("map crop a.orbmap -o nowhere/b.orbmap --to 1", "nowhere", "no such folder"),
        (ALIGN, "say how to align", "--truth, --points and --length"),
        (f"{ALIGN} --points two.txt --length 1", "say how to align", "one of"),
        (f"{ALIGN} --length 1", "between two places", "--between"),
        (f"{ALIGN} --points two.txt --between 0 1", "between two places", "--length"),
        (f"{LENGTH} 0 y", "--between has 'y'", "seconds like 12.4"),
        (f"{LENGTH} 0 1,2", "--between is '1,2'", "like 1.5,0,-2"),
        (f"{LENGTH} 0 99", "99 s is not within the map", "0 to 3.5 s"),
        (f"{LENGTH} 0 0", "at one place", "two that are apart"),
        (f"{ALIGN} --length 0 --between 0 1", "the length is 0", "above 0"),
        (f"{ALIGN} --length -2 --between 0 1", "the length is -2", "above 0"),
        (
            "map align metric.orbmap -o out --length 1 --between 0 1",
            "has metres already",
            "correct these in the settings",
        ),
        (f"{ALIGN} --points two.txt", "2 known points", "at least 3"),
        (f"{ALIGN} --points words.txt", "words.txt:2", "'x' is not a number"),
        (f"{ALIGN} --points five.txt", "five.txt:1", "expected 4 or 6 numbers"),
        (f"{ALIGN} --points late.txt", "99 s is not within the map", "0 to 3.5 s"),
        (f"{ALIGN} --points one_place.txt", "all at one place", "apart"),
        (f"{ALIGN} --points missing.txt", "cannot open missing.txt", "No such file"),
        (f"{ALIGN} --truth rows.txt", "rows.txt has no time stamps", "TUM's format"),
        (f"{ALIGN} --truth body.csv", "poses of the body", "folder of the sequence"),
        (f"{ALIGN} --truth other_day.txt", "only 0 of 8 keyframes", "give the truth"),
        (f"{ALIGN} --truth folder", "folder", "TUM"),
        ("map optimize a.orbmap -o out --time-limit 0", "--time-limit", "more than 0"),
        ("map optimize text.orbmap -o out", "text.orbmap is not a map file", "save_map"),
        (f"{OPTIMIZE} --align", "--align needs the images", "give the sequence with --images"),
        (f"{OPTIMIZE} --images folder", "serve --align alone", "add --align"),
        (f"{OPTIMIZE} --fps 3", "serve --align alone", "leave them out"),
        (f"{OPTIMIZE} --align --images folder --time-limit 1", "no time limit", "--time-limit"),
        (f"{OPTIMIZE} --align --images missing", "missing", "does not exist"),
        (f"{OPTIMIZE} --align --images folder", "folder is no known sequence", "give the folder"),
        (f"{OPTIMIZE} --align --images 99", "99", "camera"),
        ("map export colmap text.orbmap out", "text.orbmap is not a map file", "save_map"),
        ("map export ply a.orbmap nowhere/a.ply", "nowhere", "no such folder"),
        ("map export colmap a.orbmap .", "holds other files", "give another folder"),
        ("map export colmap a.orbmap two.txt", "two.txt is not a folder", "another one"),
        ("map export ply a.orbmap out --frames", "--frames is for tum", "ply has keyframes"),
        ("map export tum a.orbmap out --images x", "--images has no meaning", "leave it out"),
        ("map export g2o a.orbmap out --without-images", "--without-images", "leave it out"),
        ("map export tum a.orbmap out --field 90", "--field is of the images", "leave it out"),
        (f"{EXPORT} --field 90 --without-images", "--without-images writes none", "leave it out"),
        (f"{EXPORT} --field 200", "field of view of the images is 200", "degrees from 10 to 160"),
        (f"{EXPORT} --images x --without-images", "exclude each other", "--images"),
        (f"{EXPORT} --times two.txt", "--times says when", "give these as well"),
        (f"{EXPORT} --fps 3", "--fps says when", "give these as well"),
        (f"{EXPORT} --images missing", "missing", "does not exist"),
        (f"{EXPORT} --images 99", "99", "camera"),
    ],
)
def test_refused(
    command: CommandLine, tmp_path: Path, arguments: str, thing: str, remedy: str
) -> None:
    # What must not be replaced is asked for with --force where that alone would be the reason.
    force = ["--force"] if arguments.startswith("map export colmap a.orbmap .") else []
    before = {path: path.stat().st_mtime_ns for path in tmp_path.iterdir()}
    done = command(*arguments.split(), *force)
    assert done.code == 2, done.out + done.err
    told = " ".join(done.err.split())
    assert thing in told
    assert remedy in told
    assert "Errno" not in done.err
    assert "Traceback" not in done.err
    assert {path: path.stat().st_mtime_ns for path in tmp_path.iterdir()} == before


def test_a_map_that_is_to_stay_as_it_is(command: CommandLine, rgbd: Path) -> None:
    done = command("run", rgbd, "--localize", 5, "--final-adjustment")
    assert done.code == 2
    assert "--final-adjustment changes the map, but --localize keeps it unchanged" in done.err


def test_a_format_that_there_is_not(command: CommandLine) -> None:
    done = command("map", "export", "obj", "a.orbmap", "out")
    assert done.code == 2
    assert "obj" in done.err
    assert "colmap-text" in done.err

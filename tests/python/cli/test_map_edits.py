# SPDX-License-Identifier: BSD-3-Clause
"""``orbslam2py map crop``, ``align`` and ``optimize``: other map files of one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from orbslam2py.maps import MapContents, crop_to_box, crop_to_times, load_map, transform_map
from orbslam2py.maps import reprojection_errors as errors_of
from orbslam2py.trajectory import Similarity, Trajectory, write_tum
from support.command_line import CommandLine
from support.made_up_map import FIRST_TIME, STEP, made_up_map
from support.made_up_saved import made_up_saved, map_file
from support.map_invariants import check_invariants

KNOWN = Similarity(2.5, Rotation.from_rotvec([0.3, -1.0, 0.2]).as_matrix(), np.array([4.0, 5, 6]))


def loaded(path: str | Path) -> MapContents:
    contents = load_map(path).contents
    check_invariants(contents)
    return contents


# ---- crop ----------------------------------------------------------------------------------------
def test_crop_by_time(command: CommandLine, tmp_path: Path) -> None:
    saved = made_up_saved(images=True)
    file = map_file(tmp_path, saved)
    done = command("map", "crop", file, "-o", "b.orbmap", "--from", 0.9, "--to", 2.6)
    assert done.code == 0, done.err
    expected = crop_to_times(saved.contents, FIRST_TIME + 0.9, FIRST_TIME + 2.6)
    assert loaded("b.orbmap").first_difference(expected) is None
    n, m = len(saved.contents.points), len(expected.points)
    assert done.out == f"4 of 8 keyframes and {m} of {n} points are in b.orbmap\n"
    assert len(load_map("b.orbmap", images=True).images) == 4


@pytest.mark.parametrize(("option", "left"), [("--from", 5), ("--to", 4)])
def test_crop_at_one_end(command: CommandLine, tmp_path: Path, option: str, left: int) -> None:
    file = map_file(tmp_path)
    assert command("map", "crop", file, "-o", "b.orbmap", option, 3 * STEP).code == 0
    assert len(loaded("b.orbmap").keyframes) == left


@pytest.mark.parametrize("points", [False, True])
def test_crop_to_a_box(command: CommandLine, tmp_path: Path, points: bool) -> None:
    """The corners may be given in any order."""
    saved = made_up_saved()
    file = map_file(tmp_path, saved)
    words = ["--low", "1,-1,4", "--high", "-1,1,-1", *(["--points"] if points else [])]
    assert command("map", "crop", file, "-o", "b.orbmap", *words).code == 0
    low, high = np.array([-1.0, -1, -1]), np.array([1.0, 1, 4])
    expected = crop_to_box(saved.contents, low, high, points_too=points)
    assert loaded("b.orbmap").first_difference(expected) is None


def test_a_file_may_take_its_own_place(command: CommandLine, tmp_path: Path) -> None:
    file = map_file(tmp_path)
    refused = command("map", "crop", file, "-o", file, "--to", 1)
    assert refused.code == 2
    assert "exists; use --force" in refused.err
    assert command("map", "crop", file, "-o", file, "--to", 1, "--force").code == 0
    assert len(loaded(file).keyframes) == 3


# ---- align ---------------------------------------------------------------------------------------
def check_aligned(path: str, *, atol: float = 1e-5) -> None:
    expected = transform_map(made_up_saved().contents, KNOWN)
    found = loaded(path)
    np.testing.assert_allclose(found.points.positions, expected.points.positions, atol=atol)
    np.testing.assert_allclose(found.keyframes.T_wc, expected.keyframes.T_wc, atol=atol)
    np.testing.assert_allclose(found.points.max_distance, expected.points.max_distance, rtol=1e-4)


def test_align_to_a_true_path(command: CommandLine, tmp_path: Path) -> None:
    saved = made_up_saved()
    keyframes = saved.contents.keyframes
    T_wc = KNOWN.apply_to_poses(keyframes.T_wc)
    write_tum(tmp_path / "truth.txt", Trajectory(keyframes.timestamps + 0.004, T_wc))
    file = map_file(tmp_path, saved)
    done = command("map", "align", file, "-o", "b.orbmap", "--truth", "truth.txt")
    assert done.code == 0, done.err
    assert done.out.splitlines() == [
        "A unit of the map is 2.5 m",
        "8 positions are 0.0000 m from where they should be (RMSE)",
        "The map is in b.orbmap",
    ]
    check_aligned("b.orbmap")


def test_align_to_known_points(command: CommandLine, tmp_path: Path) -> None:
    """Three places in the map, and where the camera was between two keyframes."""
    saved = made_up_saved()
    places = saved.contents.points.positions[[2, 30, 50]]
    centres = saved.contents.keyframes.T_wc[:, :3, 3]
    rows = np.column_stack([places, KNOWN.apply(places)])
    halfway = KNOWN.apply((0.5 * (centres[4] + centres[5]))[None])[0]
    lines = [" ".join(map(str, row)) for row in rows.tolist()]
    lines += [" ".join(map(str, [4.5 * STEP, *halfway.tolist()]))]
    (tmp_path / "points.txt").write_text("# surveyed\n" + "\n".join(lines) + "\n")
    file = map_file(tmp_path, saved)
    done = command("map", "align", file, "-o", "b.orbmap", "--points", "points.txt")
    assert done.code == 0, done.err
    assert "4 positions are 0.0000 m" in done.out
    check_aligned("b.orbmap")


def test_points_on_a_line(command: CommandLine, tmp_path: Path) -> None:
    (tmp_path / "points.txt").write_text("0 0 0 0 0 0\n1 0 0 2 0 0\n2 0 0 4 0 0\n")
    file = map_file(tmp_path)
    done = command("map", "align", file, "-o", "b.orbmap", "--points", "points.txt")
    assert done.code == 2
    assert "the known points lie on a line in the map, so the rotation" in done.err
    assert not Path("b.orbmap").exists()


def test_a_straight_true_path(command: CommandLine, tmp_path: Path) -> None:
    """It tells all but the turn around it, which is said."""
    saved = made_up_saved()
    T_wc = saved.contents.keyframes.T_wc.copy()
    T_wc[:, :3, 3] = np.outer(np.arange(len(T_wc)), [1.0, 2.0, 0.5])
    write_tum(tmp_path / "truth.txt", Trajectory(saved.contents.keyframes.timestamps, T_wc))
    file = map_file(tmp_path, saved)
    done = command("map", "align", file, "-o", "b.orbmap", "--truth", "truth.txt")
    assert done.code == 0
    assert "They lie on a line, so the rotation about it is not determined" in done.out


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--length", "1e300", "--between", "0,0,0", "1,0,0"), "a length of 1e+300 m cannot be"),
        (("--length", "1", "--between", "0,0,0", "1e300,0,0"), "1e+300, 0, 0 cannot be meant"),
        (("--points", "far.txt"), "the position 1e+300, 0, 0 cannot be meant"),
    ],
)
def test_numbers_that_cannot_be_meant(
    command: CommandLine, tmp_path: Path, words: tuple[str, ...], message: str
) -> None:
    (tmp_path / "far.txt").write_text("0 0 0 0 0 0\n1 0 0 2 0 0\n2 1 0 1e300 0 0\n")
    file = map_file(tmp_path)
    done = command("map", "align", file, "-o", "b.orbmap", *words)
    assert done.code == 2
    assert message in done.err
    assert not Path("b.orbmap").exists()


@pytest.mark.parametrize("by_time", [False, True])
def test_a_known_length(command: CommandLine, tmp_path: Path, by_time: bool) -> None:
    saved = made_up_saved()
    file = map_file(tmp_path, saved)
    centres = saved.contents.keyframes.T_wc[:, :3, 3]
    ends = [",".join(map(str, centres[row].tolist())) for row in (0, 4)]
    between = [0, 4 * STEP] if by_time else ends
    done = command("map", "align", file, "-o", "b.orbmap", "--length", 7, "--between", *between)
    assert done.code == 0, done.err
    moved = loaded("b.orbmap").keyframes.T_wc[:, :3, 3]
    assert np.linalg.norm(moved[4] - moved[0]) == pytest.approx(7.0)
    assert done.out.startswith(f"A unit of the map is {7 / np.linalg.norm(centres[4]):.6g} m\n")


def test_a_map_with_metres_is_only_moved(command: CommandLine, tmp_path: Path) -> None:
    saved = made_up_saved(made_up_map(depth=True))
    rigid = replace(KNOWN, scale=1.0)
    T_wc = rigid.apply_to_poses(saved.contents.keyframes.T_wc)
    write_tum(tmp_path / "truth.txt", Trajectory(saved.contents.keyframes.timestamps, T_wc))
    file = map_file(tmp_path, saved)
    done = command("map", "align", file, "-o", "b.orbmap", "--truth", "truth.txt")
    assert done.code == 0
    assert "A unit" not in done.out
    moved = loaded("b.orbmap")
    np.testing.assert_allclose(moved.keyframes.T_wc, T_wc, atol=1e-6)
    np.testing.assert_array_equal(moved.keyframes.depth, saved.contents.keyframes.depth)


# ---- merge ---------------------------------------------------------------------------------------
def test_merging_maps_of_different_sensors(command: CommandLine, tmp_path: Path) -> None:
    map_file(tmp_path)
    map_file(tmp_path, made_up_saved(made_up_map(depth=True)), "b.orbmap")
    done = command("map", "merge", "a.orbmap", "b.orbmap", "-o", "c.orbmap")
    assert done.code == 2
    told = " ".join(done.err.split())
    assert "the map a.orbmap was made for sensor 'mono', but b.orbmap for 'rgbd'" in told
    assert "give maps of one sensor, or make b.orbmap anew of images for 'mono'" in told
    assert not Path("c.orbmap").exists()


def test_merging_maps_of_different_cameras(command: CommandLine, tmp_path: Path) -> None:
    """The remedies of a run, another setup or none, are none of this command."""
    saved = made_up_saved()
    map_file(tmp_path, saved)
    camera = replace(saved.settings.camera, fx=123.0)
    other = replace(saved, settings=replace(saved.settings, camera=camera))
    map_file(tmp_path, other, "b.orbmap")
    done = command("map", "merge", "a.orbmap", "b.orbmap", "-o", "c.orbmap")
    assert done.code == 2
    told = " ".join(done.err.split())
    assert "a.orbmap and b.orbmap were made with different cameras: Camera.fx is 123.0, in" in told
    assert "give maps of one camera, or make b.orbmap anew" in told
    assert "--allow-other-setup" not in told


# ---- optimize ------------------------------------------------------------------------------------
@pytest.mark.parametrize("depth", [False, True])
def test_optimize(command: CommandLine, tmp_path: Path, depth: bool) -> None:
    """Points that were pushed away come back."""
    exact = made_up_map(8, 150, depth=depth)
    random = np.random.default_rng(3)
    pushed = exact.points.positions + random.normal(scale=0.03, size=exact.points.positions.shape)
    bent = replace(exact, points=replace(exact.points, positions=pushed))
    file = map_file(tmp_path, made_up_saved(bent))
    done = command("map", "optimize", file, "--output", "b.orbmap")
    assert done.code == 0, done.err
    words = done.out.split()
    assert words[:2] == ["8", "keyframes,"]
    before, after = (float(words[words.index(word) + 1]) for word in ("cost", "to"))
    assert after < 0.01 * before
    refined = loaded("b.orbmap")
    assert np.median(errors_of(refined)) < 0.05 < 1 < np.median(errors_of(bent))
    np.testing.assert_allclose(refined.keyframes.T_wc[0], exact.keyframes.T_wc[0], atol=1e-9)
    assert len(refined.points) == len(exact.points)


def test_optimizing_twice_gives_the_same_bytes(command: CommandLine, tmp_path: Path) -> None:
    file = map_file(tmp_path, made_up_saved(made_up_map(6, noise=0.5)))
    for name in ("b.orbmap", "c.orbmap"):
        assert command("map", "optimize", file, "-o", name, "--quiet").code == 0
    assert command("map", "compare", "b.orbmap", "c.orbmap").code == 0
    assert command("map", "compare", file, "b.orbmap").code == 1

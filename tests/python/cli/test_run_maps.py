# SPDX-License-Identifier: BSD-3-Clause
"""``orbslam2py run`` with ``--save``, ``--load`` and what belongs to them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from orbslam2py import Sensor
from orbslam2py.maps import load_map
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from support.command_line import CommandLine, Results
from support.small_sequences import N_FAST, write_fast_part

pytestmark = pytest.mark.watchdog(60)


@pytest.fixture(scope="module")
def sequence(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_fast_part(tmp_path_factory.mktemp("sequences") / "lap", Sensor.RGBD)


def test_a_saved_map_is_loaded_and_localised_in(command: CommandLine, sequence: Path) -> None:
    mapping = ("--sensor", "rgbd", "--deterministic", "--save", "a.orbmap")
    done = command("run", sequence, *mapping, "--output", "first")
    assert (done.code, done.err) == (0, "")
    first = Results(Path("first")).report
    assert first["saved_map"] == "a.orbmap"
    assert "Map saved in a.orbmap" in done.out
    assert first["loaded_map"] is None
    before = Path("a.orbmap").read_bytes()

    localizing = ("--load", "a.orbmap", "--localize", "--deterministic")
    done = command("run", sequence, *localizing, "--output", "second")
    assert (done.code, done.err) == (0, "")
    second = Results(Path("second")).report
    assert second["sensor"] == "rgbd"
    assert second["settings"] == first["settings"]
    assert second["loaded_map"] == {
        "file": "a.orbmap",
        "keyframes": first["keyframes"],
        "map_points": first["map_points"],
        "runs": 1,
    }
    assert second["tracked"] == N_FAST
    assert second["map_points"] == first["map_points"]
    assert second["saved_map"] is None
    assert "Map saved" not in done.out
    assert Path("a.orbmap").read_bytes() == before
    paths = [np.loadtxt(f"{run}/trajectory.txt")[:, 1:4] for run in ("first", "second")]
    assert np.abs(paths[0] - paths[1]).max() < 0.02


def test_localize_may_stand_before_the_sequence(command: CommandLine, sequence: Path) -> None:
    command("run", sequence, "--save", "a.orbmap", "--output", "first")
    done = command("run", "--load", "a.orbmap", "--localize", sequence, "--output", "second")
    assert (done.code, done.err) == (0, "")
    done = command("run", sequence, "--localize", "5", "--output", "third")
    assert (done.code, done.err) == (0, "")


def test_a_map_is_extended_and_saved_under_its_own_name(
    command: CommandLine, sequence: Path
) -> None:
    options = ("--deterministic", "--save", "a.orbmap")
    command("run", sequence, "--max-frames", "14", *options, "--output", "first")
    small = load_map("a.orbmap")
    loaded = ("--start", "10", "--load", "a.orbmap")
    done = command("run", sequence, *loaded, *options, "--output", "second")
    assert (done.code, done.err) == (0, "")
    large = load_map("a.orbmap")
    assert len(large.contents.keyframes) > len(small.contents.keyframes)
    assert [len(run.frames) for run in large.runs] == [14, N_FAST - 10]


def test_autosave_and_images(command: CommandLine, sequence: Path) -> None:
    options = ("--save", "a.orbmap", "--autosave", "0.05", "--save-images")
    done = command("run", sequence, *options, "--output", "first")
    assert (done.code, done.err) == (0, "")
    saved = load_map("a.orbmap", images=True)
    assert set(saved.images) == set(saved.contents.keyframes.ids.tolist())
    assert len(saved.contents.keyframes) == Results(Path("first")).report["keyframes"]
    assert not list(Path().glob("*.orbmap-*"))


def test_a_pose_may_be_guessed(command: CommandLine, sequence: Path) -> None:
    command("run", sequence, "--save", "a.orbmap", "--output", "first")
    guess = ("--load", "a.orbmap", "--initial-pose", "0.01,0,0.02")
    done = command("run", sequence, *guess, "--localize", "--output", "second")
    assert (done.code, done.err) == (0, "")
    assert Results(Path("second")).report["tracked"] == N_FAST


def test_a_run_that_finds_nothing_of_the_map_says_so(
    command: CommandLine, sequence: Path, tmp_path: Path
) -> None:
    command("run", sequence, "--save", "a.orbmap", "--output", "first")
    options = SyntheticOptions(
        world="two-rooms", sensor=Sensor.RGBD, frames=6, size=(320, 240), seed=9
    )
    elsewhere = SyntheticSequence(options).write(tmp_path / "elsewhere")
    other = ("--load", "a.orbmap", "--allow-other-setup", "--save", "b.orbmap")
    done = command("run", elsewhere, *other, "--output", "second")
    assert done.code == 3
    assert "searching the loaded map (6 of 6 frames)" in done.err
    report = Results(Path("second")).report
    assert report["lost_reasons"] == {"searching the loaded map": 6}
    assert report["resets"] == 0
    # The old map is not lost: it is saved again as it was.
    same = load_map("b.orbmap").contents.first_difference(load_map("a.orbmap").contents)
    assert same is None

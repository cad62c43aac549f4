# SPDX-License-Identifier: BSD-3-Clause
"""``orbslam2py run`` and ``demo``: files, figures, options, exit codes."""

from __future__ import annotations

import json
import logging
import shutil
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

import orbslam2py
from orbslam2py import Sensor, Settings
from orbslam2py.maps import load_map
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from orbslam2py.trajectory import read_tum
from support.command_line import RUN_FILES, CommandLine, Results
from support.small_sequences import N_FAST, elsewhere, write_fast_part

pytestmark = pytest.mark.watchdog(40)

STAGES = ["extract", "stereo", "predict", "local_map", "keyframe", "track"]
PARTS = ["insert", "cull_points", "new_points", "fuse", "cull_keyframes"]


@pytest.fixture(scope="module")
def sequences(tmp_path_factory: pytest.TempPathFactory) -> dict[Sensor, Path]:
    folder = tmp_path_factory.mktemp("sequences")
    return {
        sensor: write_fast_part(folder / str(sensor), sensor)
        for sensor in (Sensor.RGBD, Sensor.STEREO)
    }


@pytest.fixture
def rgbd(sequences: dict[Sensor, Path]) -> Path:
    return sequences[Sensor.RGBD]


# ---- what a run leaves behind --------------------------------------------------------------------
@pytest.mark.parametrize("sensor", [Sensor.STEREO, Sensor.RGBD])
def test_results(command: CommandLine, sequences: dict[Sensor, Path], sensor: Sensor) -> None:
    done = command("run", sequences[sensor], "--sensor", sensor, "--output", "results")
    assert (done.code, done.err) == (0, "")
    assert "Results are in results" in done.out
    results = Results(Path("results"))
    assert {path.name for path in results.folder.iterdir()} == RUN_FILES

    report = results.report
    expected = {
        "version": orbslam2py.__version__,
        "sequence": str(sensor),
        "layout": "tum" if sensor is Sensor.RGBD else "kitti",
        "sensor": str(sensor),
        "deterministic": False,
        "seed": 0,
        "frames": N_FAST,
        "tracked": N_FAST,
        "tracked_fraction": 1.0,
        "skipped_frames": 0,
        "loops_closed": 0,
        "relocalisations": 0,
        "resets": 0,
        "ate_alignment": "se3",
    }
    assert expected.items() <= report.items()
    assert report["keyframes"] >= 2
    assert report["map_points"] > 300
    assert report["ate_rmse_m"] < 0.03
    assert report["rpe_translation_rmse_m"] < 0.03
    assert report["rpe_rotation_rmse_deg"] < 0.5
    assert report["slam_frames_per_second"] > 0
    assert 0 < report["frames_per_second"] <= N_FAST / report["seconds"] * 1.001
    assert 50 < report["peak_memory_mb"] < 4000
    assert Settings.load(results.folder / "settings.yaml", sensor).sensor is sensor
    assert "Camera.fx" in report["settings"]
    if sensor is Sensor.STEREO:
        assert {"t_rel_percent", "r_rel_deg_per_100m"} <= report.keys()
    stages = report["milliseconds"]
    assert set(STAGES) | {"mapping"} | {f"mapping.{part}" for part in PARTS} <= stages.keys()
    for numbers in stages.values():
        assert {"median", "mean", "p99"} <= numbers.keys()


def test_trajectory_files(command: CommandLine, rgbd: Path) -> None:
    assert command("run", rgbd, "--sensor", "rgbd", "--output", "r", "--deterministic").code == 0
    results = Results(Path("r"))
    stamps = [
        line.split()[0] for line in (rgbd / "rgb.txt").read_text().splitlines() if "#" not in line
    ]
    for name in ("trajectory.txt", "trajectory_online.txt"):
        rows = [line.split() for line in results.lines(name) if not line.startswith("#")]
        assert [row[0] for row in rows] == stamps, "the source's own digits"
        assert all(len(row) == 8 for row in rows)
    final = read_tum(results.folder / "trajectory.txt")
    np.testing.assert_allclose(final.T_wc[0], np.eye(4), atol=1e-8)
    kitti = np.loadtxt(results.folder / "trajectory_kitti.txt").reshape(-1, 3, 4)
    np.testing.assert_allclose(kitti, final.T_wc[:, :3], atol=1e-6)
    keyframes = read_tum(results.folder / "keyframes.txt")
    assert len(keyframes) == results.report["keyframes"]
    nearest = np.abs(keyframes.timestamps[:, None] - final.timestamps).argmin(axis=1)
    np.testing.assert_allclose(keyframes.positions, final.positions[nearest], atol=0.02)


def test_frames_csv(command: CommandLine, rgbd: Path) -> None:
    command("run", rgbd, "--sensor", "rgbd", "--output", "r", "--deterministic")
    results = Results(Path("r"))
    header = results.lines("frames.csv")[0].split(",")
    assert header[:8] == [
        "index",
        "timestamp",
        "map",
        "state",
        "reason",
        "inliers",
        "matches",
        "keyframe",
    ]
    assert header[8] == "reference_keyframe"
    assert header[9:16] == ["tx", "ty", "tz", "qx", "qy", "qz", "qw"]
    assert header[16:19] == ["std_position", "std_angle", "visual_odometry"]
    assert set(header[19:]) >= {f"ms_{stage}" for stage in STAGES}
    frames = results.frames
    assert [int(row["index"]) for row in frames] == list(range(N_FAST))
    assert all(row["state"] == "OK" and row["reason"] == "" for row in frames)
    assert all(row["map"] == "0" for row in frames)
    assert frames[0]["keyframe"] == "1"
    assert sum(int(row["keyframe"]) for row in frames) >= results.report["keyframes"]
    assert all(int(row["inliers"]) >= 30 for row in frames)
    assert all(float(row["ms_track"]) > 0 for row in frames)
    assert all(0 < float(row["std_position"]) < 0.05 for row in frames)
    assert all(0 < float(row["std_angle"]) < 1 for row in frames)
    assert {row["visual_odometry"] for row in frames} == {"0"}
    online = read_tum(results.folder / "trajectory_online.txt")
    positions = [[float(row[axis]) for axis in ("tx", "ty", "tz")] for row in frames]
    np.testing.assert_allclose(positions, online.positions, atol=2e-9)


@pytest.mark.picture
def test_points_and_picture(command: CommandLine, rgbd: Path) -> None:
    command("run", rgbd, "--sensor", "rgbd", "--output", "r")
    content = Path("r/points.ply").read_bytes()
    header, _, body = content.partition(b"end_header\n")
    n = Results(Path("r")).report["map_points"]
    assert f"element vertex {n}".encode() in header
    points = np.frombuffer(body, "<f4").reshape(-1, 3)
    assert len(points) == n
    assert np.median(points[:, 2]) > 0.5, "in front of the first camera"
    picture = cv2.imread("r/trajectory.png")
    assert picture is not None
    assert min(picture.shape[:2]) > 500
    assert picture.std() > 10


def test_deterministic_runs_write_the_same_bytes(command: CommandLine, rgbd: Path) -> None:
    for name in ("a", "b"):
        arguments = ("--sensor", "rgbd", "--output", name, "--deterministic", "--quiet")
        assert command("run", rgbd, *arguments).code == 0
    for file in RUN_FILES - {"report.json", "report.html", "frames.csv", "trajectory.png"}:
        assert Path("a", file).read_bytes() == Path("b", file).read_bytes(), file
    assert Results(Path("a")).report["deterministic"] is True


# ---- options -------------------------------------------------------------------------------------
def test_part_of_a_sequence(command: CommandLine, rgbd: Path) -> None:
    part = ("--start", 3, "--stride", 2, "--max-frames", 5)
    assert command("run", rgbd, "--sensor", "rgbd", "--output", "r", *part).code == 0
    results = Results(Path("r"))
    assert [int(row["index"]) for row in results.frames] == [3, 5, 7, 9, 11]
    assert results.report["frames"] == 5
    assert len(np.loadtxt("r/trajectory_kitti.txt")) == 5


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--start", N_FAST), "past the end"),
        (("--deterministic", "--realtime"), "exclude each other"),
        (("--stride", 0), "--stride"),
        (("--max-frames", 0), "--max-frames"),
        (("--start", -1), "--start"),
        (("--seed", -1), "--seed"),
        (("--settings", "no-such-camera"), "no-such-camera"),
        (("--vocabulary", "no-such-file"), "no-such-file"),
        (("--speed", 3), "--speed"),
        (("--sensor", "lidar"), "lidar"),
    ],
)
def test_wrong_usage(
    command: CommandLine, rgbd: Path, options: tuple[object, ...], message: str
) -> None:
    done = command("run", rgbd, "--sensor", "rgbd", *options)
    assert done.code == 2
    assert message in done.err
    assert "Traceback" not in done.err
    assert list(Path().iterdir()) == [], "nothing is left behind"


def test_usage_without_sequence(command: CommandLine) -> None:
    assert command("run", "--sensor", "rgbd").code == 2
    done = command("run", "nowhere", "--sensor", "rgbd")
    assert done.code == 2
    assert "nowhere" in done.err


def test_real_time_drops_frames(command: CommandLine, tmp_path: Path) -> None:
    options = SyntheticOptions(
        world="corridor", sensor="rgbd", frames=60, size=(320, 240), fps=1000, speed=50
    )
    SyntheticSequence(options).write(tmp_path / "fast")
    done = command("run", "fast", "--sensor", "rgbd", "--output", "r", "--realtime")
    results = Results(Path("r"))
    rows = results.frames
    dropped = [row for row in rows if row["state"] == "DROPPED"]
    assert len(rows) == 60
    assert results.report["dropped_frames"] == len(dropped) > 10
    assert results.report["skipped_frames"] == 0
    assert all("real time" in row["reason"] and row["tx"] == "" for row in dropped)
    assert rows[0]["state"] != "DROPPED"
    assert done.code == 0


def test_real_time_takes_as_long_as_the_recording(command: CommandLine, rgbd: Path) -> None:
    done = command("run", rgbd, "--sensor", "rgbd", "--output", "r", "--realtime")
    assert done.code == 0
    assert Results(Path("r")).report["seconds"] >= (N_FAST - 1) / 20


def test_quiet(command: CommandLine, rgbd: Path) -> None:
    done = command("run", rgbd, "--sensor", "rgbd", "--output", "r", "--quiet")
    assert (done.code, done.out, done.err) == (0, "", "")


def test_output_folders(command: CommandLine, rgbd: Path) -> None:
    assert command("run", rgbd, "--sensor", "rgbd", "--max-frames", 3).code == 0
    runs = [path for path in Path("runs").iterdir() if path.name != "latest"]
    assert len(runs) == 1
    assert runs[0].name.startswith("rgbd-")
    assert Path("runs/latest").resolve() == runs[0].resolve()
    # A second run in the same second gets a name of its own.
    assert command("run", rgbd, "--sensor", "rgbd", "--max-frames", 3).code == 0
    assert len(list(Path("runs").iterdir())) == 3
    assert Path("runs/latest").resolve() != runs[0].resolve()
    assert command("run", rgbd, "--sensor", "rgbd", "--output", "elsewhere").code == 0
    assert Path("runs/latest").resolve().parent == Path("runs").resolve()


def test_a_folder_with_files_is_not_touched_without_force(command: CommandLine, rgbd: Path) -> None:
    folder = Path("r")
    folder.mkdir()
    (folder / "thesis.txt").write_text("precious")
    (folder / "trajectory_map0.txt").write_text("of an earlier run")
    (folder / "frames.csv").write_text("index,timestamp,map,state,reason\n0,0,0,OK,\n")
    done = command("run", rgbd, "--sensor", "rgbd", "--output", folder)
    assert done.code == 2
    assert "not empty" in done.err
    assert "--force" in done.err
    assert len(list(folder.iterdir())) == 3
    assert command("run", rgbd, "--sensor", "rgbd", "--output", folder, "--force").code == 0
    assert (folder / "thesis.txt").read_text() == "precious"
    assert {path.name for path in folder.iterdir()} == RUN_FILES | {"thesis.txt"}


def test_brackets_are_no_markup(command: CommandLine, rgbd: Path) -> None:
    sequence = Path(shutil.copytree(rgbd, "lap[bold]"))
    depth = sorted((sequence / "depth").iterdir())[5]
    depth.unlink()
    done = command("run", sequence, "--sensor", "rgbd", "--output", "out[red]", "--max-frames", 8)
    assert done.code == 0
    assert "Results are in out[red]\n" in done.out
    assert "lap[bold] (rgbd)" in done.out
    assert "Warning: frame 5 skipped: " in done.err
    assert f"lap[bold]/depth/{depth.name} is listed but missing\n" in done.err
    done = command("run", "no[/such]", "--sensor", "rgbd")
    assert done.code == 2
    assert "no[/such]" in done.err
    done = command("evaluate", "out[red]/trajectory.txt", sequence)
    assert done.code == 0
    assert "lap[bold]" in done.out
    small = ("--frames", 2, "--size", "64x64", "--sensor", "rgbd")
    done = command("synthesize", "made[blue]", *small)
    assert done.code == 0
    assert "made[blue]\n" in done.out


def test_long_paths_are_printed_in_one_piece(command: CommandLine, rgbd: Path) -> None:
    folder = Path("/".join(["a rather long name of a folder"] * 5))
    done = command("run", rgbd, "--sensor", "rgbd", "--output", folder, "--max-frames", 2)
    assert f"Results are in {folder}\n" in done.out


# ---- nothing tracked -----------------------------------------------------------------------------
def test_a_doubted_calibration_is_named_first(command: CommandLine, rgbd: Path) -> None:
    sequence = Path(shutil.copytree(rgbd, "black"))
    for path in (sequence / "rgb").iterdir():
        cv2.imwrite(str(path), np.zeros((240, 320), np.uint8))
    settings = ("--settings", "tum1")  # of images of another size
    done = command("run", sequence, "--sensor", "rgbd", *settings, "--output", "r")
    assert done.code == 3
    (warning,) = Results(Path("r")).report["warnings"]
    last = done.err.rstrip().rpartition("\n")[2]
    assert warning in done.err
    assert last.startswith("Nothing could be tracked: most likely because of the calibration")


def test_nothing_to_see(command: CommandLine, rgbd: Path) -> None:
    sequence = Path(shutil.copytree(rgbd, "black"))
    for path in (sequence / "rgb").iterdir():
        cv2.imwrite(str(path), np.zeros((240, 320), np.uint8))
    done = command("run", sequence, "--sensor", "rgbd", "--output", "r")
    assert done.code == 3
    assert "Nothing could be tracked: too few keypoints" in done.err
    results = Results(Path("r"))
    assert results.report["tracked"] == 0
    assert results.report["tracked_fraction"] == 0.0
    assert len(results.frames) == N_FAST
    assert {row["reason"] for row in results.frames} == {"too few keypoints"}
    assert {row["state"] for row in results.frames} == {"NOT_INITIALIZED"}
    names = {path.name for path in results.folder.iterdir()}
    made = {"frames.csv", "map.npz", "points.ply", "report.html", "report.json", "settings.yaml"}
    assert names == made, "no path without poses"


def test_what_an_earlier_run_left_is_removed(command: CommandLine, rgbd: Path) -> None:
    assert command("run", rgbd, "--sensor", "rgbd", "--output", "r", "--max-frames", 3).code == 0
    for path in (Path(shutil.copytree(rgbd, "black")) / "rgb").iterdir():
        cv2.imwrite(str(path), np.zeros((240, 320), np.uint8))
    assert command("run", "black", "--sensor", "rgbd", "--output", "r", "--force").code == 3
    names = {path.name for path in Path("r").iterdir()}
    made = {"frames.csv", "map.npz", "points.ply", "report.html", "report.json", "settings.yaml"}
    assert names == made


# ---- several maps --------------------------------------------------------------------------------
def show_another_place(sequence: Path, frame: int) -> None:
    """What a small map is given up for; the depth stays as it is."""
    names = sorted(path.name for path in (sequence / "rgb").iterdir())
    cv2.imwrite(str(sequence / "rgb" / names[frame]), elsewhere(Sensor.RGBD).image)


def test_earlier_maps_are_kept(command: CommandLine, rgbd: Path) -> None:
    sequence = Path(shutil.copytree(rgbd, "gap"))
    names = sorted(path.name for path in (sequence / "rgb").iterdir())
    show_another_place(sequence, 8)
    cv2.imwrite(str(sequence / "rgb" / names[9]), np.zeros((240, 320), np.uint8))
    done = command("run", sequence, "--sensor", "rgbd", "--output", "r", "--deterministic")
    assert done.code == 0
    results = Results(Path("r"))
    assert results.report["resets"] == 1
    assert results.report["tracked"] == N_FAST - 2
    maps = [row["map"] for row in results.frames]
    assert maps == ["0"] * 9 + ["1"] * (N_FAST - 9)
    states = [row["state"] for row in results.frames]
    assert states[8:10] == ["LOST", "NOT_INITIALIZED"]
    assert len(read_tum(Path("r/trajectory_map0.txt"))) == 8
    assert len(read_tum(Path("r/trajectory.txt"))) == N_FAST - 10
    # Poses of two maps are in no file together; frames.csv has all of them.
    assert len(read_tum(Path("r/trajectory_online.txt"))) == N_FAST - 10
    assert sum(row["tx"] != "" for row in results.frames) == N_FAST - 2


def test_a_last_map_without_a_pose(command: CommandLine, rgbd: Path) -> None:
    sequence = Path(shutil.copytree(rgbd, "dark"))
    show_another_place(sequence, 8)
    for path in sorted((sequence / "rgb").iterdir())[9:]:
        cv2.imwrite(str(path), np.zeros((240, 320), np.uint8))
    done = command("run", sequence, "--sensor", "rgbd", "--output", "r", "--deterministic")
    assert done.code == 0
    assert "lost at the end: no pose from frame 8 on" in done.err
    assert "what helps: " in done.err
    assert "the path until then is in trajectory_map0.txt\n" in done.err
    names = {path.name for path in Path("r").iterdir() if path.name.startswith("trajectory")}
    assert names == {"trajectory_map0.txt"}


# ---- the other commands --------------------------------------------------------------------------
@pytest.mark.parametrize("sensor", ["stereo", "rgbd"])
def test_demo(command: CommandLine, sensor: str) -> None:
    done = command("demo", "--sensor", sensor, "--frames", 12)
    assert done.code == 0
    assert Path("runs/demo/trajectory.png").is_file()
    assert Path("runs/latest").resolve() == Path("runs/demo").resolve()
    assert Results(Path("runs/demo")).report["tracked"] == 12
    assert "Look at runs/demo/trajectory.png" in done.out
    done = command("demo", "--sensor", sensor, "--frames", 10, "--quiet")
    assert (done.code, done.out, done.err) == (0, "", "")
    assert Results(Path("runs/demo")).report["frames"] == 10


def test_demo_leaves_other_folders_alone(command: CommandLine) -> None:
    Path("home").mkdir()
    Path("home/points.ply").write_text("mine")
    assert command("demo", "--frames", 10, "--output", "home").code == 2
    assert Path("home/points.ply").read_text() == "mine"


def test_run_then_evaluate(command: CommandLine, rgbd: Path) -> None:
    command("run", rgbd, "--sensor", "rgbd", "--output", "r", "--quiet")
    done = command("evaluate", "r/trajectory.txt", rgbd / "groundtruth.txt", "--json", "f.json")
    assert done.code == 0
    figures = json.loads(Path("f.json").read_text())
    assert figures["ate_rmse_m"] == pytest.approx(Results(Path("r")).report["ate_rmse_m"], abs=1e-6)


def test_version_and_help(command: CommandLine) -> None:
    done = command("--version")
    assert (done.code, done.out) == (0, f"orbslam2py {orbslam2py.__version__}\n")
    for arguments in (["--help"], ["run", "-h"], ["demo", "-h"], ["vocabulary", "--help"]):
        done = command(*arguments)
        assert done.code == 0
        assert "Usage" in done.out
    assert command("fly").code == 2


def test_as_a_module() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "orbslam2py", "--version"],
        capture_output=True,
        text=True,
        check=False,
        timeout=30,
    )
    assert (done.returncode, done.stdout) == (0, f"orbslam2py {orbslam2py.__version__}\n")


def test_a_broken_ground_truth_costs_only_the_comparison(command: CommandLine, rgbd: Path) -> None:
    sequence = Path(shutil.copytree(rgbd, "lap"))
    (sequence / "groundtruth.txt").write_text("0.0 1 2 three\n")
    done = command("run", sequence, "--sensor", "rgbd", "--output", "r", "--max-frames", 5)
    assert done.code == 0
    assert "no comparison with ground truth" in done.err
    assert "ate_rmse_m" not in Results(Path("r")).report
    assert logging.getLogger("orbslam2py").propagate, "the test's own log is as it was"


def test_changed_thresholds_are_used_and_kept(command: CommandLine, rgbd: Path) -> None:
    done = command(
        *("run", rgbd, "--output", "results", "--save", "map.orbmap"),
        *("--set", "tracking.map_matches=12", "--set", "acceptance.search_again=false"),
    )
    assert done.code == 0, done.err
    changed = {"tracking.map_matches": 12, "acceptance.search_again": False}
    assert Results(Path("results")).report["options"]["config"] == changed
    assert load_map(Path("map.orbmap")).runs[-1].options["config"] == changed


def test_config_lists_thresholds(command: CommandLine) -> None:
    done = command("config", "keyframes")
    assert done.code == 0
    assert "keyframes.share" in done.out
    assert "tracking." not in done.out

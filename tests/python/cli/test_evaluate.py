# SPDX-License-Identifier: BSD-3-Clause
"""The command ``orbslam2py evaluate``."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest
import typer
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

from orbslam2py import DatasetError, Sensor, Trajectory
from orbslam2py.cli import main
from orbslam2py.cli.evaluate import evaluate
from orbslam2py.datasets import open_sequence
from orbslam2py.evaluation import Alignment, evaluate_trajectory
from orbslam2py.trajectory import write_kitti, write_tum
from support.made_up_paths import straight, wander
from support.small_folders import STAMPS, write_euroc


def shrunk(truth: Trajectory) -> Trajectory:
    """The same walk at half its size, with noise."""
    T_wc = truth.T_wc.copy()
    T_wc[:, :3, 3] += np.random.default_rng(1).normal(scale=0.05, size=(len(truth), 3))
    T_wc[:, :3, 3] *= 0.5
    return Trajectory(truth.timestamps, T_wc)


app = typer.Typer()
app.command()(evaluate)


def test_command(tmp_path: Path) -> None:
    truth = wander(100)
    estimate = shrunk(truth)
    write_tum(tmp_path / "a.txt", estimate)
    write_tum(tmp_path / "b.txt", truth)
    arguments = [str(tmp_path / "a.txt"), str(tmp_path / "b.txt"), "--alignment", "sim3"]
    result = CliRunner().invoke(app, [*arguments, "--json", str(tmp_path / "c.json")])
    assert result.exit_code == 0, result.output
    figures = json.loads((tmp_path / "c.json").read_text())
    expected = evaluate_trajectory(estimate, truth, Alignment.SIM3).as_dict()
    assert figures["ate_rmse_m"] == pytest.approx(expected["ate_rmse_m"], rel=1e-4)
    assert figures["ate_alignment"] == "sim3"
    assert figures["t_rel_percent"] is None
    assert f"{figures['ate_rmse_m']:.6f}" in result.output
    assert "rpe rotation rmse over 1 s" in result.output


@pytest.mark.parametrize("metric", [True, False])
def test_one_camera_with_an_imu_is_judged_without_scale(tmp_path: Path, metric: bool) -> None:
    truth = wander(100)
    write_tum(tmp_path / "trajectory.txt", shrunk(truth))
    write_tum(tmp_path / "b.txt", truth)
    report = {"sensor": "mono", "imu": {"metric": metric}}
    (tmp_path / "report.json").write_text(json.dumps(report))
    arguments = [str(tmp_path / "trajectory.txt"), str(tmp_path / "b.txt")]
    result = CliRunner().invoke(app, [*arguments, "--json", str(tmp_path / "c.json")])
    assert result.exit_code == 0, result.output
    figures = json.loads((tmp_path / "c.json").read_text())
    assert figures["ate_alignment"] == ("se3" if metric else "sim3")
    assert (figures["ate_rmse_m"] > 0.1) is metric
    assert ("sensors measure metres" in result.output) is metric
    assert "cannot see metres" not in result.output + result.stderr


def test_command_on_kitti_files(tmp_path: Path) -> None:
    truth, estimate = straight(251, 1.0), straight(251, 1.01)
    write_kitti(tmp_path / "a.txt", estimate)
    write_kitti(tmp_path / "b.txt", truth)
    path = tmp_path / "c.json"
    arguments = [str(tmp_path / "a.txt"), str(tmp_path / "b.txt"), "--json", str(path)]
    assert CliRunner().invoke(app, arguments).exit_code == 0
    figures = json.loads(path.read_text())
    assert figures["t_rel_percent"] == pytest.approx((15 * 1.01 + 5 * 1.005) / 20)
    assert figures["rpe_translation_rmse_m_1s"] is None
    write_tum(tmp_path / "b.txt", truth)
    result = CliRunner().invoke(app, arguments)
    assert isinstance(result.exception, DatasetError)
    assert "251 rows without time stamps" in str(result.exception)


@pytest.mark.parametrize("file_format", ["tum", "kitti"])
def test_command_on_a_folder(tmp_path: Path, file_format: str) -> None:
    folder = tmp_path / "09"
    (folder / "image_0").mkdir(parents=True)
    truth = wander(30)
    (folder / "times.txt").write_text("".join(f"{t}\n" for t in truth.timestamps))
    write_kitti(folder / "poses.txt", truth)
    writer = write_tum if file_format == "tum" else write_kitti
    writer(tmp_path / "a.txt", truth)
    result = CliRunner().invoke(app, [str(tmp_path / "a.txt"), str(folder)])
    assert result.exit_code == 0, result.output
    assert "matched poses" in result.output
    (folder / "poses.txt").unlink()
    result = CliRunner().invoke(app, [str(tmp_path / "a.txt"), str(folder)])
    assert "without ground truth" in str(result.exception)


def test_command_moves_the_body_to_the_camera(tmp_path: Path) -> None:
    truth = wander(40, rate=20.0)
    T_BS = np.eye(4)
    T_BS[:3, :3] = Rotation.from_rotvec([0, 0, np.pi / 2]).as_matrix().round(12)
    T_BS[:3, 3] = [0.07, -0.02, 0.01]
    body = truth.T_wc @ np.linalg.inv(T_BS)
    rows = []
    for stamp, T in zip(truth.timestamps, body, strict=True):
        x, y, z, w = Rotation.from_matrix(T[:3, :3]).as_quat()
        values = [*T[:3, 3], w, x, y, z]
        rows.append(",".join([str(round(stamp * 1e9)), *(f"{v:.12f}" for v in values)]))
    csv = tmp_path / "mav0" / "state_groundtruth_estimate0" / "data.csv"
    csv.parent.mkdir(parents=True)
    csv.write_text("#t\n" + "\n".join(rows) + "\n")
    write_tum(tmp_path / "a.txt", truth)
    arguments = [str(tmp_path / "a.txt"), str(csv), "--json", str(tmp_path / "c.json")]

    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0
    assert "poses of the body" in result.stderr
    assert "--extrinsics" in result.stderr
    without = json.loads((tmp_path / "c.json").read_text())["ate_rmse_m"]
    calibration = tmp_path / "mav0" / "cam0" / "sensor.yaml"
    calibration.parent.mkdir()
    data = ", ".join(str(value) for value in T_BS.ravel())
    calibration.write_text(
        f"T_BS:\n  rows: 4\n  cols: 4\n  data: [{data}]\nresolution: [752, 480]\n"
        "intrinsics: [450, 450, 376, 240]\ndistortion_coefficients: [0, 0, 0, 0]\n"
    )
    assert CliRunner().invoke(app, arguments).exit_code == 0
    assert json.loads((tmp_path / "c.json").read_text())["ate_rmse_m"] < 1e-6 < without
    other = tmp_path / "elsewhere.yaml"
    calibration.rename(other)
    numbers = tmp_path / "matrix.txt"
    np.savetxt(numbers, T_BS[:3])
    for given in (other, numbers):
        result = CliRunner().invoke(app, [*arguments, "--extrinsics", str(given)])
        assert result.exit_code == 0, result.output
        assert result.stderr == ""
        assert json.loads((tmp_path / "c.json").read_text())["ate_rmse_m"] < 1e-6
    write_tum(tmp_path / "body.txt", Trajectory(truth.timestamps, body))
    result = CliRunner().invoke(
        app, [arguments[0], str(tmp_path / "body.txt"), *arguments[2:], "--extrinsics", str(other)]
    )
    assert result.exit_code == 0, result.output
    assert json.loads((tmp_path / "c.json").read_text())["ate_rmse_m"] < 1e-6


def test_folder_of_euroc(tmp_path: Path) -> None:
    """The raw left camera of a run of one camera, the rectified one of stereo; extrinsics given."""
    root = write_euroc(tmp_path / "V9_01") / "mav0"
    right = root / "cam1" / "sensor.yaml"
    c, s = np.cos(0.1), np.sin(0.1)  # nods, and with it the rectification
    text = right.read_text().replace("[0.0, -1.0, 0.0,", f"[0.0, {-c}, {s},")
    right.write_text(text.replace("0.0, 0.0, 1.0, 0.03", f"0.0, {s}, {c}, 0.03"))
    (root / "state_groundtruth_estimate0").mkdir()
    rows = []
    for k, stamp in enumerate(STAMPS):
        x, y, z, w = Rotation.from_rotvec([0.0, 0.0, 0.8 * k]).as_quat()
        rows.append(f"{stamp},{k},0,{0.5 * k * k},{w},{x},{y},{z}\n")
    (root / "state_groundtruth_estimate0" / "data.csv").write_text("#t\n" + "".join(rows))
    truth = open_sequence(tmp_path / "V9_01", Sensor.MONOCULAR).ground_truth()
    assert truth is not None
    estimate = tmp_path / "a.txt"
    estimate.write_text("".join(f"{line}\n" for line in tum_lines(truth)))

    def figures(*options: object) -> dict[str, float]:
        path = tmp_path / "c.json"
        arguments = [estimate, tmp_path / "V9_01", "--alignment", "se3", "--json", path, *options]
        result = CliRunner().invoke(app, list(map(str, arguments)))
        assert result.exit_code == 0, result.output + str(result.exception)
        return dict(json.loads(path.read_text()))

    assert figures()["rpe_rotation_rmse_deg"] > 1, "rectified"
    (tmp_path / "report.json").write_text('{"sensor": "mono"}')
    assert figures()["rpe_rotation_rmse_deg"] < 1e-4
    calibration = tmp_path / "elsewhere.yaml"
    (root / "cam0" / "sensor.yaml").rename(calibration)
    assert figures("--extrinsics", calibration)["ate_rmse_m"] < 1e-6
    result = CliRunner().invoke(app, [str(estimate), str(tmp_path / "V9_01")])
    assert "without ground truth" in str(result.exception)


def tum_lines(path: Trajectory) -> list[str]:
    lines = []
    for stamp, T in zip(STAMPS, path.T_wc, strict=True):
        values = [*T[:3, 3], *Rotation.from_matrix(T[:3, :3]).as_quat()]
        seconds = f"{stamp // 10**9}.{stamp % 10**9:09d}"
        lines.append(" ".join([seconds, *(f"{value:.9f}" for value in values)]))
    return lines


def test_offset_between_the_clocks(tmp_path: Path) -> None:
    truth = wander(40)
    write_tum(tmp_path / "a.txt", truth.shifted(-3.25))
    write_tum(tmp_path / "b.txt", truth)
    arguments = [str(tmp_path / "a.txt"), str(tmp_path / "b.txt"), "--offset", "3.25"]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    assert "40 of 40 poses matched" in result.output
    assert "differ by 0.00 ms (median)" in result.output


@pytest.mark.parametrize("sensor", ["mono", "rgbd", None])
def test_hint_and_choice_for_one_camera(tmp_path: Path, sensor: str | None) -> None:
    truth = wander(100)
    write_tum(tmp_path / "a.txt", shrunk(truth))
    write_tum(tmp_path / "b.txt", truth)
    if sensor is not None:
        (tmp_path / "report.json").write_text(json.dumps({"sensor": sensor}))
    arguments = [str(tmp_path / "a.txt"), str(tmp_path / "b.txt")]
    chosen = CliRunner().invoke(app, arguments)
    assert f"Alignment: {'se3' if sensor == 'rgbd' else 'sim3'}" in chosen.stdout
    assert chosen.stderr == ""
    rigid = CliRunner().invoke(app, [*arguments, "--alignment", "se3"])
    assert rigid.exit_code == 0
    assert ("give --alignment sim3" in rigid.stderr) == (sensor != "rgbd")


def test_single_matched_pose(tmp_path: Path) -> None:
    truth = wander(20)
    write_tum(tmp_path / "a.txt", truth.select(np.array([4])))
    write_tum(tmp_path / "b.txt", truth)
    path = tmp_path / "c.json"
    arguments = [str(tmp_path / "a.txt"), str(tmp_path / "b.txt"), "--json", str(path)]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    assert "no absolute error: 1 matched, and se3 takes at least 2 poses" in result.stderr
    assert "ate rmse" not in result.stdout
    assert json.loads(path.read_text())["ate_rmse_m"] is None


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [(["none.txt", "none.txt"], "cannot open none.txt"), ([], "Missing argument")],
)
def test_command_on_bad_input(arguments: list[str], expected: str) -> None:
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code != 0
    assert expected in result.output + str(result.exception)


def test_bad_input_ends_with_status_2(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    write_tum(tmp_path / "a.txt", wander(5))
    (tmp_path / "b.txt").write_text("1 2 3 4 5 6 7 x\n")
    paths = [str(tmp_path / "a.txt"), str(tmp_path / "b.txt")]
    monkeypatch.setattr(sys, "argv", ["orbslam2py", "evaluate", *paths])
    with pytest.raises(SystemExit) as caught:
        main()
    assert caught.value.code == 2
    assert "b.txt:1: 'x' is not a number" in capsys.readouterr().err


def test_positions_that_overflow(tmp_path: Path) -> None:
    truth = wander(20)
    write_tum(tmp_path / "b.txt", truth)
    T_wc = truth.T_wc.copy()
    T_wc[3, :3, 3] = 1e200
    write_tum(tmp_path / "a.txt", Trajectory(truth.timestamps, T_wc))
    result = CliRunner().invoke(app, [str(tmp_path / "a.txt"), str(tmp_path / "b.txt")])
    assert result.exit_code == 0, result.output
    assert "positions are too large" in result.stderr
    assert "rpe rotation rmse" in result.stdout

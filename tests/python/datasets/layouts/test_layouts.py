# SPDX-License-Identifier: BSD-3-Clause
"""Further data sets, each as a made-up miniature: recognised, read, and judged by its poses."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import pytest

import orbslam2py as orb
from orbslam2py.datasets import Layout, open_input, open_sequence, recognise
from orbslam2py.settings import Sensor
from orbslam2py.trajectory.rotations import poses_from, rotations_from_quaternions

N = 4
TURNED = rotations_from_quaternions(np.array([[0.0, 0.6, 0.0, 0.8]]))
T_WC = np.concatenate([poses_from(TURNED, np.array([[0.1 * i, 0.0, 1.0 - i]])) for i in range(N)])


def colour(number: int) -> npt.NDArray[np.uint8]:
    return np.full((24, 32, 3), (10 + number, 60, 110), np.uint8)


def depth(number: int) -> npt.NDArray[np.uint16]:
    image = np.full((24, 32), 1000 + number, np.uint16)
    image[0, 0] = 65535
    return image


def save(path: Path, image: npt.NDArray[np.generic]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(path), image)


def tum_lines(times: list[str]) -> str:
    q = "0 0.6 0 0.8"
    rows = zip(times, T_WC[:, :3, 3].tolist(), strict=True)
    return "".join(f"{t} {x!r} {y!r} {z!r} {q}\n" for t, (x, y, z) in rows)


def icl_nuim(folder: Path) -> None:
    for i in range(N):
        save(folder / f"rgb/{i + 1}.png", colour(i))
        save(folder / f"depth/{i + 1}.png", depth(i))
    (folder / "livingRoom2.gt.freiburg").write_text(tum_lines([str(i + 1) for i in range(N)]))
    # The order in which the data set lists them: depth first.
    lines = [f"{i} depth/{i}.png {i} rgb/{i}.png\n" for i in range(1, N + 1)]
    (folder / "associations.txt").write_text("".join(lines))


def seven_scenes(folder: Path) -> None:
    for i in range(N):
        name = f"frame-{i:06d}"
        save(folder / f"{name}.color.png", colour(i))
        save(folder / f"{name}.depth.png", depth(i))
        rows = ["\t ".join(f"{x: .15e}" for x in row) for row in T_WC[i]]
        (folder / f"{name}.pose.txt").write_text("\n".join(rows) + "\n")


def bonn(folder: Path) -> None:
    times = [f"1548339812.{i}5000" for i in range(N)]
    for i, time in enumerate(times):
        save(folder / f"rgb/{time}.png", colour(i))
        save(folder / f"depth/{time}.png", depth(i))
    for name in ("rgb", "depth"):
        (folder / f"{name}.txt").write_text("".join(f"{t} {name}/{t}.png\n" for t in times))
    (folder / "groundtruth.txt").write_text(tum_lines(times))


def replica(folder: Path) -> None:
    for i in range(N):
        save(folder / f"results/frame{i:06d}.jpg", colour(i))
        save(folder / f"results/depth{i:06d}.png", depth(i))
    (folder / "traj.txt").write_text(
        "".join(" ".join(map(repr, T.ravel().tolist())) + "\n" for T in T_WC)
    )
    camera = {"w": 32, "h": 24, "fx": 20.0, "fy": 21.0, "cx": 15.5, "cy": 11.5, "scale": 6553.5}
    (folder.parent / "cam_params.json").write_text(json.dumps({"camera": camera}))


SENSORS_YAML = """%YAML:1.0
---
d400_color_optical_frame:
   sensor_type: camera
   width: 32
   height: 24
   fps: 30
   intrinsics: !!opencv-matrix
      rows: 1
      cols: 4
      dt: d
      data: [ 20.0, 15.5, 21.0, 11.5 ]
"""


def openloris(folder: Path) -> None:
    times = [f"1560004885.{i}46" for i in range(N)]
    for i, time in enumerate(times):
        save(folder / f"color/{time}.png", colour(i))
        save(folder / f"aligned_depth/{time}.png", depth(i))
    for name in ("color", "aligned_depth"):
        (folder / f"{name}.txt").write_text("".join(f"{t} {name}/{t}.png\n" for t in times))
    (folder / "groundtruth.txt").write_text("#Time px py pz qx qy qz qw\n" + tum_lines(times))
    (folder / "sensors.yaml").write_text(SENSORS_YAML)


MINIATURES = {
    Layout.ICL_NUIM: (icl_nuim, "living_room_traj2", 5000.0, (481.2, 480.0, 319.5, 239.5)),
    Layout.SEVEN_SCENES: (seven_scenes, "seq-01", 1000.0, (585.0, 585.0, 320.0, 240.0)),
    Layout.BONN: (
        bonn,
        "rgbd_bonn_balloon",
        5000.0,
        (542.822841, 542.57687, 315.59352, 237.756098),
    ),
    Layout.REPLICA: (replica, "office0", 6553.5, (20.0, 21.0, 15.5, 11.5)),
    Layout.OPENLORIS: (openloris, "home1-1", 1000.0, (20.0, 21.0, 15.5, 11.5)),
}


@pytest.fixture(params=MINIATURES)
def miniature(request: pytest.FixtureRequest, tmp_path: Path) -> tuple[Layout, Path]:
    write, name, *_ = MINIATURES[request.param]
    folder = tmp_path / name
    folder.mkdir()
    write(folder)
    return request.param, folder


def test_recognised_and_read(miniature: tuple[Layout, Path]) -> None:
    layout, folder = miniature
    assert recognise(folder) is layout
    sequence = open_input(folder)
    assert (sequence.layout, sequence.sensor) == (layout, Sensor.RGBD)
    assert sequence.name == folder.name
    frames = list(open_sequence(folder))  # type: ignore[call-overload]
    assert len(frames) == N
    for i, frame in enumerate(frames):
        assert abs(int(frame.images.image[5, 5, 2]) - (10 + i)) <= 2  # in the order RGB; JPEG
        assert frame.images.depth[5, 5] == 1000 + i
        assert frame.images.depth[0, 0] == (0 if layout is Layout.SEVEN_SCENES else 65535)
    assert all(a.timestamp < b.timestamp for a, b in pairwise(frames))


def test_calibration(miniature: tuple[Layout, Path]) -> None:
    layout, folder = miniature
    _, _, factor, (fx, fy, cx, cy) = MINIATURES[layout]
    settings = open_sequence(folder, "rgbd").settings
    camera = settings.camera
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == (fx, fy, cx, cy)
    assert settings.depth is not None
    assert settings.depth.raw_per_metre == factor
    assert open_sequence(folder, "mono").settings.sensor is Sensor.MONOCULAR


def test_truth(miniature: tuple[Layout, Path]) -> None:
    """A true pose for every image, at its time."""
    _, folder = miniature
    sequence = open_sequence(folder)
    truth = sequence.ground_truth()
    assert truth is not None
    assert np.allclose(truth.timestamps, sequence.timestamps, atol=1e-9)
    assert np.allclose(truth.T_wc, T_WC, atol=1e-9)


def test_settings_beside_the_images_go_first(miniature: tuple[Layout, Path]) -> None:
    _, folder = miniature
    open_sequence(folder, "rgbd").settings.save(folder / "settings.yaml")
    text = (folder / "settings.yaml").read_text()
    (folder / "settings.yaml").write_text(text.replace("Camera.fps: 30", "Camera.fps: 17"))
    assert open_sequence(folder, "rgbd").settings.camera.fps == 17


def test_images_without_depth(miniature: tuple[Layout, Path]) -> None:
    layout, folder = miniature
    for path in [*folder.rglob("*depth*.png"), *folder.glob("depth/*"), folder / "depth.txt"]:
        path.unlink(missing_ok=True)
    for name in ("aligned_depth.txt", "associations.txt"):
        (folder / name).unlink(missing_ok=True)
    sequence = open_sequence(folder)
    assert (sequence.layout, sequence.sensor, len(sequence)) == (layout, Sensor.MONOCULAR, N)
    with pytest.raises(orb.DatasetError, match="no rgbd images; it can be used as: mono"):
        open_sequence(folder, "rgbd")


def test_an_unknown_pose_is_left_out(tmp_path: Path) -> None:
    seven_scenes(tmp_path)
    (tmp_path / "frame-000001.pose.txt").write_text("nan nan nan nan\n" * 4)
    (tmp_path / "frame-000002.pose.txt").unlink()
    truth = open_sequence(tmp_path).ground_truth()
    assert truth is not None
    assert np.allclose(truth.timestamps * 30, [0, 3])
    (tmp_path / "frame-000003.pose.txt").write_text("1 0 0\n" * 4)
    with pytest.raises(orb.DatasetError, match=r"frame-000003.pose.txt:1: expected 4 numbers"):
        open_sequence(tmp_path).ground_truth()


def test_registered_depth_goes_first(tmp_path: Path) -> None:
    seven_scenes(tmp_path)
    for i in range(N):
        save(tmp_path / f"frame-{i:06d}.depth.proj.png", depth(500 + i))
    images = open_sequence(tmp_path).load(0)
    assert images.depth is not None
    assert images.depth[5, 5] == 1500


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("../cam_params.json", "{}", "does not describe the camera: it needs 'camera'"),
        ("../cam_params.json", None, "cam_params.json is missing"),
        ("traj.txt", "1 2 3\n", r"traj.txt:1: expected 16 numbers, found 3"),
        ("traj.txt", " ".join(["1"] * 16) + "\n", "has 1 poses for 4 images"),
    ],
)
def test_bad_replica(tmp_path: Path, name: str, text: str | None, message: str) -> None:
    folder = tmp_path / "office0"
    replica(folder)
    if text is None:
        (folder / name).unlink()
    else:
        (folder / name).write_text(text)
    sequence = open_sequence(folder)
    with pytest.raises(orb.DatasetError, match=message):
        _ = (sequence.settings, sequence.ground_truth())


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("sensors.yaml", "nothing: 1\n", "does not describe the colour camera"),
        ("color.txt", "1.0\n", r"color.txt:1: expected 'timestamp path'"),
    ],
)
def test_bad_openloris(tmp_path: Path, name: str, text: str, message: str) -> None:
    openloris(tmp_path)
    (tmp_path / name).write_text(text)
    with pytest.raises(orb.DatasetError, match=message):
        _ = open_sequence(tmp_path).settings


def test_usual_order_of_intrinsics(tmp_path: Path) -> None:
    openloris(tmp_path)
    text = SENSORS_YAML.replace("20.0, 15.5, 21.0, 11.5", "20.0, 21.0, 15.5, 11.5")
    (tmp_path / "sensors.yaml").write_text(text)
    camera = open_sequence(tmp_path).settings.camera
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == (20, 21, 15.5, 11.5)


@pytest.mark.parametrize("cameras", [("cam0",), ("cam0", "cam1")])
def test_folders_like_euroc(tmp_path: Path, cameras: tuple[str, ...]) -> None:
    """One camera or two, without lists and without mav0."""
    for camera in cameras:
        for i in range(N):
            save(tmp_path / camera / "data" / f"140371527000000{i}000.png", colour(i)[:, :, 0])
    sequence = open_sequence(tmp_path, settings="euroc" if len(cameras) > 1 else "tum1")
    assert sequence.layout is Layout.EUROC
    assert sequence.sensor is (Sensor.STEREO if len(cameras) > 1 else Sensor.MONOCULAR)
    assert len(sequence) == N


@pytest.mark.parametrize("digits", [16, 19, 13])
def test_lists_of_images_like_nclt(tmp_path: Path, digits: int) -> None:
    """``Cam5/1357847239208312.tiff``: names are times."""
    names = [f"1357847239{i}08312000"[:digits] for i in range(N)]
    for i, name in enumerate(names):
        save(tmp_path / "Cam5" / f"{name}.tiff", colour(i))
    sequence = open_input(tmp_path / "Cam5", settings="tum1")
    texts = [sequence.timestamp_text(i) for i in range(N)]  # type: ignore[union-attr]
    assert texts == [f"{name[:10]}.{name[10:]}" for name in names]
    counted = open_input(tmp_path / "Cam5", settings="tum1", fps=10)
    assert counted.timestamps.tolist() == [0, 0.1, 0.2, 0.3]  # type: ignore[union-attr]


def test_the_imu_of_openloris(tmp_path: Path) -> None:
    openloris(tmp_path)
    assert open_sequence(tmp_path).imu() is None
    gyro = [f"{0.005 * k:.3f} 0.1 0.2 {0.005 * k:.3f}" for k in range(9)]
    accel = [f"{0.01 * k:.3f} {k} 0 9.8" for k in range(5)]
    for name, lines in (("gyroscope", gyro), ("accelerometer", accel)):
        text = "\n".join(["#Time x y z", *lines]) + "\n"
        (tmp_path / f"d400_{name}.txt").write_text(text)
    samples = open_sequence(tmp_path).imu()
    assert len(samples) == 9
    assert samples.data[3].tolist() == pytest.approx([0.015, 0.1, 0.2, 0.015, 1.5, 0, 9.8])

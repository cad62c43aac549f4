# SPDX-License-Identifier: BSD-3-Clause
"""Every format of the registry is recognised, and read with its true numbers."""

from __future__ import annotations

import json
import random
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orbslam2py import Sensor, Settings, SettingsError
from orbslam2py.calibration import CameraFileFormat, read_camera_file
from orbslam2py.calibration.formats import READERS
from orbslam2py.settings.foreign import FORMATS, recognise_camera_file
from support import foreign_cameras as files
from support import lens_files
from support.camera_files import KALIBR, KITTI, OPENCV, ROS, written
from support.foreign_cameras import CX, CY, FX, FY, RATIONAL, SIZE, D

FIVE, FOUR, NONE = D, (*D[:4], 0.0), (0.0,) * 5
ONE_CAMERA = {
    "ros1": (files.ROS1, "ros", FIVE),
    "ros2": (files.ROS2, "ros", FIVE),
    "ost": (files.OST, "ost", FIVE),
    "euroc": (files.EUROC, "euroc", FOUR),
    "vins": (files.VINS, "vins", FOUR),
    "vins mono": (files.VINS_MONO, "vins", FOUR),
    "stella_vslam": (files.STELLA, "stella_vslam", FIVE),
    "fca": (files.FCA, "fca", FIVE),
    "basalt": (files.BASALT, "basalt", NONE),
    "nerfstudio": (files.NERFSTUDIO, "nerfstudio", FIVE),
    "nerfstudio, by frames": (files.NERFSTUDIO_FRAMES, "nerfstudio", FIVE),
    "open3d": (files.OPEN3D, "open3d", NONE),
    "replica": (files.REPLICA, "replica", NONE),
    "record3d": (files.RECORD3D, "record3d", NONE),
    "polycam": (files.POLYCAM, "polycam", NONE),
    "realsense": (files.REALSENSE, "numbers", NONE),
    "simple": (files.SIMPLE, "numbers", FIVE),
    "simple yaml": (files.SIMPLE_YAML, "numbers", NONE),
}
OTHERS = {
    "kalibr": KALIBR,
    "opencv": OPENCV,
    "ros": ROS,
    "colmap": "1 PINHOLE 640 480 500 500 320 240\n",
    "kitti": KITTI,
    "zed": files.zed("HD"),
    "oak": files.OAK,
    "woodscape": json.dumps(lens_files.WOODSCAPE),
    "aria": json.dumps(lens_files.ARIA),
    "realsense": lens_files.REALSENSE,
}


def test_the_registry_is_whole() -> None:
    names = [one.name for one in FORMATS]
    assert len(set(names)) == len(names)
    assert set(READERS) == set(names)
    assert {one.value for one in CameraFileFormat} == {"auto", *names}
    read = {kind for _, kind, _ in ONE_CAMERA.values()} | set(OTHERS)
    assert read == set(names), "each is tested below"
    for one in FORMATS:
        assert one.noun.split()[0] in ("a", "an", "the", "metadata")
        assert one.description.endswith(".")
        assert "\n" not in one.description
        assert one.written_by
        assert one.example


@pytest.mark.parametrize("name", ["vins", "euroc", "stella_vslam", "zed", "colmap", "kitti", "ros"])
def test_examples_of_the_registry_are_recognised(name: str) -> None:
    example = next(one.example for one in FORMATS if one.name == name)
    more = "\n  fx: 1\n" if name == "stella_vslam" else "\n"
    assert recognise_camera_file(example + more) == name


@pytest.mark.parametrize("name", OTHERS)
def test_every_file_is_recognised_by_its_content(name: str) -> None:
    assert recognise_camera_file(OTHERS[name]) == name


@pytest.mark.parametrize("name", ONE_CAMERA)
def test_one_camera(tmp_path: Path, name: str) -> None:
    text, kind, lens = ONE_CAMERA[name]
    assert recognise_camera_file(text) == kind
    path = written(tmp_path, text, "a")
    settings = read_camera_file(path)
    camera = settings.camera
    assert settings.sensor is Sensor.MONOCULAR
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == (FX, FY, CX, CY)
    assert (camera.k1, camera.k2, camera.p1, camera.p2, camera.k3) == lens
    assert (camera.width, camera.height) == SIZE
    assert read_camera_file(path, kind) == settings
    settings.save(tmp_path / "my.yaml")
    assert Settings.load(tmp_path / "my.yaml", "mono") == settings


def test_what_else_is_known_counts(tmp_path: Path) -> None:
    for text, fps in ((files.STELLA, 20), (files.EUROC, 20), (files.RECORD3D, 60)):
        path = written(tmp_path, text)
        assert read_camera_file(path).camera.fps == fps
        assert read_camera_file(path, fps=12).camera.fps == 12
    assert read_camera_file(written(tmp_path, files.STELLA)).camera.rgb
    path = written(tmp_path, files.REPLICA)
    assert read_camera_file(path, sensor="rgbd").depth_factor == 6553.5
    assert read_camera_file(path, sensor="rgbd", depth_factor=1000).depth_factor == 1000


def test_only_the_first_message_counts(tmp_path: Path) -> None:
    """The last one that rostopic echo prints may be cut off."""
    path = written(tmp_path, f"{files.ROS1}{files.ROS1[:200]}")
    assert read_camera_file(path).camera.fx == FX


def test_region_of_interest_and_binning(tmp_path: Path) -> None:
    text = files.ROS1.replace("binning_x: 0", "binning_x: 2").replace(
        "binning_y: 0", "binning_y: 2"
    )
    text = text.replace("x_offset: 0", "x_offset: 100").replace("y_offset: 0", "y_offset: 40")
    text = text.replace("  height: 0\n  width: 0", "  height: 400\n  width: 500")
    camera = read_camera_file(written(tmp_path, text)).camera
    assert (camera.width, camera.height) == (250, 200)
    # Columns 100 and 101 become column 0, whose centre is 0.
    assert (camera.fx, camera.fy) == (FX / 2, FY / 2)
    assert camera.cx == pytest.approx((CX - 100 - 0.5) / 2)
    assert camera.cy == pytest.approx((CY - 40 - 0.5) / 2)


def test_a_matrix_column_by_column(tmp_path: Path) -> None:
    for numbers in (files.ROWS, files.COLUMNS, [FX, FY, CX, CY]):
        camera = read_camera_file(written(tmp_path, f'{{"intrinsics": {numbers}}}')).camera
        assert (camera.fx, camera.fy, camera.cx, camera.cy) == (FX, FY, CX, CY)


def test_an_angle_of_view(tmp_path: Path) -> None:
    text = '{"camera_angle_x": 1.5707963267948966, "w": 640, "h": 480, "frames": [{}]}'
    camera = read_camera_file(written(tmp_path, text)).camera
    assert (camera.fx, camera.fy) == pytest.approx((320, 320))
    assert (camera.cx, camera.cy) == (319.5, 239.5)


# ---- rational distortion -------------------------------------------------------------------------
LINE = f"1 FULL_OPENCV 640 480 {FX} {FY} {CX + 0.5} {CY + 0.5} {' '.join(map(str, RATIONAL))}\n"
PINHOLE_FULL = files.VINS.replace("PINHOLE", "PINHOLE_FULL").replace(
    "projection_parameters",
    "   k3: 1.2\n   k4: 0.4\n   k5: -1.9\n   k6: 1.1\nprojection_parameters",
)


@pytest.mark.parametrize(
    ("text", "options"),
    [
        (files.ROS1.replace(str(list(D)), str(list(RATIONAL))), {}),
        (files.ROS1.replace(str(list(D)), str([*RATIONAL, 0, 0, 0, 0])), {}),
        (files.OST.replace(" ".join(map(str, D)), " ".join(map(str, RATIONAL))), {}),
        (LINE, {}),
        (files.OAK, {"camera": 0}),
        (files.BASALT_PAIR, {"camera": 1}),
        (files.matrix("K", files.ROWS) + files.matrix("D", RATIONAL, 8), {}),
    ],
)
@pytest.mark.parametrize("sensor", ["mono", "rgbd"])
def test_eight_coefficients(
    tmp_path: Path, text: str, options: dict[str, Any], sensor: str
) -> None:
    settings = read_camera_file(written(tmp_path, text), sensor=sensor, **options)
    np.testing.assert_array_equal(settings.camera.distortion, RATIONAL)
    settings.save(tmp_path / "my.yaml")
    assert Settings.load(tmp_path / "my.yaml", sensor) == settings


def test_eight_coefficients_by_their_names(tmp_path: Path) -> None:
    camera = read_camera_file(written(tmp_path, PINHOLE_FULL)).camera
    np.testing.assert_array_equal(camera.distortion, (*D[:4], 1.2, 0.4, -1.9, 1.1))


def test_eight_of_which_three_are_zero_are_five(tmp_path: Path) -> None:
    text = files.ROS1.replace(str(list(D)), str([*D, 0, 0, 0]))
    np.testing.assert_array_equal(read_camera_file(written(tmp_path, text)).camera.distortion, D)


# ---- spoilt files ------------------------------------------------------------------------------
WHOLE = [text for text, _, _ in ONE_CAMERA.values()] + [*OTHERS.values(), files.BASALT_PAIR]
WHOLE += [files.OPENCV_PAIR, files.OST_PAIR, files.zed("HD", "VGA"), files.kalibr_pair(5)]


@pytest.mark.parametrize("number", range(len(WHOLE)))
def test_spoilt_files_are_read_or_refused(tmp_path: Path, number: int) -> None:
    """A file that was cut off or edited gets a message, never an error of Python's own."""
    text, rng = WHOLE[number], random.Random(number)
    numbers = list(re.finditer(r"-?\d+\.?\d*", text))
    words = ("x", "", "nan", "-1", "0", "1e400", "9" * 400, "[", "{}", "null", "[1, 2]", '"a"')
    spoilt = [text[: rng.randrange(len(text))] for _ in range(5)]
    for word in words:
        match = rng.choice(numbers)
        spoilt.append(text[: match.start()] + word + text[match.end() :])
    for one in spoilt:
        path = written(tmp_path, one)
        try:
            camera = read_camera_file(path).camera
        except SettingsError as error:
            assert str(path) in str(error)
        else:
            assert np.isfinite([camera.fx, camera.fy, camera.cx, camera.cy]).all()


# ---- size ----------------------------------------------------------------------------------------
def test_size_that_the_file_does_not_tell(tmp_path: Path) -> None:
    path = written(tmp_path, files.matrix("K", files.ROWS))
    assert read_camera_file(path).camera.width is None
    camera = read_camera_file(path, size=(640, 480)).camera
    assert (camera.width, camera.height) == (640, 480)
    for wrong in ((0, 480), (640,), (640.5, 480), "640x480"):
        with pytest.raises(SettingsError, match=r"size is .*; give width and height"):
            read_camera_file(path, size=wrong)  # type: ignore[arg-type]


def test_size_of_another_camera(tmp_path: Path) -> None:
    path = written(tmp_path, files.EUROC)
    assert read_camera_file(path, size=(640, 480)) == read_camera_file(path)
    with pytest.raises(SettingsError, match=r"is for images of 640 x 480 .* leave --size out"):
        read_camera_file(path, size=(320, 240))


def test_resolution_of_a_zed(tmp_path: Path) -> None:
    path = written(tmp_path, files.zed("HD", "VGA"))
    with pytest.raises(SettingsError, match=r"1280x720 \(HD\), 672x376 \(VGA\); choose .*1280x720"):
        read_camera_file(path)
    with pytest.raises(SettingsError, match=r"no calibration for images of 640x480; give --size"):
        read_camera_file(path, size=(640, 480))
    settings = read_camera_file(path, size=(672, 376), camera=1)
    assert (settings.camera.fx, settings.camera.width) == (FX, 672)
    assert read_camera_file(written(tmp_path, files.zed("VGA"))).camera.width == 672

# SPDX-License-Identifier: BSD-3-Clause
"""EuRoC sequences: small made-up folders, good and bad."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from orbslam2py import DatasetError, ImageError, Sensor, SettingsError
from orbslam2py.datasets import EurocSequence, Layout, Sequence, open_sequence
from orbslam2py.settings import builtin_settings
from support.small_folders import SIZE, STAMPS, image, save


def test_euroc_stereo(euroc: Path) -> None:
    sequence: Sequence = open_sequence(euroc)
    assert sequence.layout is Layout.EUROC
    assert sequence.sensor is Sensor.STEREO
    assert sequence.name == "V9_01"
    assert len(sequence) == 3
    assert sequence.timestamp_text(0) == "1403715273.262142976"
    assert sequence.timestamps[0] == pytest.approx(1403715273.262142976, abs=2.4e-7)
    settings = sequence.settings
    assert settings.baseline == pytest.approx(0.1, rel=1e-6)
    assert settings.camera.fps == 20
    assert settings.orb.n_features == 1200
    assert not settings.camera.is_distorted
    images = sequence.load(0)
    assert images.right is not None
    assert images.image.shape == images.right.shape == SIZE
    assert not np.array_equal(images.image, image(0))


def test_euroc_rectification_puts_points_on_the_same_row(euroc: Path) -> None:
    """A point in front of both cameras, drawn into raw images, ends up on one row."""
    sequence = EurocSequence(euroc, Sensor.STEREO)
    settings = sequence.settings
    assert settings.rectification is not None
    point = np.array([0.1, 0.15, 0.8])
    rows, columns = [], []
    for number, camera in enumerate((settings.rectification.left, settings.rectification.right)):
        moved = point - [0.1 * number, 0, 0]
        raw, _ = cv2.projectPoints(moved[None], np.zeros(3), np.zeros(3), camera.K, camera.D)
        x, y = raw.ravel()
        grid_x, grid_y = np.meshgrid(np.arange(64), np.arange(48))
        blob = 255 * np.exp(-((grid_x - x) ** 2 + (grid_y - y) ** 2) / 8)
        save(euroc / "mav0" / f"cam{number}" / "data" / f"{STAMPS[0]}.png", blob.astype(np.uint8))
    images = sequence.load(0)
    for pixels in (images.image, images.right):
        weights = pixels.astype(float)
        rows.append((weights.sum(axis=1) * np.arange(48)).sum() / weights.sum())
        columns.append((weights.sum(axis=0) * np.arange(64)).sum() / weights.sum())
    assert rows[0] == pytest.approx(rows[1], abs=0.1)
    assert columns[0] - columns[1] == pytest.approx(settings.camera.bf / 0.8, abs=0.2)


def test_euroc_folder_may_be_mav0_or_lack_it(euroc: Path, tmp_path: Path) -> None:
    inner = open_sequence(euroc / "mav0")
    assert (inner.name, len(inner)) == ("V9_01", 3)
    bare = (euroc / "mav0").rename(tmp_path / "bare")
    assert (open_sequence(bare).name, len(open_sequence(bare))) == ("bare", 3)


def test_euroc_mono_is_raw(euroc: Path) -> None:
    sequence = open_sequence(euroc, Sensor.MONOCULAR)
    np.testing.assert_array_equal(sequence.load(1).image, image(1))
    camera = sequence.settings.camera
    assert (camera.fx, camera.fy, camera.k1, camera.k2) == (40.0, 41.0, -0.1, 0.01)
    assert sequence.settings.orb.n_features == 1000


def test_euroc_keeps_what_both_cameras_saw(euroc: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = euroc / "mav0" / "cam1" / "data.csv"
    path.write_text(path.read_text().replace(f"{STAMPS[1]},{STAMPS[1]}.png\n", ""))
    sequence = open_sequence(euroc)
    assert [sequence.timestamp_text(k)[-9:] for k in range(2)] == ["262142976", "362142976"]
    assert "1 images have no partner" in caplog.text
    path.write_text("#nothing\n")
    with pytest.raises(DatasetError, match=r"were taken within .* of each other"):
        open_sequence(euroc)


def test_euroc_names_come_from_the_list(euroc: Path) -> None:
    camera = euroc / "mav0" / "cam0"
    save(camera / "data" / "first.jpg", image(3))
    (camera / "data" / f"{STAMPS[1]}.png").unlink()
    save(camera / "data" / f"{STAMPS[1]}.jpg", image(4))
    (camera / "data.csv").write_text(f"{STAMPS[0]}, first.jpg\n{STAMPS[1]}\n")
    sequence = open_sequence(euroc, Sensor.MONOCULAR)
    assert sequence.load(0).image.shape == SIZE
    assert sequence.load(1).image.shape == SIZE


def test_euroc_without_lists(euroc: Path) -> None:
    for name in ("cam0", "cam1"):
        (euroc / "mav0" / name / "data.csv").unlink()
    sequence = open_sequence(euroc)
    assert len(sequence) == 3
    assert sequence.timestamp_text(2) == "1403715273.362142976"


def test_euroc_bad_list(euroc: Path) -> None:
    path = euroc / "mav0" / "cam0" / "data.csv"
    path.write_text("#t\n12.5,a.png\n")
    with pytest.raises(DatasetError, match=r"data\.csv:2: '12\.5' is not a time stamp in ns"):
        open_sequence(euroc)
    path.write_text("#t\n")
    with pytest.raises(DatasetError, match="no images"):
        open_sequence(euroc, Sensor.MONOCULAR)


def test_euroc_stamp_twice_or_backwards(euroc: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = euroc / "mav0" / "cam0" / "data.csv"
    path.write_text("".join(f"{STAMPS[k]},{STAMPS[k]}.png\n" for k in (1, 1, 0)))
    assert len(open_sequence(euroc, Sensor.MONOCULAR)) == 2
    assert "data.csv:2: time stamp 1403715273312143104 is there twice" in caplog.text
    assert "are not in the order of time; they are sorted" in caplog.text


def test_a_fisheye_of_tum_vi(euroc: Path) -> None:
    """One camera is read with its lens, and so is the pair, which is rectified: it sees little."""
    for camera in ("cam0", "cam1"):
        path = euroc / "mav0" / camera / "sensor.yaml"
        path.write_text(path.read_text().replace("radial-tangential", "equidistant"))
    camera = open_sequence(euroc, Sensor.MONOCULAR).settings.camera
    text = (euroc / "mav0" / "cam0" / "sensor.yaml").read_text()
    numbers = text.partition("distortion_coefficients: [")[2].partition("]")[0]
    assert camera.model == "kannala_brandt"
    assert camera.lens == tuple(map(float, numbers.split(",")))
    assert (camera.fx, camera.is_distorted) == (40.0, False)
    pair = open_sequence(euroc, Sensor.STEREO).settings
    assert pair.rectification is not None
    assert pair.rectification.applied
    assert pair.rectification.left.model == "kannala_brandt"
    assert tuple(pair.rectification.left.D) == camera.lens


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("camera_model: pinhole", "camera_model: omni", "allowed: pinhole"),
        ("radial-tangential", "cubic", "allowed: radial-tangential or equidistant"),
        ("intrinsics: [40.0,", "intrinsics: [", "intrinsics must hold 4 numbers"),
        ("intrinsics: [40.0,", "intrinsics: [x,", "intrinsics: 'x' is not a number"),
        ("intrinsics: [40.0,", "intrinsics: [-40.0,", "intrinsics has the focal lengths -40, 41"),
        ("resolution: [64, 48]\n", "", "has no resolution"),
        ("cols: 4", "cols: 3", "T_BS should hold 4 x 3 = 12 numbers, found 16"),
        ("0.0, 0.0, 1.0, 0.03", "0.0, 0.0, 2.0, 0.03", "T_BS is no 4 x 4 rigid transform"),
        ("T_BS:\n", "T_BS\n", "sensor.yaml:5: expected 'key: value'"),
    ],
)
def test_euroc_bad_calibration(euroc: Path, old: str, new: str, expected: str) -> None:
    path = euroc / "mav0" / "cam0" / "sensor.yaml"
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new, 1))
    sequence = open_sequence(euroc, Sensor.MONOCULAR)
    with pytest.raises(DatasetError) as caught:
        _ = sequence.settings
    assert expected in str(caught.value)
    assert str(path) in str(caught.value)


def test_euroc_stereo_needs_a_rectification(euroc: Path, tmp_path: Path) -> None:
    (euroc / "mav0" / "cam1" / "sensor.yaml").unlink()
    with pytest.raises(DatasetError, match="no settings for"):
        _ = open_sequence(euroc).settings
    text = builtin_settings("euroc", Sensor.STEREO).to_yaml().partition("\n# Rectification")[0]
    (tmp_path / "plain.yaml").write_text(text)
    with pytest.raises(SettingsError, match="parameters to rectify stereo are missing"):
        open_sequence(euroc, settings=tmp_path / "plain.yaml")


def test_euroc_rectification_of_the_settings_is_used(euroc: Path) -> None:
    sequence = open_sequence(euroc, settings="euroc")
    with pytest.raises(ImageError, match=r"is 64 x 48, but the rectification is for 752 x 480"):
        sequence.load(0)


def test_euroc_ground_truth_is_moved_to_the_camera(euroc: Path) -> None:
    assert open_sequence(euroc).ground_truth() is None
    folder = euroc / "mav0" / "state_groundtruth_estimate0"
    folder.mkdir()
    # The body is turned by 90 degrees about z: its x axis points along the world's y axis.
    half = np.sqrt(0.5)
    (folder / "data.csv").write_text(f"#t\n{STAMPS[0]},1,2,3,{half},0,0,{half}\n")
    truth = open_sequence(euroc, Sensor.MONOCULAR).ground_truth()
    assert truth is not None
    np.testing.assert_allclose(truth.positions[0], [1 - 0.02, 2 + 0.01, 3.03], atol=1e-12)
    np.testing.assert_allclose(truth.T_wc[0, :3, :3], np.diag([-1, -1, 1]), atol=1e-12)

    # A right camera nodding by 0.1 rad about its x axis: the rectification nods the left by half.
    path = euroc / "mav0" / "cam1" / "sensor.yaml"
    c, s = np.cos(0.1), np.sin(0.1)
    text = path.read_text().replace("[0.0, -1.0, 0.0,", f"[0.0, {-c}, {s},")
    path.write_text(text.replace("0.0, 0.0, 1.0, 0.03", f"0.0, {s}, {c}, 0.03"))
    sequence = open_sequence(euroc, Sensor.STEREO)
    assert sequence.settings.rectification is not None
    R = sequence.settings.rectification.left.R
    assert np.abs(R - np.eye(3)).max() > 0.03
    rectified = sequence.ground_truth()
    assert rectified is not None
    np.testing.assert_allclose(rectified.T_wc[0, :3, :3] @ R, np.diag([-1, -1, 1]), atol=1e-12)

    (euroc / "mav0" / "cam0" / "sensor.yaml").unlink()
    assert open_sequence(euroc, Sensor.MONOCULAR).ground_truth() is None


def test_euroc_ground_truth_with_velocities_and_biases(euroc: Path) -> None:
    folder = euroc / "mav0" / "state_groundtruth_estimate0"
    folder.mkdir()
    row = [str(STAMPS[0]), *"123", "1", *"000", *["0.5"] * 9]
    (folder / "data.csv").write_text(",".join(row) + "\n")
    truth = open_sequence(euroc, Sensor.MONOCULAR).ground_truth()
    assert truth is not None
    np.testing.assert_allclose(truth.positions[0], [1.01, 2.02, 3.03])
    (folder / "data.csv").write_text(",".join(row[:7]) + "\n")
    with pytest.raises(DatasetError, match=r"data\.csv:1: expected 8 numbers, found 7"):
        open_sequence(euroc, Sensor.MONOCULAR).ground_truth()


def without_T_BS(euroc: Path, camera: str) -> Path:
    path = euroc / "mav0" / camera / "sensor.yaml"
    text = path.read_text()
    begin, end = text.index("T_BS"), text.index("rate_hz")
    path.write_text(text[:begin] + text[end:])
    return path


def test_a_single_camera_needs_no_place_on_the_vehicle(
    euroc: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with_it = open_sequence(euroc, "mono").settings
    path = without_T_BS(euroc, "cam0")
    sequence = open_sequence(euroc, "mono")
    assert sequence.settings == with_it
    folder = euroc / "mav0" / "state_groundtruth_estimate0"
    folder.mkdir()
    (folder / "data.csv").write_text(f"#t\n{STAMPS[0]},1,2,3,1,0,0,0\n")
    assert sequence.ground_truth() is None
    assert f"data.csv is not used: {path} has no T_BS" in caplog.text


@pytest.mark.parametrize("camera", ["cam0", "cam1"])
def test_stereo_needs_the_places_on_the_vehicle(euroc: Path, camera: str) -> None:
    path = without_T_BS(euroc, camera)
    with pytest.raises(DatasetError) as caught:
        _ = open_sequence(euroc, "stereo").settings
    assert str(caught.value).startswith(f"{path} has no T_BS")
    assert "--sensor mono" in str(caught.value)

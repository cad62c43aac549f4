# SPDX-License-Identifier: BSD-3-Clause
"""Sequences on disk: small made-up folders, good and bad."""

from __future__ import annotations

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from orbslam2py.datasets import (
    EurocSequence,
    KittiSequence,
    Layout,
    Sequence,
    TumSequence,
    open_sequence,
    recognise,
)
from orbslam2py.errors import DatasetError, ImageError, SettingsError
from orbslam2py.settings.builtin import builtin_settings
from orbslam2py.settings.sensor import Sensor

SIZE = (48, 64)  # rows, columns


def image(seed: int, shape: tuple[int, ...] = SIZE, dtype: type = np.uint8) -> np.ndarray:
    generator = np.random.default_rng(seed)
    return generator.integers(0, np.iinfo(dtype).max, shape, dtype=dtype)


def save(path: Path, pixels: np.ndarray) -> np.ndarray:
    path.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(path), pixels)
    return pixels


# ---- TUM -----------------------------------------------------------------------------------------


@pytest.fixture
def tum(tmp_path: Path) -> Path:
    """Four colour images; depth is late by 5 ms and missing for the third."""
    folder = tmp_path / "rgbd_dataset_freiburg2_made_up"
    colour, depth = ["# colour", "# made up", "# timestamp filename"], ["# depth"]
    for k in range(4):
        stamp = f"100.{k}00000"
        save(folder / "rgb" / f"{stamp}.png", image(k, (*SIZE, 3)))
        colour.append(f"{stamp} rgb/{stamp}.png")
        if k != 2:
            late = f"100.{k}05000"
            save(folder / "depth" / f"{late}.png", image(10 + k, dtype=np.uint16))
            depth.append(f"{late} depth/{late}.png")
    (folder / "rgb.txt").write_text("\n".join(colour) + "\n")
    (folder / "depth.txt").write_text("\n".join(depth) + "\n")
    return folder


def test_tum_rgbd_without_association(tum: Path) -> None:
    sequence: Sequence = open_sequence(tum)
    assert sequence.layout == "tum"
    assert sequence.sensor is Sensor.RGBD
    assert sequence.name == "rgbd_dataset_freiburg2_made_up"
    assert len(sequence) == 3
    np.testing.assert_allclose(sequence.timestamps, [100.0, 100.1, 100.3])
    assert sequence.timestamp_text(2) == "100.300000"
    images = sequence.load(2)
    assert images.right is None
    assert images.depth is not None
    assert images.depth.dtype == np.uint16
    np.testing.assert_array_equal(images.depth, image(13, dtype=np.uint16))
    assert sequence.settings == builtin_settings("tum2", Sensor.RGBD)


def test_tum_mono_uses_every_colour_image(tum: Path) -> None:
    sequence = open_sequence(tum, Sensor.MONOCULAR)
    assert len(sequence) == 4
    assert sequence.load(2).depth is None


def test_colour_order_is_the_one_of_the_settings(tum: Path, tmp_path: Path) -> None:
    np.testing.assert_array_equal(
        open_sequence(tum).load(0).image, image(0, (*SIZE, 3))[:, :, ::-1]
    )
    settings = builtin_settings("tum1", Sensor.RGBD).to_yaml().replace("RGB: 1", "RGB: 0")
    (tmp_path / "bgr.yaml").write_text(settings)
    sequence = open_sequence(tum, settings=tmp_path / "bgr.yaml")
    np.testing.assert_array_equal(sequence.load(0).image, image(0, (*SIZE, 3)))


def test_alpha_stays_in_its_place(tum: Path) -> None:
    pixels = save(tum / "rgb" / "100.000000.png", image(0, (*SIZE, 4)))
    loaded = open_sequence(tum).load(0).image
    np.testing.assert_array_equal(loaded, pixels[:, :, [2, 1, 0, 3]])


@pytest.mark.parametrize("name", ["associations.txt", "association.txt", "associate.txt"])
def test_tum_association_in_the_folder(tum: Path, name: str) -> None:
    (tum / name).write_text("100.1 rgb/100.100000.png 100.0 depth/100.005000.png\r\n\r\n")
    sequence = open_sequence(tum)
    assert len(sequence) == 1
    assert sequence.timestamp_text(0) == "100.1"
    np.testing.assert_array_equal(sequence.load(0).depth, image(10, dtype=np.uint16))


def test_tum_association_given(tum: Path, tmp_path: Path) -> None:
    path = tmp_path / "other.txt"
    path.write_text("100.3 rgb/100.300000.png 100.3 depth/100.305000.png\n")
    assert len(open_sequence(tum, association=path)) == 1
    with pytest.raises(DatasetError, match=r"cannot open .*nowhere\.txt"):
        open_sequence(tum, association=tmp_path / "nowhere.txt")


def test_tum_with_only_an_association(tum: Path) -> None:
    (tum / "associations.txt").write_text("100.3 rgb/100.300000.png 1 depth/100.305000.png\n")
    (tum / "rgb.txt").unlink()
    (tum / "depth.txt").unlink()
    assert len(open_sequence(tum)) == 1
    assert len(open_sequence(tum, Sensor.MONOCULAR)) == 1


def test_comments_anywhere_in_a_list(tum: Path) -> None:
    text = (tum / "rgb.txt").read_text()
    (tum / "rgb.txt").write_text(text.replace("100.2", "# pause\n\n   # more\n100.2", 1))
    assert len(open_sequence(tum, Sensor.MONOCULAR)) == 4


@pytest.mark.parametrize(
    ("name", "line", "expected"),
    [
        ("rgb.txt", "100.4", "rgb.txt:8: expected 'timestamp path', found 1 fields"),
        ("rgb.txt", "abc rgb/100.300000.png", "rgb.txt:8: 'abc' is not a number"),
        ("depth.txt", "nan depth/100.305000.png", "depth.txt:5: nan is not finite"),
        ("associations.txt", "100.3 rgb/100.300000.png", "associations.txt:1: expected 't_rgb"),
        ("associations.txt", "1 a.png x b.png", "associations.txt:1: 'x' is not a number"),
    ],
)
def test_malformed_line(tum: Path, name: str, line: str, expected: str) -> None:
    with (tum / name).open("a") as stream:
        stream.write(line + "\n")
    with pytest.raises(DatasetError) as caught:
        open_sequence(tum)
    assert expected in str(caught.value)


def test_time_that_goes_back_is_a_warning(tum: Path, caplog: pytest.LogCaptureFixture) -> None:
    with (tum / "rgb.txt").open("a") as stream:
        stream.write("100.300000 rgb/100.300000.png\n")
    sequence = open_sequence(tum, Sensor.MONOCULAR)
    assert len(sequence) == 5
    assert "rgb.txt:8: time stamp 100.300000 is not after" in caplog.text


def test_list_without_images(tum: Path) -> None:
    (tum / "rgb.txt").write_text("# nothing\n")
    for sensor in (Sensor.MONOCULAR, Sensor.RGBD):
        with pytest.raises(DatasetError, match="no images"):
            open_sequence(tum, sensor)


def test_colour_and_depth_far_apart(tum: Path) -> None:
    (tum / "depth.txt").write_text("200.0 depth/100.005000.png\n")
    with pytest.raises(DatasetError, match=r"lie within 0\.02 s"):
        open_sequence(tum)


def test_colour_without_partner_is_told(tum: Path, caplog: pytest.LogCaptureFixture) -> None:
    open_sequence(tum)
    assert "1 colour images have no depth image" in caplog.text


def test_missing_list_file(tum: Path) -> None:
    (tum / "rgb.txt").unlink()
    with pytest.raises(DatasetError, match=r"cannot open .*rgb\.txt"):
        TumSequence(tum, Sensor.RGBD)


def test_sensor_without_images(tum: Path) -> None:
    with pytest.raises(DatasetError, match="no stereo images; it can be used as: rgbd, mono"):
        open_sequence(tum, Sensor.STEREO)
    (tum / "depth.txt").unlink()
    with pytest.raises(DatasetError, match="no rgbd images; it can be used as: mono"):
        open_sequence(tum, Sensor.RGBD)


# ---- images --------------------------------------------------------------------------------------


def test_missing_image(tum: Path) -> None:
    (tum / "depth" / "100.105000.png").unlink()
    sequence = open_sequence(tum)
    sequence.load(0)
    with pytest.raises(DatasetError, match=r"100\.105000\.png is listed but missing"):
        sequence.load(1)


@pytest.mark.parametrize("kind", ["rgb/100.100000.png", "depth/100.105000.png"])
@pytest.mark.parametrize("fraction", [0.0, 0.01, 0.5, 0.99])
def test_truncated_image(tum: Path, kind: str, fraction: float) -> None:
    path = tum / kind
    content = path.read_bytes()
    path.write_bytes(content[: int(len(content) * fraction)])
    with pytest.raises(ImageError, match=path.name):
        open_sequence(tum).load(1)


@pytest.mark.parametrize("fraction", [0.3, 0.99])
def test_truncated_jpeg(tum: Path, fraction: float) -> None:
    save(tum / "rgb" / "a.jpg", image(0, (*SIZE, 3)))
    content = (tum / "rgb" / "a.jpg").read_bytes()
    (tum / "rgb.txt").write_text("1.0 rgb/a.jpg\n")
    sequence = open_sequence(tum, Sensor.MONOCULAR)
    assert sequence.load(0).image.shape == (*SIZE, 3)
    (tum / "rgb" / "a.jpg").write_bytes(content[: int(len(content) * fraction)])
    with pytest.raises(ImageError, match=r"a\.jpg"):
        sequence.load(0)


@pytest.mark.parametrize("suffix", [".png", ".jpg"])
def test_truncated_image_that_the_decoder_completes(
    tum: Path, suffix: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Older versions of OpenCV fill the rest with grey."""
    path = tum / "rgb" / f"a{suffix}"
    save(path, image(0, (*SIZE, 3)))
    (tum / "rgb.txt").write_text(f"1.0 rgb/{path.name}\n")
    monkeypatch.setattr(cv2, "imdecode", lambda *_: image(0, (*SIZE, 3)))
    sequence = open_sequence(tum, Sensor.MONOCULAR)
    assert sequence.load(0).image.shape == (*SIZE, 3)
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(ImageError, match="is truncated"):
        sequence.load(0)


def test_file_that_is_no_image(tum: Path) -> None:
    (tum / "rgb" / "100.100000.png").write_text("no image at all")
    with pytest.raises(ImageError, match=r"100\.100000\.png is no readable image"):
        open_sequence(tum).load(1)


def test_folder_in_place_of_an_image(tum: Path) -> None:
    (tum / "rgb" / "100.100000.png").unlink()
    (tum / "rgb" / "100.100000.png").mkdir()
    with pytest.raises(ImageError, match="cannot read image"):
        open_sequence(tum).load(1)


def test_wrong_kinds_of_pixels(tum: Path) -> None:
    save(tum / "rgb" / "100.100000.png", image(0, dtype=np.uint16))
    save(tum / "depth" / "100.005000.png", image(0, (*SIZE, 3)))
    sequence = open_sequence(tum)
    with pytest.raises(ImageError, match="8 bits per channel"):
        sequence.load(1)
    with pytest.raises(ImageError, match="has 3 channels; depth images have one"):
        sequence.load(0)


# ---- choice of settings --------------------------------------------------------------------------


def test_settings_file_in_the_folder_wins(tum: Path) -> None:
    builtin_settings("tum3", Sensor.RGBD).save(tum / "settings.yaml")
    assert open_sequence(tum).settings == builtin_settings("tum3", Sensor.RGBD)
    chosen = open_sequence(tum, settings="tum1")
    assert chosen.settings == builtin_settings("tum1", Sensor.RGBD)
    assert chosen.default_settings() == builtin_settings("tum3", Sensor.RGBD)


def test_bad_settings_file_in_the_folder(tum: Path) -> None:
    (tum / "settings.yaml").write_text("Camera.fx: x\n")
    with pytest.raises(SettingsError, match="'x' is not a number"):
        _ = open_sequence(tum).settings


def test_bad_choice_of_settings_is_told_at_once(tum: Path) -> None:
    with pytest.raises(SettingsError, match="no built-in settings"):
        open_sequence(tum, settings="tum9")


def test_nothing_tells_the_settings(tum: Path) -> None:
    other = tum.rename(tum.with_name("kitchen"))
    sequence = open_sequence(other)
    with pytest.raises(DatasetError, match=r"no settings for .*tum1, tum2.*settings\.yaml"):
        _ = sequence.settings


# ---- KITTI ---------------------------------------------------------------------------------------

P0 = "P0: 700 0 600 0 0 700 180 0 0 0 1 0"
P1 = "P1: 700 0 600 -350 0 700 180 0 0 0 1 0"


@pytest.fixture
def kitti(tmp_path: Path) -> Path:
    folder = tmp_path / "dataset" / "sequences" / "07"
    for k in range(3):
        save(folder / "image_0" / f"{k:06d}.png", image(k))
        save(folder / "image_1" / f"{k:06d}.png", image(10 + k))
    (folder / "times.txt").write_text("0.000000e+00\n1.036224e-01\n2.072343e-01\n")
    (folder / "calib.txt").write_text(f"{P0}\n{P1}\n")
    return folder


def poses_text(n: int) -> str:
    return "".join(f"1 0 0 {k} 0 1 0 0 0 0 1 {2 * k}\n" for k in range(n))


def test_kitti_stereo(kitti: Path) -> None:
    sequence: Sequence = open_sequence(kitti)
    assert sequence.layout is Layout.KITTI
    assert sequence.sensor is Sensor.STEREO
    assert len(sequence) == 3
    assert sequence.timestamp_text(1) == "1.036224e-01"
    images = sequence.load(2)
    np.testing.assert_array_equal(images.image, image(2))
    np.testing.assert_array_equal(images.right, image(12))
    settings = sequence.settings
    camera = settings.camera
    assert (camera.fx, camera.cx, camera.cy, camera.bf) == (700, 600, 180, 350)
    assert camera.fps == pytest.approx(9.651, abs=1e-3)
    assert settings.close_depth == 20.0
    assert (settings.orb.n_features, settings.orb.ini_th_fast, settings.orb.min_th_fast) == (
        2000,
        20,
        7,
    )


def test_kitti_left_camera_only(kitti: Path) -> None:
    shutil.rmtree(kitti / "image_1")
    (kitti / "calib.txt").write_text(P0 + "\nTr: 1 0 0 0 0 1 0 0 0 0 1 0\n")
    sequence = open_sequence(kitti)
    assert sequence.sensor is Sensor.MONOCULAR
    assert sequence.load(0).right is None
    assert sequence.settings.camera.bf == 0.0
    with pytest.raises(DatasetError, match="no stereo images"):
        open_sequence(kitti, Sensor.STEREO)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (P1, "no line 'P0:'"),
        (P0, "no line 'P1:'"),
        (f"{P0} 5\n{P1}", "calib.txt:1: P0 has 13 numbers instead of 12"),
        (f"{P0}\n{P1}".replace("-350", "x"), "calib.txt:2: 'x' is not a number"),
        (f"{P0}\n{P1}".replace("-350", "0"), "calib.txt: Camera.bf"),
        (f"{P0}\n{P1}".replace("700", "0"), "calib.txt: Camera.fx"),
    ],
)
def test_kitti_bad_calibration(kitti: Path, text: str, expected: str) -> None:
    (kitti / "calib.txt").write_text(text + "\n")
    with pytest.raises(DatasetError) as caught:
        _ = open_sequence(kitti).settings
    assert expected in str(caught.value)


def test_kitti_without_calibration(kitti: Path) -> None:
    (kitti / "calib.txt").unlink()
    with pytest.raises(DatasetError, match="kitti04-12"):
        _ = open_sequence(kitti).settings
    sequence = open_sequence(kitti, settings="kitti07")
    assert sequence.settings == builtin_settings("kitti04-12", Sensor.STEREO)
    assert len(sequence.load(0).image) == SIZE[0]


def test_kitti_missing_right_image(kitti: Path) -> None:
    (kitti / "image_1" / "000001.png").unlink()
    sequence = open_sequence(kitti)
    with pytest.raises(DatasetError, match=r"image_1/000001\.png"):
        sequence.load(1)
    assert sequence.load(2).right is not None


def test_kitti_index_out_of_range(kitti: Path) -> None:
    for index in (-1, 3):
        with pytest.raises(IndexError):
            open_sequence(kitti).load(index)


@pytest.mark.parametrize(
    ("text", "expected"), [("0\nx\n", "times.txt:2: 'x'"), ("0 1\n", "times.txt:1: expected one")]
)
def test_kitti_bad_times(kitti: Path, text: str, expected: str) -> None:
    (kitti / "times.txt").write_text(text)
    with pytest.raises(DatasetError) as caught:
        open_sequence(kitti)
    assert expected in str(caught.value)


@pytest.mark.parametrize("place", ["poses.txt", "07.txt", "../../poses/07.txt", "03.txt"])
def test_kitti_ground_truth_is_found(kitti: Path, place: str) -> None:
    assert open_sequence(kitti).ground_truth() is None
    (kitti / place).parent.mkdir(exist_ok=True)
    (kitti / place).write_text(poses_text(3))
    truth = open_sequence(kitti).ground_truth()
    assert truth is not None
    np.testing.assert_allclose(truth.timestamps, [0.0, 0.1036224, 0.2072343])
    np.testing.assert_array_equal(truth.positions[2], [2, 0, 4])


@pytest.mark.parametrize(("n_poses", "n_expected"), [(5, 3), (2, 2)])
def test_kitti_ground_truth_of_another_length(
    kitti: Path, n_poses: int, n_expected: int, caplog: pytest.LogCaptureFixture
) -> None:
    (kitti / "poses.txt").write_text(poses_text(n_poses))
    truth = open_sequence(kitti).ground_truth()
    assert truth is not None
    assert len(truth) == n_expected
    assert f"{n_poses} poses for 3 frames" in caplog.text


def test_kitti_bad_ground_truth(kitti: Path) -> None:
    (kitti / "poses.txt").write_text("1 0 0\n")
    with pytest.raises(DatasetError, match=r"poses\.txt:1: expected 12"):
        open_sequence(kitti).ground_truth()


# ---- EuRoC ---------------------------------------------------------------------------------------

SENSOR_YAML = """\
%YAML:1.0
sensor_type: camera
comment: VI-Sensor {name} (made up)

T_BS:
  cols: 4
  rows: 4
  data: [0.0, -1.0, 0.0, {x},
         1.0, 0.0, 0.0, 0.02,
         0.0, 0.0, 1.0, 0.03,
         0.0, 0.0, 0.0, 1.0]
rate_hz: 20
resolution: [64, 48]
camera_model: pinhole
intrinsics: [40.0, 41.0, 32.0, 24.0] #fu, fv, cu, cv
distortion_model: radial-tangential
distortion_coefficients: [-0.1, 0.01, 0.0, 0.0]
"""
STAMPS = (1403715273262142976, 1403715273312143104, 1403715273362142976)


@pytest.fixture
def euroc(tmp_path: Path) -> Path:
    folder = tmp_path / "V9_01"
    for number, name in enumerate(("cam0", "cam1")):
        camera = folder / "mav0" / name
        lines = ["#timestamp [ns],filename"]
        for k, stamp in enumerate(STAMPS):
            save(camera / "data" / f"{stamp}.png", image(10 * number + k))
            lines.append(f"{stamp},{stamp}.png")
        (camera / "data.csv").write_text("\r\n".join(lines) + "\r\n")
        # The camera's x axis is the body's y axis: the right camera lies at larger y.
        text = SENSOR_YAML.format(name=name, x=0.01).replace(" 0.02,", f" {0.02 + 0.1 * number},")
        (camera / "sensor.yaml").write_text(text)
    return folder


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
    with pytest.raises(DatasetError, match="no time stamp in common"):
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
    assert "data.csv:3: time stamp 1403715273.262142976 is not after" in caplog.text


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("camera_model: pinhole", "camera_model: omni", "allowed: pinhole"),
        ("radial-tangential", "equidistant", "allowed: radial-tangential"),
        ("intrinsics: [40.0,", "intrinsics: [", "intrinsics must hold 4 numbers"),
        ("intrinsics: [40.0,", "intrinsics: [x,", "intrinsics: 'x' is not a number"),
        ("intrinsics: [40.0,", "intrinsics: [-40.0,", "Camera.fx"),
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
    (folder / "data.csv").write_text(",".join(row[:9]) + "\n")
    with pytest.raises(DatasetError, match=r"data\.csv:1: expected 8 or 17 numbers, found 9"):
        open_sequence(euroc, Sensor.MONOCULAR).ground_truth()


# ---- recognising ---------------------------------------------------------------------------------


def test_recognise(tum: Path, kitti: Path, euroc: Path) -> None:
    assert recognise(tum) is Layout.TUM
    assert recognise(kitti) is Layout.KITTI
    assert recognise(euroc) is Layout.EUROC
    assert recognise(euroc / "mav0") is Layout.EUROC


def test_folders_that_are_no_sequence(tum: Path, tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="does not exist"):
        open_sequence(tmp_path / "nowhere")
    with pytest.raises(DatasetError, match="is no folder"):
        open_sequence(tum / "rgb.txt")
    with pytest.raises(DatasetError, match=r"looked for rgb\.txt .*did you mean .*freiburg2"):
        open_sequence(tum.parent)
    with pytest.raises(DatasetError, match="no sequence we know"):
        open_sequence(tum / "rgb")


def test_folder_of_two_layouts(tum: Path) -> None:
    (tum / "image_0").mkdir()
    (tum / "times.txt").write_text("0\n")
    with pytest.raises(DatasetError, match=r"several layouts \(tum, kitti\)"):
        open_sequence(tum)
    assert len(open_sequence(tum, layout=Layout.TUM)) == 3


def test_association_belongs_to_tum(kitti: Path) -> None:
    with pytest.raises(DatasetError, match="belongs to a TUM sequence"):
        open_sequence(kitti, association="a.txt")


def test_layout_that_the_folder_has_not(tum: Path, kitti: Path) -> None:
    with pytest.raises(DatasetError, match=r"cannot open .*times\.txt"):
        KittiSequence(tum)
    with pytest.raises(DatasetError, match="neither mav0/cam0 nor cam0"):
        EurocSequence(kitti)

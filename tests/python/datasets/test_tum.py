# SPDX-License-Identifier: BSD-3-Clause
"""TUM RGB-D sequences: small made-up folders, good and bad."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from orbslam2py import DatasetError, Sensor
from orbslam2py.datasets import Sequence, TumSequence, open_sequence
from orbslam2py.settings import builtin_settings
from support.small_folders import SIZE, image, save


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
    """The original's examples exchange red and blue (OD-3)."""
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
    """The original takes one in the middle for an image without a name (OD-10)."""
    text = (tum / "rgb.txt").read_text()
    (tum / "rgb.txt").write_text(text.replace("100.2", "# pause\n\n   # more\n100.2", 1))
    assert len(open_sequence(tum, Sensor.MONOCULAR)) == 4


@pytest.mark.parametrize(
    ("name", "line", "expected"),
    [
        ("rgb.txt", "100.4", "rgb.txt:8: expected 'timestamp path', found 1 field"),
        ("rgb.txt", "abc rgb/100.300000.png", "rgb.txt:8: 'abc' is not a number"),
        ("depth.txt", "nan depth/100.305000.png", "depth.txt:5: nan is not finite"),
        ("associations.txt", "100.3 rgb/100.300000.png", "associations.txt:1: expected 't_rgb"),
        ("associations.txt", "1 a.png x b.png", "associations.txt:1: expected 't_rgb"),
    ],
)
def test_malformed_line(tum: Path, name: str, line: str, expected: str) -> None:
    with (tum / name).open("a") as stream:
        stream.write(line + "\n")
    with pytest.raises(DatasetError) as caught:
        open_sequence(tum)
    assert expected in str(caught.value)


def test_a_time_that_is_there_twice_is_spread(tum: Path, caplog: pytest.LogCaptureFixture) -> None:
    with (tum / "rgb.txt").open("a") as stream:
        stream.write("100.300000 rgb/100.300000.png\n")
    sequence = open_sequence(tum, Sensor.MONOCULAR)
    assert len(sequence) == 5
    assert "2 images have the time stamp of another one" in caplog.text
    assert (np.diff(sequence.timestamps) > 0).all()


def test_list_without_images(tum: Path) -> None:
    """The original reads out of range or divides by zero (OD-9)."""
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
    """The original reads it in an endless loop (OD-8)."""
    (tum / "rgb.txt").unlink()
    with pytest.raises(DatasetError, match=r"cannot open .*rgb\.txt"):
        TumSequence(tum, Sensor.RGBD)


def test_sensor_without_images(tum: Path) -> None:
    with pytest.raises(DatasetError, match="no stereo images; it can be used as: rgbd, mono"):
        open_sequence(tum, Sensor.STEREO)
    (tum / "depth.txt").unlink()
    with pytest.raises(DatasetError, match="no rgbd images; it can be used as: mono"):
        open_sequence(tum, Sensor.RGBD)

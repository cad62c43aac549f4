# SPDX-License-Identifier: BSD-3-Clause
"""Videos: what they deliver, and bad ones."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from orbslam2py import DatasetError, ImageError, Sensor, SettingsError
from orbslam2py.datasets import Sequence, VideoReader, VideoSequence, open_input
from support.numbered_images import MONO, SIZE, number_of, with_size, write_video


def test_video_delivers_every_frame_in_order(video: Path) -> None:
    sequence: Sequence = VideoSequence(video, settings="tum1")
    assert (sequence.name, sequence.layout, sequence.sensor) == ("walk", "video", MONO)
    assert len(sequence) == 20
    np.testing.assert_allclose(sequence.timestamps, np.arange(20) / 25, atol=1e-6)
    assert sequence.timestamp_text(3) == "0.120000000"
    bgr = not sequence.settings.camera.rgb
    for k in (0, 1, 2, 7, 19, 5, 6, 0):  # forward, leaping, and back
        image = sequence.load(k).image
        assert number_of(image if bgr else image[..., ::-1]) == k
    assert sequence.ground_truth() is None


def test_video_rate_and_times(video: Path, tmp_path: Path) -> None:
    sequence = VideoSequence(video, settings="tum1", fps=10)
    np.testing.assert_allclose(sequence.timestamps, np.arange(20) / 10)
    assert sequence.settings.camera.fps == 10
    times = tmp_path / "times.txt"
    times.write_text("# when\n" + "\n".join(f"{5 + k}.25" for k in range(20)))
    sequence = VideoSequence(video, settings="tum1", times=times)
    assert sequence.timestamp_text(2) == "7.25"
    with pytest.raises(DatasetError, match="exclude each other"):
        VideoSequence(video, settings="tum1", times=times, fps=10)


def test_video_reader_takes_every_nth_frame(video: Path) -> None:
    frames = [frame for frame in VideoReader(video).frames(6) if isinstance(frame, np.ndarray)]
    assert [number_of(frame) for frame in frames] == [0, 6, 12, 18]


@pytest.mark.parametrize(("share", "told"), [(1.0, False), (0.6, True)])
def test_a_video_that_was_cut_off_is_told(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, share: float, told: bool
) -> None:
    """Its beginning says how much there should be."""
    whole = write_video(tmp_path / "whole.avi", code="MJPG", n=30)
    cut = tmp_path / "cut.avi"
    data = whole.read_bytes()
    cut.write_bytes(data[: int(share * len(data))])
    n = len(VideoSequence(cut, settings="tum1"))
    assert (n < 30) is told
    warned = f"cut.avi says it lasts 1.2 s, but its pictures end after {n / 25:.1f} s ({n} frames)"
    assert (warned in caplog.text) is told


def test_bad_videos(tmp_path: Path, video: Path, folder: Path) -> None:
    with pytest.raises(DatasetError, match="does not exist"):
        VideoSequence(tmp_path / "none.mp4", settings="tum1")
    bad = tmp_path / "bad.mp4"
    bad.write_bytes(b"this is no video" * 100)
    with pytest.raises(DatasetError, match=r"bad\.mp4 is no video"):
        VideoSequence(bad, settings="tum1")
    bad.write_bytes(b"")
    with pytest.raises(DatasetError, match=r"bad\.mp4 is no video"):
        open_input(bad, MONO, settings="tum1")
    with pytest.raises(DatasetError, match="is an image, no video; give the folder"):
        open_input(folder / "1.png", MONO, settings="tum1")
    empty = tmp_path / "empty.avi"
    cv2.VideoWriter(str(empty), cv2.VideoWriter_fourcc(*"MJPG"), 25, SIZE[::-1]).release()
    with pytest.raises(DatasetError, match=r"empty\.avi .*(no frames|no video)"):
        open_input(empty, MONO, settings="tum1")
    with pytest.raises(SettingsError, match="orbslam2py calibrate"):
        VideoSequence(video)
    with pytest.raises(DatasetError, match="no stereo images; it can be used as: mono"):
        VideoSequence(video, Sensor.STEREO, settings="tum1")
    with pytest.raises(SettingsError, match=r"--fps: .*fps"):
        VideoSequence(video, settings="tum1", fps=-1)


def test_frame_past_the_end_of_a_video(video: Path) -> None:
    with pytest.raises(ImageError, match=r"frame 25 of video .*walk\.mp4 cannot be decoded"):
        VideoReader(video).read(25)


def test_first_image_tells_that_the_settings_do_not_fit(
    video: Path, caplog: pytest.LogCaptureFixture
) -> None:
    sequence = VideoSequence(video, settings=with_size("tum1"))
    sequence.load(0)
    sequence.load(1)
    assert [r.getMessage() for r in caplog.records if "128 x 96" in r.getMessage()] == [
        f"{video} has images of 128 x 96 pixels, but the settings are for 752 x 480: "
        "focal lengths and distortion do not fit"
    ]

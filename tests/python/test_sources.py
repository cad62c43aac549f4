# SPDX-License-Identifier: BSD-3-Clause
"""Videos, folders of images, cameras and masks: what they deliver, and bad ones."""

from __future__ import annotations

import logging
import threading
import time
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from orbslam2py.cli.app import app
from orbslam2py.datasets import (
    ImageFolder,
    LiveCamera,
    MaskedCamera,
    MaskedSequence,
    Sequence,
    TumSequence,
    VideoReader,
    VideoSequence,
    live,
    open_source,
)
from orbslam2py.datasets.image_folder import natural_key
from orbslam2py.datasets.time_files import read_time_file
from orbslam2py.errors import DatasetError, ImageError, OrbSlamError, SettingsError, StateError
from orbslam2py.settings.builtin import builtin_settings
from orbslam2py.settings.sensor import Sensor
from orbslam2py.settings.settings import Settings
from orbslam2py.slam.front_end import FrontEnd
from orbslam2py._timing import StageTimer

MONO = Sensor.MONOCULAR
SIZE = (96, 128)  # rows, columns


def coloured(k: int) -> np.ndarray:
    """A plain BGR image whose shade tells its number."""
    pixels = np.zeros((*SIZE, 3), np.uint8)
    pixels[..., 0], pixels[..., 1], pixels[..., 2] = 8 * k, 128, 255 - 8 * k
    return pixels


def with_size(name: str) -> Settings:
    settings = builtin_settings(name, MONO)
    return replace(settings, camera=replace(settings.camera, width=752, height=480))


def number_of(bgr: np.ndarray) -> int:
    return round(float(bgr[..., 0].mean()) / 8)


@pytest.fixture(scope="module")
def video(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Twenty frames at 25 per second."""
    path = tmp_path_factory.mktemp("video") / "walk.mp4"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"mp4v"), 25, SIZE[::-1])
    if not writer.isOpened():
        pytest.skip("this OpenCV cannot write videos")
    for k in range(20):
        writer.write(coloured(k))
    writer.release()
    return path


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Images 1.png to 12.png, which sort otherwise as text, and other files."""
    folder = tmp_path / "walk"
    folder.mkdir()
    for k in range(1, 13):
        assert cv2.imwrite(str(folder / f"{k}.png"), coloured(k))
    (folder / "notes.txt").write_text("no image\n")
    (folder / "._1.png").write_text("no image either\n")
    return folder


# ---- videos --------------------------------------------------------------------------------------


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


def test_colour_order_follows_camera_rgb(folder: Path, tmp_path: Path) -> None:
    text = builtin_settings("tum1", MONO).to_yaml()
    images = []
    for value in (0, 1):
        path = tmp_path / f"{value}.yaml"
        path.write_text(text.replace("Camera.RGB: 1", f"Camera.RGB: {value}"))
        images.append(ImageFolder(folder, settings=path).load(4).image)
    np.testing.assert_array_equal(images[0], coloured(5))
    np.testing.assert_array_equal(images[1], coloured(5)[..., ::-1])


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


def test_bad_videos(tmp_path: Path, video: Path, folder: Path) -> None:
    with pytest.raises(DatasetError, match="does not exist"):
        VideoSequence(tmp_path / "none.mp4", settings="tum1")
    bad = tmp_path / "bad.mp4"
    bad.write_bytes(b"this is no video" * 100)
    with pytest.raises(DatasetError, match=r"bad\.mp4 is no video"):
        VideoSequence(bad, settings="tum1")
    bad.write_bytes(b"")
    with pytest.raises(DatasetError, match=r"bad\.mp4 is no video"):
        open_source(bad, MONO, settings="tum1")
    with pytest.raises(DatasetError, match="is an image, no video; give the folder"):
        open_source(folder / "1.png", MONO, settings="tum1")
    empty = tmp_path / "empty.avi"
    cv2.VideoWriter(str(empty), cv2.VideoWriter_fourcc(*"MJPG"), 25, SIZE[::-1]).release()
    with pytest.raises(DatasetError, match=r"empty\.avi .*(no frames|no video)"):
        open_source(empty, MONO, settings="tum1")
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
    video: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The command line, if it was used before, keeps messages from other handlers.
    monkeypatch.setattr(logging.getLogger("orbslam2py"), "propagate", True)
    sequence = VideoSequence(video, settings=with_size("tum1"))
    sequence.load(0)
    sequence.load(1)
    assert [r.getMessage() for r in caplog.records if "128 x 96" in r.getMessage()] == [
        f"{video} has images of 128 x 96 pixels, but the settings are for 752 x 480: "
        "focal lengths and distortion do not fit"
    ]


# ---- folders of images ---------------------------------------------------------------------------


def test_image_folder_sorts_naturally(folder: Path) -> None:
    sequence: Sequence = open_source(folder, MONO, settings="tum1")  # type: ignore[assignment]
    assert isinstance(sequence, ImageFolder)
    assert (sequence.name, sequence.layout, len(sequence)) == ("walk", "images", 12)
    assert [path.name for path in sequence.paths] == [f"{k}.png" for k in range(1, 13)]
    np.testing.assert_allclose(sequence.timestamps, np.arange(12) / 30)


def test_natural_key_compares_mixed_names() -> None:
    names = ["b2", "a10b3", "a2b10", "a2b9", "10", "9", "a"]
    assert sorted(names, key=natural_key) == ["9", "10", "a", "a2b9", "a2b10", "a10b3", "b2"]


def test_image_folder_takes_settings_that_lie_in_it(folder: Path) -> None:
    with pytest.raises(SettingsError, match=r"no settings for .*orbslam2py calibrate"):
        ImageFolder(folder)
    builtin_settings("tum2", MONO).save(folder / "settings.yaml")
    assert ImageFolder(folder).settings == builtin_settings("tum2", MONO)
    assert ImageFolder(folder).default_settings() == builtin_settings("tum2", MONO)


def test_bad_image_folders(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    with pytest.raises(DatasetError, match="no images in"):
        ImageFolder(tmp_path / "empty", settings="tum1")
    with pytest.raises(DatasetError, match=r"did you mean .*walk"):
        open_source(tmp_path, MONO, settings="tum1")
    with pytest.raises(DatasetError, match="does not exist"):
        open_source(tmp_path / "nowhere", MONO, settings="tum1")
    with pytest.raises(DatasetError, match="cannot list"):
        ImageFolder(tmp_path / "nowhere", settings="tum1")
    (folder / "3.png").write_bytes(b"")
    with pytest.raises(ImageError, match=r"3\.png is no readable image"):
        ImageFolder(folder, settings="tum1").load(2)


def test_options_that_a_known_layout_does_not_take(tmp_path: Path) -> None:
    tum = tmp_path / "freiburg1_x"
    tum.mkdir()
    cv2.imwrite(str(tum / "a.png"), coloured(1))
    (tum / "rgb.txt").write_text("1.0 a.png\n")
    assert isinstance(open_source(tum, MONO), TumSequence)
    with pytest.raises(DatasetError, match=r"--fps is for .*is tum"):
        open_source(tum, MONO, fps=20)
    with pytest.raises(DatasetError, match=r"--times is for .*is tum"):
        open_source(tum, MONO, times=tum / "rgb.txt")


# ---- time stamps ---------------------------------------------------------------------------------


def times_file(tmp_path: Path, *lines: str) -> Path:
    path = tmp_path / "times.txt"
    path.write_text("\n".join(lines) + "\n")
    return path


def test_times_keep_their_text(tmp_path: Path) -> None:
    stamps = read_time_file(times_file(tmp_path, "1.50", "", "2.25000001"), 2)
    assert stamps.texts == ("1.50", "2.25000001")
    np.testing.assert_array_equal(stamps.seconds, [1.5, 2.25000001])


def test_whole_numbers_are_nanoseconds_if_seconds_make_no_sense(tmp_path: Path) -> None:
    stamps = read_time_file(times_file(tmp_path, "1403636579763555584", "1403636579813555456"), 2)
    assert stamps.texts == ("1403636579.763555584", "1403636579.813555456")
    assert stamps.seconds[1] - stamps.seconds[0] == pytest.approx(0.05, abs=1e-6)
    assert read_time_file(times_file(tmp_path, "0", "33000000"), 2).texts[1] == "0.033000000"
    assert read_time_file(times_file(tmp_path, "0", "1", "2"), 3).seconds.tolist() == [0, 1, 2]


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (["1", "2"], "holds 2 time stamps, but there are 3 images"),
        (["1", "2", "3", "4"], "holds 4 time stamps, but there are 3 images"),
        (["1.0", "2.0", "2.0"], r"times\.txt:3: time stamp 2\.0 is not after"),
        (["1.0", "x", "2.0"], r"times\.txt:2: 'x' is not a number"),
        (["1.0", "nan", "2.0"], r"times\.txt:2: nan is not finite"),
        (["1.0 a.png", "2", "3"], r"times\.txt:1: expected one time stamp, found 2"),
    ],
)
def test_bad_times(tmp_path: Path, lines: list[str], message: str) -> None:
    with pytest.raises(DatasetError, match=message):
        read_time_file(times_file(tmp_path, *lines), 3)


def test_missing_times(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match=r"cannot open .*times\.txt"):
        read_time_file(tmp_path / "times.txt", 3)


# ---- masks ---------------------------------------------------------------------------------------


def mask_image(value: int = 0, size: tuple[int, int] = SIZE) -> np.ndarray:
    mask = np.full(size, 255, np.uint8)
    mask[: size[0] // 2] = value
    return mask


def test_one_mask_for_all(folder: Path, tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "mask.png"), mask_image())
    sequence: Sequence = open_source(  # type: ignore[assignment]
        folder, MONO, settings="tum1", mask=tmp_path / "mask.png"
    )
    assert isinstance(sequence, MaskedSequence)
    assert (sequence.name, sequence.layout, len(sequence)) == ("walk", "images", 12)
    assert sequence.settings == builtin_settings("tum1", MONO) == sequence.default_settings()
    assert sequence.ground_truth() is None
    images = sequence.load(3)
    np.testing.assert_array_equal(images.mask, mask_image())
    assert images.image.shape == (*SIZE, 3)


def test_masks_by_name_or_by_order(folder: Path, video: Path, tmp_path: Path) -> None:
    masks = tmp_path / "masks"
    masks.mkdir()
    for k in range(1, 13):  # colour files with equal channels are masks too
        cv2.imwrite(str(masks / f"{k}.bmp"), cv2.cvtColor(mask_image(k), cv2.COLOR_GRAY2BGR))
    sequence = MaskedSequence(ImageFolder(folder, settings="tum1"), masks)
    for i in (0, 10):
        mask = sequence.load(i).mask
        assert mask is not None
        assert mask[0, 0] == i + 1
    frames = VideoSequence(video, settings="tum1")
    with pytest.raises(DatasetError, match="12 masks for 20 images"):
        MaskedSequence(frames, masks)
    for k in range(13, 21):
        cv2.imwrite(str(masks / f"{k}.png"), mask_image(k))
    mask = MaskedSequence(frames, masks).load(14).mask
    assert mask is not None
    assert mask[0, 0] == 15
    (masks / "7.bmp").unlink()
    with pytest.raises(DatasetError, match=r"the first without one is 7\)"):
        MaskedSequence(ImageFolder(folder, settings="tum1"), masks)


def test_bad_masks(folder: Path, tmp_path: Path) -> None:
    sequence = ImageFolder(folder, settings="tum1")
    path = tmp_path / "mask.png"
    with pytest.raises(DatasetError, match=r"mask .*mask\.png does not exist"):
        MaskedSequence(sequence, path)
    path.write_bytes(b"no image")
    with pytest.raises(ImageError, match=r"mask\.png is no readable image"):
        MaskedSequence(sequence, path)
    cv2.imwrite(str(path), mask_image().astype(np.uint16))
    with pytest.raises(ImageError, match="8 bits"):
        MaskedSequence(sequence, path)
    cv2.imwrite(str(path), coloured(3))
    with pytest.raises(ImageError, match=r"mask\.png is coloured"):
        MaskedSequence(sequence, path)
    cv2.imwrite(str(path), mask_image(size=(50, 60)))
    with pytest.raises(ImageError, match=r"mask\.png is 60 x 50, but its image 128 x 96"):
        MaskedSequence(sequence, path).load(0)
    (tmp_path / "none").mkdir()
    with pytest.raises(DatasetError, match="no masks in"):
        MaskedSequence(sequence, tmp_path / "none")


@pytest.mark.parametrize("sensor", [Sensor.STEREO, Sensor.RGBD])
def test_no_keypoint_lies_where_the_mask_is_0(sensor: Sensor) -> None:
    generator = np.random.default_rng(1)
    image = cv2.resize(generator.integers(0, 255, (60, 80), dtype=np.uint8), (640, 480))
    mask = np.full((480, 640), 255, np.uint8)
    mask[:, :300] = 0
    settings = builtin_settings("euroc" if sensor is Sensor.STEREO else "tum1", sensor)
    front = FrontEnd(settings, sensor)
    if sensor is Sensor.STEREO:
        frames = [front.stereo(image, image, 0, 0.0, StageTimer(), m) for m in (None, (mask, None))]
    else:
        depth = np.ones((480, 640), np.uint16)
        frames = [front.rgbd(image, depth, 0, 0.0, StageTimer(), m) for m in (None, mask)]
    assert frames[0].keypoints[:, 0].min() < 100
    assert frames[1].keypoints[:, 0].min() >= 300
    assert frames[1].size > 100


def test_front_end_refuses_masks_that_do_not_fit() -> None:
    image = np.zeros((480, 640), np.uint8)
    front = FrontEnd(builtin_settings("euroc", Sensor.STEREO), Sensor.STEREO)
    with pytest.raises(ImageError, match=r"right mask has shape \(480, 600\)"):
        front.stereo(image, image, 0, 0.0, StageTimer(), (None, image[:, :600]))
    with pytest.raises(ImageError, match=r"left mask must be .* uint8 .*got bool"):
        front.stereo(image, image, 0, 0.0, StageTimer(), image > 0)  # type: ignore[arg-type]


# ---- cameras -------------------------------------------------------------------------------------


class FakeCapture:
    """Delivers numbered images when it is told to."""

    def __init__(self, opened: bool = True) -> None:
        self.opened = opened
        self.allowed = threading.Semaphore(0)
        self.properties: dict[int, float] = {}
        self.n_read = 0
        self.broken = False
        self.released = False

    def isOpened(self) -> bool:
        return self.opened

    def set(self, prop: int, value: float, /) -> bool:
        self.properties[prop] = value
        return True

    def read(self) -> tuple[bool, object]:
        if not self.allowed.acquire(timeout=0.002 if self.broken else 0.3):
            return False, None
        self.n_read += 1
        return True, coloured(self.n_read)

    def release(self) -> None:
        self.released = True


def camera_of(capture: FakeCapture, **options: object) -> LiveCamera:
    return LiveCamera(0, settings="tum1", open_capture=lambda _: capture, **options)  # type: ignore[arg-type]


def wait_for(condition: object) -> None:
    deadline = time.monotonic() + 10
    while not condition():  # type: ignore[operator]
        assert time.monotonic() < deadline
        time.sleep(0.002)


def test_newest_image_wins_and_the_others_are_counted() -> None:
    capture = FakeCapture()
    with camera_of(capture) as camera:
        assert camera.take(0.0) is None
        for _ in range(5):
            capture.allowed.release()
        wait_for(lambda: camera.n_dropped == 4)
        frame = camera.take(5.0)
        assert frame is not None
        rgb = camera.settings.camera.rgb
        assert number_of(frame.images.image[..., ::-1] if rgb else frame.images.image) == 5
        assert camera.take(0.0) is None
        capture.allowed.release()
        second = camera.take(5.0)
        assert second is not None
        assert second.timestamp > frame.timestamp
        assert float(second.text) == second.timestamp
        assert abs(second.timestamp - time.time()) < 60
        assert camera.n_dropped == 4
    assert capture.released


def test_camera_is_iterated_until_it_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live, "_WAIT_SLICE", 0.002)
    capture = FakeCapture()
    with camera_of(capture) as camera:
        seen = []
        capture.allowed.release()
        with pytest.raises(DatasetError, match="camera 0 sends no more images"):
            for frame in camera:
                seen.append(frame)
                if len(seen) < 3:
                    capture.allowed.release()
                capture.broken = len(seen) == 3
        assert len(seen) == 3


def test_camera_that_stays_silent(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live, "_PATIENCE", 0.05)
    with (
        camera_of(FakeCapture()) as camera,
        pytest.raises(DatasetError, match="camera 0 has sent no image for"),
    ):
        for _ in camera:
            pass


def test_exception_in_the_capture_thread_arrives() -> None:
    capture = FakeCapture()

    def fail() -> tuple[bool, object]:
        raise OSError("cable")

    capture.read = fail  # type: ignore[method-assign]
    with (
        camera_of(capture) as camera,
        pytest.raises(DatasetError, match="camera 0 failed: cable"),
    ):
        wait_for(lambda: camera.take(0.1) is not None)


def test_camera_is_asked_for_size_and_rate() -> None:
    capture = FakeCapture()
    settings = with_size("euroc")
    camera = LiveCamera(0, settings=settings, fps=15, open_capture=lambda _: capture)
    camera.open()
    assert capture.properties == {
        cv2.CAP_PROP_FRAME_WIDTH: 752,
        cv2.CAP_PROP_FRAME_HEIGHT: 480,
        cv2.CAP_PROP_FPS: 15,
    }
    assert camera.settings.camera.fps == 15


def test_camera_that_cannot_be_opened(monkeypatch: pytest.MonkeyPatch) -> None:
    camera = camera_of(FakeCapture(opened=False))
    monkeypatch.setattr(live, "existing_cameras", lambda: [0, 2])
    with pytest.raises(DatasetError, match=r"camera 0 cannot be opened; it may be in use.*: 0, 2"):
        camera.open()
    monkeypatch.setattr(live, "existing_cameras", list)
    with pytest.raises(DatasetError, match="this machine has none"):
        camera.open()
    with pytest.raises(StateError, match="open the camera first"):
        camera.take(0.0)
    with pytest.raises(SettingsError, match="orbslam2py calibrate"):
        LiveCamera(0)


def test_number_that_is_no_file_is_a_camera(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(DatasetError, match="camera 97 cannot be opened"):
        open_source("97", MONO, settings="tum1")
    with pytest.raises(DatasetError, match="--times does not go with a camera"):
        open_source(97, MONO, settings="tum1", times="t.txt")
    (tmp_path / "97").mkdir()
    cv2.imwrite(str(tmp_path / "97" / "a.png"), coloured(1))
    assert open_source("97", MONO, settings="tum1").layout == "images"


def test_camera_with_a_mask(tmp_path: Path) -> None:
    path = tmp_path / "mask.png"
    cv2.imwrite(str(path), mask_image())
    capture = FakeCapture()
    with MaskedCamera(camera_of(capture), path) as camera:
        assert camera.take(0.0) is None
        capture.allowed.release()
        frame = camera.take(5.0)
        assert frame is not None
        np.testing.assert_array_equal(frame.images.mask, mask_image())
        assert (camera.layout, camera.name, camera.n_dropped) == ("camera", "camera0", 0)
    with pytest.raises(DatasetError, match="a camera takes a single mask"):
        MaskedCamera(camera_of(FakeCapture()), tmp_path)


# ---- command line --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        (["97", "--settings", "tum1"], DatasetError, "camera 97 cannot be opened"),
        (["{video}"], SettingsError, "orbslam2py calibrate"),
        (["{video}", "--settings", "tum1", "--times", "no.txt"], DatasetError, "cannot open no"),
        (["{video}", "--settings", "tum1", "--mask", "no.png"], DatasetError, "mask no.png"),
        (["{video}", "--settings", "tum1", "--fps", "0"], SettingsError, "--fps"),
    ],
)
def test_run_refuses_bad_sources(
    video: Path, arguments: list[str], error: type[OrbSlamError], message: str
) -> None:
    arguments = [argument.replace("{video}", str(video)) for argument in arguments]
    result = CliRunner().invoke(app, ["run", *arguments, "--sensor", "mono"])
    assert isinstance(result.exception, error)
    assert message in str(result.exception)

# SPDX-License-Identifier: BSD-3-Clause
"""The sequences, videos and files that the documentation's commands name, small, made once."""

from __future__ import annotations

import shutil
import tarfile
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from orbslam2py import _core as core
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from orbslam2py.trajectory import write_kitti, write_tum
from orbslam2py.vocabulary import read_training_images, save_vocabulary, train_vocabulary
from support.realsense import sdk_stream, write_sdk

FRAMES, SIZE = 24, (320, 240)
#: Of what a single camera shows: pages search for a good start in it.
SINGLE_FRAMES = 40

#: The pair that took the images of `mypair`.
CAMCHAIN = """\
cam0:
  camera_model: pinhole
  distortion_coeffs: [0.0, 0.0, 0.0, 0.0]
  distortion_model: radtan
  intrinsics: [200.0, 200.0, 159.5, 119.5]
  resolution: [320, 240]
cam1:
  T_cn_cnm1:
  - [1.0, 0.0, 0.0, -0.1]
  - [0.0, 1.0, 0.0, 0.0]
  - [0.0, 0.0, 1.0, 0.0]
  - [0.0, 0.0, 0.0, 1.0]
  camera_model: pinhole
  distortion_coeffs: [0.0, 0.0, 0.0, 0.0]
  distortion_model: radtan
  intrinsics: [200.0, 200.0, 159.5, 119.5]
  resolution: [320, 240]
"""

#: Of two lenses of 180 degrees.
FISHEYE_CAMCHAIN = (
    CAMCHAIN.replace("radtan", "equidistant")
    .replace("[0.0, 0.0, 0.0, 0.0]", "[0.01, 0.0, 0.0, 0.0]")
    .replace("200.0, 200.0", "100.0, 100.0")
)

#: What `batch` runs.
JOBS = "sequences: [rgbd_dataset_freiburg1_desk]\noptions: {max_frames: 8}\nseeds: 2\n"


def make_data(folder: Path) -> None:
    """Fill a folder with everything the documentation takes as given."""
    sequences = {
        "rgbd_dataset_freiburg1_desk": ("rgbd", "tum"),
        "dataset/sequences/06": ("stereo", "kitti"),
        "V1_01_easy": ("stereo", "euroc"),
    }
    for name, (sensor, layout) in sequences.items():
        _walk(sensor).write(folder / name, layout)
    (folder / "mypair").symlink_to(folder / "V1_01_easy")
    bag = _walk("stereo").write(folder / "bag", "mcap")
    (bag / "images.mcap").replace(folder / "drive.mcap")
    shutil.rmtree(bag)
    _write_recording(folder / "recording.db3")
    _write_phone(folder / "phone")
    single = _walk("mono", SINGLE_FRAMES)
    images = [single.load(i).image for i in range(SINGLE_FRAMES)]
    single.settings.save(folder / "my.yaml")
    truth = single.ground_truth()
    write_tum(folder / "groundtruth.txt", truth)
    for name in ("estimate.txt", "poses.txt"):  # KITTI's format has no times of its own
        write_kitti(folder / name, truth)
    (folder / "times.txt").write_text("".join(f"{t:.9f}\n" for t in truth.timestamps))
    write_video(folder / "video.mp4", images, 20)
    _write_pair(folder)
    (folder / "photographs").mkdir()
    for i, image in enumerate(images):
        write_image(folder / f"photographs/{i:03d}.png", image)
    hood = np.full(images[0].shape, 255, np.uint8)
    hood[-24:] = 0
    write_image(folder / "hood.png", hood)
    write_video(folder / "board.mp4", chessboard_views(single.camera.matrix, 12), 4)
    (folder / "camchain.yaml").write_text(CAMCHAIN)
    (folder / "fisheye-camchain.yaml").write_text(FISHEYE_CAMCHAIN)
    (folder / "jobs.yaml").write_text(JOBS)
    _write_vocabulary(folder)


def _walk(sensor: str, frames: int = FRAMES) -> SyntheticSequence:
    return SyntheticSequence(
        SyntheticOptions(world="corridor", sensor=sensor, frames=frames, size=SIZE)
    )


def _write_recording(path: Path) -> None:
    """The infrared pair of a RealSense camera, as its SDK records it."""
    walk = _walk("stereo")
    camera = walk.settings.camera
    right = np.eye(4)
    right[0, 3] = -camera.bf / camera.fx
    pairs = [walk.load(i) for i in range(FRAMES)]
    left_images = [pair.image for pair in pairs]
    right_images = [pair.right for pair in pairs if pair.right is not None]
    left = sdk_stream("Infrared_1", left_images, camera.fx, T_stream_reference=np.eye(4))
    other = sdk_stream("Infrared_2", right_images, camera.fx, T_stream_reference=right)
    write_sdk(path, [*left, *other])


def _write_pair(folder: Path) -> None:
    """A pair as two folders, and as images with both views."""
    sequence = _walk("stereo")
    for name in ("pair/left", "pair/right", "wide"):
        (folder / name).mkdir(parents=True)
    for k in range(len(sequence)):
        images = sequence.load(k)
        assert images.right is not None
        write_image(folder / f"pair/left/{k:04d}.png", images.image)
        write_image(folder / f"pair/right/{k:04d}.png", images.right)
        write_image(folder / f"wide/{k:04d}.png", np.hstack([images.image, images.right]))
    sequence.settings.save(folder / "pair_settings.yaml")


def _write_phone(folder: Path) -> None:
    """Images, and depth images in millimetres, without lists."""
    walk = _walk("rgbd")
    for part in ("rgb", "depth"):
        (folder / part).mkdir(parents=True)
    for i in range(FRAMES):
        shown = walk.load(i)
        assert shown.depth is not None
        write_image(folder / f"rgb/{i:03d}.png", shown.image)
        write_image(folder / f"depth/{i:03d}.png", shown.depth // 5)
    assert walk.settings.depth is not None
    depth = replace(walk.settings.depth, raw_per_metre=1000.0)
    replace(walk.settings, depth=depth).save(folder.parent / "camera.yaml")


def _write_vocabulary(folder: Path) -> None:
    options = core.TrainingOptions()
    options.branching, options.depth = 6, 3
    vocabulary = train_vocabulary(read_training_images(folder / "photographs")[:10], options)
    assert vocabulary is not None
    save_vocabulary(vocabulary, folder / "ORBvoc.txt")
    with tarfile.open(folder / "ORBvoc.txt.tar.gz", "w:gz") as archive:
        archive.add(folder / "ORBvoc.txt", "ORBvoc.txt")


def chessboard_views(K: np.ndarray, n: int) -> list[np.ndarray]:
    """A board of 9 x 6 inner corners and squares of 25 mm as the camera of the video sees it."""
    columns, rows, square, pixels = 9, 6, 0.025, 40
    row, column = np.mgrid[: rows + 1, : columns + 1]
    shades = np.where((row + column) % 2, 230, 30).astype(np.uint8)
    board = np.pad(
        np.kron(shades, np.ones((pixels, pixels), np.uint8)), pixels, constant_values=230
    )
    # From pixels of the picture to metres on the board, whose first inner corner is its origin.
    metres = np.diag([square / pixels, square / pixels, 1.0])
    metres[:2, 2] = (0.5 / pixels - 2) * square
    middle = np.array([(columns - 1) * square / 2, (rows - 1) * square / 2, 0.0])
    generator = np.random.default_rng(1)
    views = []
    for _ in range(n):
        R = cv2.Rodrigues(generator.uniform([-0.6, -0.6, -0.3], [0.6, 0.6, 0.3]))[0]
        distance = generator.uniform(0.28, 0.4)
        t = np.array([*generator.uniform(-0.3, 0.3, 2) * distance, distance]) - R @ middle
        H = K @ np.column_stack([R[:, 0], R[:, 1], t]) @ metres
        # Half the size in two steps, which smooths the edges of the squares.
        large = np.diag([2.0, 2.0, 1.0])
        large[:2, 2] = 0.5
        view = cv2.warpPerspective(board, large @ H, (2 * SIZE[0], 2 * SIZE[1]), borderValue=230)
        views.append(cv2.resize(view, SIZE, interpolation=cv2.INTER_AREA))
    return views


def write_video(path: Path, images: list[np.ndarray], fps: float) -> None:
    height, width = images[0].shape
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"mp4v"), fps, (width, height))
    assert writer.isOpened()
    for image in images:
        writer.write(cv2.cvtColor(image, cv2.COLOR_GRAY2BGR))
    writer.release()


def write_image(path: Path, image: np.ndarray) -> None:
    assert cv2.imwrite(str(path), image)


def copy_data(data: Path, folder: Path) -> None:
    """Give a document a folder of its own; large things are shared."""
    for source in data.iterdir():
        if source.is_dir():
            (folder / source.name).symlink_to(source)
        else:
            shutil.copy(source, folder / source.name)

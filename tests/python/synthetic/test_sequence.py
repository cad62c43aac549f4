# SPDX-License-Identifier: BSD-3-Clause
"""Synthetic sequences: same bytes, exact truth, folders that the loaders read."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest

from orbslam2py import DatasetError, Sensor, SettingsError, open_sequence
from orbslam2py.datasets import Layout
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence, SyntheticWorld
from orbslam2py.synthetic.scenes import LAPS, ROOM_BESIDE
from support.rendered_once import made_each_time

SMALL = (160, 120)
WORLDS = list(SyntheticWorld)
STREETS = (SyntheticWorld.STREET, SyntheticWorld.STREET_LAP, SyntheticWorld.STREET_BLOCK)

LAYOUTS = [
    (Layout.TUM, Sensor.MONOCULAR),
    (Layout.TUM, Sensor.RGBD),
    (Layout.KITTI, Sensor.MONOCULAR),
    (Layout.KITTI, Sensor.STEREO),
    (Layout.EUROC, Sensor.MONOCULAR),
    (Layout.EUROC, Sensor.STEREO),
]


def small(**options) -> SyntheticSequence:
    return SyntheticSequence(SyntheticOptions(**{"size": SMALL, "frames": 3} | options))


def corners(image: np.ndarray) -> int:
    return len(cv2.FastFeatureDetector_create(20, True).detect(image))


# ---- images --------------------------------------------------------------------------------------
@pytest.mark.parametrize("world", WORLDS)
def test_views_are_rich_in_corners_and_neither_dark_nor_blown_out(world):
    sequence = SyntheticSequence(SyntheticOptions(world=world, sensor="mono"))
    counts = []
    for i in np.linspace(0, len(sequence) - 1, 7).astype(int):
        image = sequence.load(int(i)).image
        counts.append(corners(image))
        assert 60 < image.mean() < 190
        assert image.std() > 20
        assert ((image == 0) | (image == 255)).mean() < 0.01
    assert min(counts) > 500
    few = world in (SyntheticWorld.WALL, SyntheticWorld.LIFT_DOOR)  # one distance, no far things
    assert np.median(counts) > (800 if few else 1500)
    assert max(counts) < 10000  # not gravel


def test_the_same_options_give_the_same_bytes():
    with made_each_time():
        first = small(sensor="rgbd", noise=3, depth_noise=0.002)
        again = SyntheticSequence(first.options, threads=2)
        for i in range(len(first)):
            a, b = first.load(i), again.load(i)
            assert np.array_equal(a.image, b.image)
            assert np.array_equal(a.depth, b.depth)


@pytest.mark.parametrize(
    "change",
    [
        *({"seed": 1}, {"noise": 2.0}, {"exposure": 0.7}, {"lateral": 0.3}, {"yaw": 10.0}),
        *({"pace": 2.0}, {"blur": 1.0}, {"exposure": (0.3, 0.6)}, {"cover": 0.05}),
    ],
)
def test_every_option_changes_the_image(change):
    assert not np.array_equal(small().load(1).image, small(**change).load(1).image)


def test_noise_differs_between_frames_and_between_cameras():
    plain, noisy = small(world="room"), small(world="room", noise=4.0)
    left = [noisy.load(i).image.astype(int) - plain.load(i).image for i in range(2)]
    right = noisy.load(0).right.astype(int) - plain.load(0).right
    for a, b in ((left[0], left[1]), (left[0], right)):
        assert abs(np.corrcoef(a.ravel(), b.ravel())[0, 1]) < 0.05
    assert left[0].std() == pytest.approx(4, abs=0.2)


def test_depth_tells_where_the_right_camera_sees_a_pixel():
    sequence = SyntheticSequence(SyntheticOptions(world="room", sensor="stereo", frames=40))
    images, depth = sequence.load(30), sequence.exact_depth(30)
    rows, columns = np.indices(depth.shape, dtype=np.float32)
    warped = cv2.remap(
        images.right, columns - sequence.camera.bf / depth, rows, cv2.INTER_LINEAR, borderValue=0
    )
    error = np.abs(warped.astype(int) - images.image)[:, 40:]
    assert np.median(error) <= 2
    assert (error < 15).mean() > 0.93  # the rest is hidden from one of the cameras


def test_raw_depth_is_the_exact_one_in_steps_of_a_fifth_of_a_millimetre():
    sequence = small(sensor="rgbd", world="street", frames=1)
    raw, exact = sequence.load(0).depth, sequence.exact_depth(0)
    assert raw.dtype == np.uint16
    near = (exact > 0) & (exact < 13.1)
    assert np.abs(raw[near] / 5000 - exact[near]).max() < 1.01e-4
    assert not raw[(exact == 0) | (exact > 13.2)].any()
    assert sequence.default_settings().depth.raw_per_metre == 5000


def test_depth_noise_grows_with_the_square_of_the_depth():
    clean, noisy = (small(sensor="rgbd", depth_noise=s, size=(640, 480)) for s in (0, 0.003))
    exact = clean.exact_depth(0)
    relative = (noisy.load(0).depth / 5000 - exact) / exact**2
    assert relative.std() == pytest.approx(0.003, rel=0.03)
    assert abs(relative.mean()) < 1e-4


# ---- ways ----------------------------------------------------------------------------------------
@pytest.mark.parametrize("world", WORLDS)
def test_motion_is_plausible(world):
    sequence = SyntheticSequence(SyntheticOptions(world=world))
    T_wc = sequence.ground_truth().T_wc
    np.testing.assert_allclose(np.linalg.det(T_wc[:, :3, :3]), 1, atol=1e-12)
    step = np.linalg.norm(np.diff(T_wc[:, :3, 3], axis=0), axis=1)
    fps = sequence.camera.fps
    assert step.max() * fps < (10.5 if world in STREETS else 1.0)
    relative = np.swapaxes(T_wc[:-1, :3, :3], 1, 2) @ T_wc[1:, :3, :3]
    angles = np.degrees(np.arccos(np.clip((np.trace(relative, axis1=1, axis2=2) - 1) / 2, -1, 1)))
    assert angles.max() * fps < 50
    assert np.abs(np.diff(angles)).max() < 0.5


@pytest.mark.parametrize("world", LAPS)
def test_ways_around_come_back_to_their_start_and_go_on_looking_the_same_way(world):
    sequence = SyntheticSequence(SyntheticOptions(world=world))
    T_wc, length = sequence.ground_truth().T_wc, sequence.lap_length
    step = sequence.options.speed or (10.0 if world in STREETS else 0.7)
    lap = round(length / step * sequence.camera.fps)
    again = len(sequence) - lap
    assert again * step / sequence.camera.fps > 4  # metres for which the places are the same
    gap = np.linalg.inv(T_wc[:again]) @ T_wc[lap:]
    assert np.linalg.norm(gap[:, :3, 3], axis=1).max() < (0.6 if world in STREETS else 0.25)
    turned = np.arccos(np.clip((np.trace(gap[:, :3, :3], axis1=1, axis2=2) - 1) / 2, -1, 1))
    assert np.degrees(turned).max() < 4
    far = np.linalg.norm(T_wc[: lap // 2, :3, 3] - T_wc[0, :3, 3], axis=1).max()
    assert far > 0.1 * length


def test_laps_say_how_often_to_go_around():
    once, thrice = (small(world="corridor", frames=None, laps=laps) for laps in (1, 3))
    assert len(thrice) - 1 == pytest.approx(3 * (len(once) - 1), abs=3)
    assert once.lap_length == pytest.approx(26.2, abs=0.2)
    with pytest.raises(SettingsError, match="frames and laps"):
        small(world="corridor", laps=2.0)
    with pytest.raises(SettingsError, match="laps apply"):
        small(world="street", frames=None, laps=2.0)
    assert small(world="street").lap_length is None


def test_the_drive_around_the_block_is_600_metres_long():
    assert small(world="street-lap").lap_length == pytest.approx(600, abs=0.1)


def test_the_drive_around_the_small_block_is_320_metres_long():
    assert small(world="street-block").lap_length == pytest.approx(320, abs=0.1)


def test_the_street_is_600_metres_long():
    positions = SyntheticSequence(SyntheticOptions(world="street")).ground_truth().positions
    assert np.linalg.norm(positions[-1] - positions[0]) == pytest.approx(600, abs=1.1)


def test_lateral_moves_the_camera_to_its_right():
    for world in ("room", "street"):
        T_wc, aside = (small(world=world, lateral=x).T_wc(1) for x in (0.0, 0.4))
        shift = (np.linalg.inv(T_wc) @ aside)[:3, 3]
        np.testing.assert_allclose(shift, [0.4, 0, 0], atol=0.02)


@pytest.mark.parametrize("world", WORLDS)
def test_no_viewpoint_leaves_the_world(world):
    for side in (-1, 1):
        sequence = SyntheticSequence(
            SyntheticOptions(world=world, size=(64, 64), lateral=side * ROOM_BESIDE[world])
        )
        for i in np.linspace(0, len(sequence) - 1, 25).astype(int):
            depth = sequence.exact_depth(int(i))
            assert depth[depth > 0].min() > 0.05
            if world not in STREETS:
                assert depth.min() > 0


# ---- files ---------------------------------------------------------------------------------------
@pytest.mark.parametrize(("layout", "sensor"), LAYOUTS)
def test_folders_are_read_back_by_the_loaders(tmp_path, layout, sensor):
    sequence = small(sensor=sensor, world="corridor", frames=5, noise=1.0)
    calls = []
    folder = sequence.write(
        tmp_path / "made", layout, progress=lambda done, total: calls.append((done, total))
    )
    assert calls == [(i + 1, 5) for i in range(5)]
    read = open_sequence(folder, sensor)
    assert read.layout == layout
    np.testing.assert_array_equal(read.timestamps, sequence.timestamps)
    truth = read.ground_truth()
    T_up = np.eye(4)
    if layout is not Layout.KITTI:  # whose ground truth has z up
        T_up[:3, :3] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
    np.testing.assert_allclose(truth.T_wc, T_up @ sequence.ground_truth().T_wc, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(truth.timestamps, sequence.timestamps)
    rectified = layout is Layout.EUROC and sensor is Sensor.STEREO
    camera, exact = read.default_settings().camera, sequence.camera
    for name in ("fx", "fy", "cx", "cy", "bf"):
        # Rectification without distortion may still choose a slightly other focal length.
        tolerance = 0.02 if rectified else 1e-6
        assert getattr(camera, name) == pytest.approx(getattr(exact, name), rel=tolerance)
    assert camera.fps == pytest.approx(exact.fps)
    for i in range(5):
        got, made = read.load(i), sequence.load(i)
        assert (got.right is None) == (made.right is None)
        assert (got.depth is None) == (made.depth is None)
        if rectified:
            assert got.image.shape == made.image.shape
            continue
        assert np.array_equal(got.image, made.image)
        if made.right is not None:
            assert np.array_equal(got.right, made.right)
        if made.depth is not None:
            assert np.array_equal(got.depth, made.depth)


def test_a_tum_folder_has_all_the_usual_lists(tmp_path):
    folder = small(sensor="rgbd").write(tmp_path / "made", "tum")
    names = {"rgb.txt", "depth.txt", "associations.txt", "groundtruth.txt", "settings.yaml"}
    assert names <= {path.name for path in folder.iterdir()}
    assert (folder / "depth.txt").read_text().splitlines()[1] == (
        "0.000000000 depth/0.000000000.png"
    )
    assert json.loads((folder / "synthetic.json").read_text())["world"] == "room"
    assert not [path for path in tmp_path.iterdir() if path != folder]


def test_a_folder_with_files_is_left_alone(tmp_path):
    folder = tmp_path / "mine"
    folder.mkdir()
    (folder / "thesis.tex").write_text("text")
    for force in (False, True):
        with pytest.raises(DatasetError, match="mine"):
            small().write(folder, force=force)
    assert [path.name for path in folder.iterdir()] == ["thesis.tex"]
    with pytest.raises(DatasetError, match="not a folder"):
        small().write(folder / "thesis.tex")


def test_force_replaces_a_synthetic_sequence(tmp_path):
    folder = small(frames=4).write(tmp_path / "made")
    with pytest.raises(DatasetError, match="not empty"):
        small().write(folder)
    small(frames=2).write(folder, force=True)
    assert len(list((folder / "image_0").iterdir())) == 2
    assert [path.name for path in tmp_path.iterdir()] == ["made"]


def test_nothing_is_left_behind_when_writing_fails(tmp_path):
    def stop(done: int, total: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        small().write(tmp_path / "made", progress=stop)
    assert not list(tmp_path.iterdir())


# ---- options -------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    "options",
    [
        {"world": "moon"},
        {"sensor": "lidar"},
        {"frames": 0},
        {"fps": 0.0},
        {"fps": float("nan")},
        {"size": (640, 10)},
        {"seed": -1},
        {"noise": -0.1},
        {"exposure": 0.0},
        {"depth_noise": -1.0},
        {"world": "street", "lateral": 4.0},
        {"world": "street-lap", "lateral": -3.1},
        {"world": "corridor", "lateral": -1.0},
        {"world": "corridor", "laps": 0.0},
        {"yaw": 999.0},
        {"world": "room", "speed": 1.0},
        {"world": "lift-door", "speed": 1.0},
        {"world": "corridor", "speed": 1.0, "pace": 2.0},
        {"motion": "dance"},
        {"pace": 0.0},
        {"corners": "square"},
        {"world": "street", "corners": "sharp"},
        {"blur": 1.5},
        {"cover": -1.0},
        {"exposure": (1.0, 0.5)},
        {"exposure": (0.0, 0.5)},
        {"exposure": (1.0,)},
    ],
)
def test_options_out_of_range_are_refused_by_name(options):
    with pytest.raises(SettingsError, match=list(options)[-1]):
        SyntheticOptions(**options)


@pytest.mark.parametrize(("layout", "sensor"), [("tum", "stereo"), ("kitti", "rgbd")])
def test_layouts_without_a_place_for_the_images_are_refused(tmp_path, layout, sensor):
    with pytest.raises(SettingsError, match="no place"):
        small(sensor=sensor).write(tmp_path / "made", layout)
    assert not list(tmp_path.iterdir())


def test_frames_out_of_range_raise():
    for index in (-1, 3):
        with pytest.raises(IndexError):
            small().load(index)


def test_a_street_is_as_long_as_asked_for() -> None:
    usual = SyntheticSequence(SyntheticOptions(world="street"))
    longer = SyntheticSequence(SyntheticOptions(world="street", length=1200))
    assert len(longer) / len(usual) == pytest.approx(2, rel=0.02)
    truth = longer.ground_truth()
    assert truth is not None
    assert np.ptp(truth.T_wc[:, 2, 3]) == pytest.approx(1200, rel=0.02)


def test_only_the_street_has_a_length() -> None:
    with pytest.raises(SettingsError, match="length does not apply to the room"):
        SyntheticOptions(length=100)
    with pytest.raises(SettingsError, match=r"length is 1000000\.0; allowed: 50 to 3500"):
        SyntheticOptions(world="street", length=1e6)

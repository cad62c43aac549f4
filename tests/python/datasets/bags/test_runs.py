# SPDX-License-Identifier: BSD-3-Clause
"""A run on a bag gives the bytes of a run on the folder of the same images."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

import orbslam2py as orb
from orbslam2py.datasets import BagSequence
from orbslam2py.runs import RunOptions
from orbslam2py.slam.options import SystemOptions
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from support import bags

N = 20
SENSORS = ("mono", "stereo", "rgbd")
FILES = ("trajectory.txt", "trajectory_online.txt", "keyframes.txt", "points.ply", "map.npz")


@pytest.fixture(scope="module")
def worlds() -> dict[str, SyntheticSequence]:
    return {
        sensor: SyntheticSequence(
            SyntheticOptions(world="corridor", sensor=sensor, frames=N, size=(320, 240))
        )
        for sensor in SENSORS
    }


@pytest.fixture(scope="module")
def folders(
    worlds: dict[str, SyntheticSequence], tmp_path_factory: pytest.TempPathFactory
) -> dict[str, Path]:
    """The same images as files; depth in millimetres, as bags have it."""
    made = {}
    for sensor, world in worlds.items():
        folder = world.write(tmp_path_factory.mktemp("folders") / sensor)
        for path in folder.glob("depth/*.png"):
            depth = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
            assert cv2.imwrite(str(path), np.rint(depth * 0.2).astype(np.uint16))
        made[sensor] = folder
    return made


def run(sequence: object, output: Path) -> dict[str, bytes]:
    options = RunOptions(sequence.sensor, SystemOptions(deterministic=True))  # type: ignore[attr-defined]
    done = orb.run_sequence(sequence, options, output=output, report_page=False)  # type: ignore[arg-type]
    assert done.report["tracked"] > N // 2
    contents = {name: (output / name).read_bytes() for name in FILES}
    # Times of the steps differ from run to run; all that was found does not.
    header, *rows = (output / "frames.csv").read_text().splitlines()
    n_times = sum(name.startswith("ms_") for name in header.split(","))
    lines = [row.rsplit(",", n_times)[0] for row in rows]
    return contents | {"frames.csv": "\n".join(lines).encode()}


@pytest.mark.parametrize("kind", bags.KINDS)
@pytest.mark.parametrize("sensor", SENSORS)
def test_run_on_a_bag_equals_run_on_files(
    worlds: dict[str, SyntheticSequence],
    folders: dict[str, Path],
    tmp_path: Path,
    sensor: str,
    kind: str,
) -> None:
    bag = BagSequence(worlds[sensor].write(tmp_path / "bag", kind), sensor)
    assert (bag.layout, len(bag)) == (kind, N)
    files = orb.open_sequence(folders[sensor], sensor, settings=bag.settings)
    for i in (0, N - 1):
        images, expected = bag.load(i), files.load(i)
        assert np.array_equal(images.image, expected.image)
        for one, other in ((images.right, expected.right), (images.depth, expected.depth)):
            assert (one is None) == (other is None)
            assert one is None or np.array_equal(one, other)  # type: ignore[arg-type]
    if kind == {"mono": "rosbag1", "stereo": "mcap", "rgbd": "rosbag2"}[sensor]:
        assert run(bag, tmp_path / "a") == run(files, tmp_path / "b")
    else:  # the images are equal, and so are their times
        assert [bag.timestamp_text(i) for i in range(N)] == [
            files.timestamp_text(i) for i in range(N)
        ]


@pytest.mark.parametrize("sensor", SENSORS)
def test_calibration_and_truth(
    worlds: dict[str, SyntheticSequence], tmp_path: Path, sensor: str
) -> None:
    """What is in the bag is what the world knows."""
    world = worlds[sensor]
    bag = BagSequence(world.write(tmp_path / "bag", "mcap"), sensor)
    ours, theirs = bag.settings.camera, world.camera
    for name in ("fx", "fy", "cx", "cy", "width", "height", "fps"):
        assert getattr(ours, name) == getattr(theirs, name), name
    if sensor == "stereo":
        assert ours.bf == theirs.bf
    truth = bag.ground_truth()
    assert truth is not None
    assert np.array_equal(truth.timestamps, world.timestamps)
    moved = np.linalg.inv(truth.T_wc[0]) @ truth.T_wc[-1]
    true = np.linalg.inv(world.T_wc(0)) @ world.T_wc(N - 1)
    assert np.allclose(moved, true, atol=1e-12)

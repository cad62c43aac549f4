# SPDX-License-Identifier: BSD-3-Clause
"""A map that begins in a fast car: its second frame shows little of what the first one showed."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from orbslam2py import Sensor, System, TrackingRecord
from orbslam2py.slam.config import Config
from orbslam2py.slam.records import PoseMethod
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from orbslam2py.trajectory.rotations import inverse_poses

_IMAGES = 16


@pytest.fixture(scope="module")
def sequence() -> SyntheticSequence:
    """Two metres from image to image, seen 13 m far."""
    options = SyntheticOptions(
        world="street",
        sensor=Sensor.RGBD,
        frames=_IMAGES,
        size=(620, 188),
        pace=2.0,
        seed=8,
        noise=1.5,
        depth_noise=0.002,
    )
    return SyntheticSequence(options)


@pytest.fixture(scope="module")
def driven(sequence: SyntheticSequence) -> list[TrackingRecord]:
    settings = sequence.default_settings()
    few = dataclasses.replace(settings.orb, n_features=400)
    records = []
    with System(dataclasses.replace(settings, orb=few), "rgbd", deterministic=True) as slam:
        for i, timestamp in enumerate(sequence.timestamps):
            images = sequence.load(i)
            assert images.depth is not None
            records.append(slam.track_rgbd(images.image, images.depth, float(timestamp)))
    return records


def test_one_map_holds_every_image(driven: list[TrackingRecord]) -> None:
    assert [record.frame_id for record in driven if record.T_cw is None] == []
    assert {record.map_index for record in driven} == {driven[0].map_index}


def test_the_second_image_is_found_by_all_keypoints(driven: list[TrackingRecord]) -> None:
    evidence = driven[1].evidence
    assert evidence is not None
    assert evidence.method is PoseMethod.ALL_KEYPOINTS


def test_its_poses_are_right(sequence: SyntheticSequence, driven: list[TrackingRecord]) -> None:
    T_wc = inverse_poses(np.stack([record.T_cw for record in driven if record.T_cw is not None]))
    truth = sequence.ground_truth().T_wc
    true = np.linalg.inv(truth[0]) @ truth
    off = np.linalg.norm(T_wc[:, :3, 3] - true[:, :3, 3], axis=1)
    assert off.max() < 0.03 * np.linalg.norm(true[-1, :3, 3])


@pytest.mark.parametrize(
    ("n_features", "inliers", "after"),
    [(4000, 30, 50), (1000, 30, 50), (800, 24, 40), (100, 18, 30)],
)
def test_of_few_features_fewer_inliers_are_asked_for(
    n_features: int, inliers: int, after: int
) -> None:
    config = Config().for_features(n_features)
    assert config.tracking.local_map_inliers == inliers
    assert config.tracking.map_matches == Config().tracking.map_matches
    again = config.relocalization
    assert (again.narrow, again.enough) == (inliers, after)

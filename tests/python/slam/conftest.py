# SPDX-License-Identifier: BSD-3-Clause
"""Systems and parts of them, ready for a test."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from orbslam2py import Sensor, System
from orbslam2py._worker import Worker
from orbslam2py.slam import keyframe_decision, tracking
from orbslam2py.slam.acceptance import multi_hypothesis_search, pose_validator
from orbslam2py.slam.config import AcceptanceConfig, TrackingConfig
from orbslam2py.slam.pose_search import first_estimate, local_map_search, search
from orbslam2py.slam.state import motion
from support.interleaving import LIMIT, Stage
from support.small_sequences import new_system, play
from support.tracking_scene import FakeCore, Scene
from support.worker_steps import NAME, Gate


@pytest.fixture(params=[Sensor.STEREO, Sensor.RGBD])
def sensor(request: pytest.FixtureRequest) -> Sensor:
    """Every sensor that knows depth."""
    return Sensor(request.param)


# ---- systems -------------------------------------------------------------------------------------
@pytest.fixture
def slam() -> Iterator[System]:
    """A system with a small map whose workers have nothing to do."""
    system = new_system(Sensor.RGBD, wait_for_mapping=True)
    play(system, 30)
    assert system.wait_until_idle(LIMIT)
    assert system.n_keyframes >= 3
    yield system
    system.shutdown(drain=False, timeout=LIMIT)


@pytest.fixture
def stage(monkeypatch: pytest.MonkeyPatch) -> Iterator[Stage]:
    stage = Stage(monkeypatch)
    yield stage
    stage.open_all()


# ---- a tracker -----------------------------------------------------------------------------------
@pytest.fixture
def core(monkeypatch: pytest.MonkeyPatch) -> FakeCore:
    """Stands in for the verbs that tracking calls."""
    core = FakeCore()
    for module in (
        *(tracking, keyframe_decision),
        *(first_estimate, motion, search, local_map_search),
        *(multi_hypothesis_search, pose_validator),
    ):
        monkeypatch.setattr(module, "core", core)
    return core


@pytest.fixture
def single(core: FakeCore) -> Scene:
    """One camera whose map begins with image 0."""
    scene = Scene(Sensor.MONOCULAR, core)
    scene.run(2)
    return scene


@pytest.fixture
def scene(core: FakeCore, sensor: Sensor) -> Scene:
    """A tracker among fakes."""
    return Scene(sensor, core)


# ---- a worker ------------------------------------------------------------------------------------
@pytest.fixture
def gate() -> Gate:
    """The step of `worker`."""
    return Gate()


@pytest.fixture
def worker(gate: Gate) -> Iterator[Worker[int]]:
    worker = Worker(NAME, gate, threaded=True)
    worker.start()
    yield worker
    gate.open()
    worker.finish(timeout=10)


@pytest.fixture
def careful(core: FakeCore, sensor: Sensor) -> Scene:
    """A tracker that weighs its poses, used to 100 inliers; refuses fewer than 30."""
    scene = Scene(sensor, core, TrackingConfig(local_map_inliers=10), evidence=AcceptanceConfig())
    scene.run(40)  # until the first second, with its own limit of inliers, is over
    core.calls.clear()
    return scene

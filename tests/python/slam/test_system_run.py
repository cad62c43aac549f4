# SPDX-License-Identifier: BSD-3-Clause
"""`System.run`: a whole sequence in one call."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from types import SimpleNamespace

import numpy as np
import pytest

from orbslam2py import ImageError, Sensor, StateError, System, TrackingState
from orbslam2py.datasets import Frame, Images
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from support.small_sequences import SIZE, new_system, play, sequence

pytestmark = pytest.mark.watchdog(30)

N = 12


class Recording:
    """Has what counts, but is not iterable."""

    def __init__(self, sensor: Sensor) -> None:
        self._inner = sequence(sensor)
        self.timestamps = self._inner.timestamps[:N]

    def load(self, index: int) -> Images:
        return self._inner.load(index)


def test_run_is_a_loop_of_track_calls(sensor: Sensor) -> None:
    with new_system(sensor, deterministic=True) as system:
        records = system.run(islice(sequence(sensor), N))
    with new_system(sensor, deterministic=True) as other:
        expected = play(other, N)
    assert [r.state for r in records] == [TrackingState.OK] * N
    assert [r.timestamp for r in records] == [r.timestamp for r in expected]
    np.testing.assert_array_equal(system.trajectory().T_wc, other.trajectory().T_wc)
    assert system.map_hash() == other.map_hash()


def test_run_of_a_class_of_ones_own(sensor: Sensor) -> None:
    with new_system(sensor, wait_for_mapping=True) as system:
        assert len(system.run(Recording(sensor))) == N
        assert len(system.trajectory()) == N


def test_images_need_only_have_what_the_sensor_needs(sensor: Sensor) -> None:
    second = "right" if sensor is Sensor.STEREO else "depth"

    def frames() -> Iterator[SimpleNamespace]:
        for frame in islice(sequence(sensor), 3):
            given = {name: getattr(frame.images, name) for name in ("image", "mask", second)}
            yield SimpleNamespace(timestamp=frame.timestamp, images=SimpleNamespace(**given))

    with new_system(sensor, deterministic=True) as system:
        records = system.run(frames())  # type: ignore[arg-type]
        assert [record.state for record in records] == [TrackingState.OK] * 3
        mono = SimpleNamespace(image=sequence(sensor).load(3).image, mask=None)
        with pytest.raises(ImageError, match=f"has no {second} image"):
            system.run([SimpleNamespace(timestamp=9.0, images=mono)])  # type: ignore[list-item]


def test_run_of_a_single_camera() -> None:
    options = SyntheticOptions(world="corridor", sensor="mono", frames=3, size=SIZE)
    walk = SyntheticSequence(options)
    with System(walk.settings, "mono", wait_for_mapping=True) as system:
        records = system.run(walk, details=True)
    assert len(records) == 3
    assert all(record.features is not None for record in records)


def test_run_uses_masks(sensor: Sensor) -> None:
    nothing = np.zeros(SIZE[::-1], np.uint8)

    def masked() -> Iterator[Frame]:
        for frame in islice(sequence(sensor), 2):
            yield replace(frame, images=replace(frame.images, mask=nothing))

    with new_system(sensor, deterministic=True) as system:
        assert [r.T_wc for r in system.run(masked())] == [None, None]


def test_run_of_another_sensors_sequence() -> None:
    with new_system(Sensor.STEREO, deterministic=True) as system:
        with pytest.raises(StateError, match=r"for sensor 'rgbd', but .* 'stereo'; open it with"):
            system.run(sequence(Sensor.RGBD))
        with pytest.raises(ImageError, match=r"frame of 0\.000000 s has no right image"):
            system.run(islice(sequence(Sensor.RGBD), 2))
        assert len(system.run(islice(sequence(Sensor.STEREO), 2))) == 2
    rgbd = new_system(Sensor.RGBD, deterministic=True)
    with rgbd, pytest.raises(ImageError, match="no depth image"):
        rgbd.run(islice(sequence(Sensor.STEREO), 2))

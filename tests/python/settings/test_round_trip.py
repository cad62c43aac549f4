# SPDX-License-Identifier: BSD-3-Clause
"""Any settings survive a file; any text is read or refused."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from orbslam2py import SettingsError
from orbslam2py.settings import (
    CameraRectification,
    CameraSettings,
    DepthSettings,
    OrbSettings,
    Sensor,
    Settings,
    StereoRectification,
    ViewerSettings,
)
from orbslam2py.settings.sensor import WITHOUT_RIG


def number(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high, allow_nan=False, allow_subnormal=False)


CAMERAS = st.builds(
    CameraSettings,
    *(number(1e-3, 1e5), number(1e-3, 1e5), number(-1e5, 1e5), number(-1e5, 1e5)),
    *[number(-1e4, 1e4)] * 5,
    width=st.none() | st.integers(1, 65535),
    height=st.none() | st.integers(1, 65535),
    fps=number(1e-3, 1e5),
    bf=number(1e-3, 1e6),
    rgb=st.booleans(),
    k4=st.just(0.0) | number(-1e4, 1e4),
    k5=st.just(0.0) | number(-1e4, 1e4),
    k6=st.just(0.0) | number(-1e4, 1e4),
)

ORBS = st.integers(1, 254).flatmap(
    lambda first: st.builds(
        OrbSettings,
        st.integers(1, 10**6),
        number(1.01, 2.0),
        st.integers(1, 16),
        st.just(first),
        st.integers(1, first),
    )
)

MATRICES = st.lists(number(-1e4, 1e4), min_size=12, max_size=12)


def _with_focal_lengths(matrix: np.ndarray) -> np.ndarray:
    """Any matrix, but of a camera that looks forward."""
    for i in range(2):
        matrix[i, i] = abs(matrix[i, i]) + 1.0
    return matrix


@st.composite
def rectified_cameras(draw: st.DrawFn) -> CameraRectification:
    R, _ = cv2.Rodrigues(np.array(draw(st.lists(number(-3, 3), min_size=3, max_size=3))))
    return CameraRectification(
        K=_with_focal_lengths(np.array(draw(MATRICES)[:9]).reshape(3, 3)),
        D=np.array(draw(MATRICES)[: draw(st.sampled_from([4, 5, 8]))]),
        R=np.asarray(R, dtype=np.float64),
        P=_with_focal_lengths(np.array(draw(MATRICES)).reshape(3, 4)),
        width=draw(st.integers(1, 65535)),
        height=draw(st.integers(1, 65535)),
    )


@st.composite
def any_settings(draw: st.DrawFn) -> Settings:
    sensor = draw(st.sampled_from(WITHOUT_RIG))
    camera = draw(CAMERAS)
    factor = draw(number(1e-5, 1e9)) if sensor is Sensor.RGBD else None
    rectified = sensor is Sensor.STEREO and draw(st.booleans())
    return Settings(
        sensor=sensor,
        camera=camera if sensor.has_depth else dataclasses.replace(camera, bf=0.0),
        orb=draw(ORBS),
        depth=DepthSettings(draw(number(1e-3, 1e6)), factor) if sensor.has_depth else None,
        rectification=StereoRectification(draw(rectified_cameras()), draw(rectified_cameras()))
        if rectified
        else None,
        viewer=draw(
            st.builds(
                ViewerSettings,
                *[number(1e-3, 1e6)] * 6,
                *[number(-1e6, 1e6)] * 3,
                number(1e-3, 1e6),
            )
        ),
    )


@given(settings=any_settings())
@hypothesis_settings(
    max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
def test_round_trip(tmp_path: Path, settings: Settings) -> None:
    path = tmp_path / "a.yaml"
    settings.save(path)
    read = Settings.load(path, settings.sensor)
    assert read == settings
    assert hash(read) == hash(settings)
    # OpenCV's reader, used by other programs, sees the same numbers.
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    assert storage.getNode("Camera.fx").real() == settings.camera.fx
    assert storage.getNode("Camera.p1").real() == settings.camera.p1
    assert storage.getNode("ORBextractor.nFeatures").real() == settings.orb.n_features
    if settings.rectification is not None:
        np.testing.assert_array_equal(
            storage.getNode("LEFT.P").mat(), settings.rectification.left.P
        )


@given(text=st.text(alphabet="Camera.fx:[]!- #\n\t123eD,\"'%", max_size=200))
@hypothesis_settings(
    max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
def test_any_text_is_read_or_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "a.yaml"
    path.write_text(text)
    with pytest.raises(SettingsError):
        Settings.load(path, Sensor.MONOCULAR)

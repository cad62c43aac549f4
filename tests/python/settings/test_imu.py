# SPDX-License-Identifier: BSD-3-Clause
"""Settings of an IMU: files of other programs, presets, doubts, refusals."""

import json
import logging
from dataclasses import replace

import numpy as np
import pytest

from orbslam2py import SettingsError
from orbslam2py.settings import (
    ImuSettings,
    Sensor,
    Settings,
    builtin_settings,
    imu_noise,
    read_imu_settings,
)

# From the camera to the IMU: the camera looks along x of the IMU, 5 cm ahead of it.
T_BC = np.array([[0, 0, 1, 0.05], [-1, 0, 0, 0.02], [0, -1, 0, 0.01], [0, 0, 0, 1.0]])
T_CI = np.linalg.inv(T_BC)
FAR = np.array([[0, 0, 0, 50]] * 3 + [[0] * 4])
NOISE = {"gyro_noise": 1e-3, "accel_noise": 2e-2, "gyro_walk": 1e-5, "accel_walk": 1e-3}


def matrix(key, T):
    data = ", ".join(f"{value:.8f}" for value in np.ravel(T))
    return f"{key}: !!opencv-matrix\n   rows: 4\n   cols: 4\n   dt: f\n   data: [{data}]\n"


def euroc(kind, T):
    data = ", ".join(f"{value:.8f}" for value in np.ravel(T))
    return f"%YAML:1.0\nsensor_type: {kind}\nT_BS:\n  cols: 4\n  rows: 4\n  data: [{data}]\n"


ORB = """%YAML:1.0
IMU.NoiseGyro: 1e-3 # rad/s^0.5
IMU.NoiseAcc: 2e-2
IMU.GyroWalk: 1e-5
IMU.AccWalk: 1e-3
IMU.Frequency: 200.0
"""
DENSITIES = """gyroscope_noise_density: 1e-3
gyroscope_random_walk: 1.0e-05
accelerometer_noise_density: 2.0e-02
accelerometer_random_walk: 1.0e-3
"""
FILES = {
    "orb-slam3": {"a.yaml": ORB + matrix("IMU.T_b_c1", T_BC)},
    "orb-slam3, old": {"a.yaml": ORB + matrix("Tbc", T_BC)},
    "kalibr": {
        "imu.yaml": f"rostopic: /imu0\nupdate_rate: 200.0\n{DENSITIES}",
        "camchain.yaml": "cam0:\n  timeshift_cam_imu: 0.0\n  T_cam_imu: "
        + json.dumps(T_CI.tolist())
        + "\n",
    },
    "euroc": {
        "imu0.yaml": euroc("imu", np.eye(4)) + "rate_hz: 200\n" + DENSITIES,
        "cam0.yaml": euroc("camera", T_BC),
    },
    "basalt": {
        "a.json": json.dumps(
            {
                "value0": {
                    "T_imu_cam": [
                        {"px": 0.05, "py": 0.02, "pz": 0.01}
                        | dict(zip(("qx", "qy", "qz", "qw"), (-0.5, 0.5, -0.5, 0.5), strict=True))
                    ],
                    "gyro_noise_std": [1e-3, 5e-4, 1e-3],
                    "accel_noise_std": [2e-2] * 3,
                    "gyro_bias_std": [1e-5] * 3,
                    "accel_bias_std": [1e-3] * 3,
                    "imu_update_rate": 200,
                    "cam_time_offset_ns": 0,
                }
            }
        )
    },
}


def written(folder, files):
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
    return [folder / name for name in files]


@pytest.mark.parametrize("kind", FILES)
def test_all_formats_tell_the_same(tmp_path, kind):
    settings = read_imu_settings(*written(tmp_path, FILES[kind]))
    assert settings.T_ci == pytest.approx(T_CI, abs=1e-6)
    assert {name: getattr(settings, name) for name in NOISE} == pytest.approx(NOISE)
    assert (settings.rate, settings.time_offset) == (200.0, 0.0)


def test_the_offset_of_kalibr(tmp_path):
    files = dict(FILES["kalibr"])
    files["camchain.yaml"] = files["camchain.yaml"].replace("imu: 0.0", "imu: -0.0125")
    assert read_imu_settings(*written(tmp_path, files)).time_offset == -0.0125


@pytest.mark.parametrize("rate", [None, 200.0])
def test_saved_settings_are_read_back(tmp_path, rate):
    saved = ImuSettings(**NOISE, T_ci=T_CI, time_offset=-0.0125, rate=rate)
    saved.save(tmp_path / "imu.yaml")
    read = read_imu_settings(tmp_path / "imu.yaml")
    np.testing.assert_allclose(read.T_ci, T_CI, atol=1e-15)
    assert replace(read, T_ci=saved.T_ci) == saved


def test_a_preset_fills_in_the_noise(tmp_path):
    camchain = {"camchain.yaml": FILES["kalibr"]["camchain.yaml"]}
    paths = written(tmp_path, camchain)
    with pytest.raises(SettingsError, match=r"gyro_noise.*missing.*--imu-noise"):
        read_imu_settings(*paths)
    settings = read_imu_settings(*paths, noise=imu_noise("BMI-088"))
    assert settings.gyro_noise == pytest.approx(np.radians(0.014))
    assert settings.accel_noise == pytest.approx(175e-6 * 9.80665)
    with pytest.raises(SettingsError, match="'bmi99'; there are adis16448"):
        imu_noise("bmi99")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda T: 2 * T, "IMU.T_b_c1 does not end with the row 0 0 0 1"),
        (lambda T: T * [[1, 1, 1, 1]] * [[1.1], [1], [1], [1]], "IMU.T_b_c1 is no rigid transform"),
        (lambda T: T * [[1], [-1], [1], [1]], "IMU.T_b_c1 is a reflection"),
        (lambda T: T.T, "IMU.T_b_c1 does not end with the row 0 0 0 1"),
    ],
)
def test_wrong_matrices_are_named(tmp_path, change, message):
    paths = written(tmp_path, {"a.yaml": ORB + matrix("IMU.T_b_c1", change(T_BC))})
    with pytest.raises(SettingsError, match=rf"a\.yaml:7: {message}"):
        read_imu_settings(*paths)


@pytest.mark.parametrize(
    ("files", "message"),
    [
        ({"a.yaml": ORB}, "no key gives the pose of the IMU"),
        ({"a.yaml": "Camera.fx: 500\n"}, "contains nothing about an IMU"),
        ({"a.json": '{"value0": {}}'}, "no calibration of Basalt"),
        (
            {"a.yaml": ORB.replace("1e-3 #", "-1e-3 #") + matrix("Tbc", T_BC)},
            "gyro_noise is -0.001",
        ),
        (
            {"a.yaml": ORB.replace("2e-2", "many") + matrix("Tbc", T_BC)},
            "IMU.NoiseAcc 'many' is not",
        ),
        (
            {"a.yaml": FILES["orb-slam3"]["a.yaml"], "b.yaml": ORB.replace("1e-3", "2e-3")},
            r"IMU.NoiseGyro and .*IMU.NoiseGyro differ; give only one",
        ),
    ],
)
def test_wrong_files(tmp_path, files, message):
    with pytest.raises(SettingsError, match=message):
        read_imu_settings(*written(tmp_path, files))


@pytest.mark.parametrize(
    ("values", "doubt"),
    [
        ({"gyro_noise": 0.05}, "in degrees, multiply it by 0.01745"),
        ({"accel_noise": 1e-4}, "in g, multiply it by 9.81"),
        ({"accel_noise": 175.0}, "in micro-g, multiply it by 9.81e-6"),
        ({"time_offset": 12.5}, "milliseconds, divide by 1000"),
        ({"T_ci": np.linalg.inv(T_BC + FAR)}, "millimetres, divide"),
    ],
)
def test_doubts(values, doubt):
    found = ImuSettings(**(NOISE | {"T_ci": T_CI} | values)).doubts()
    assert len(found) == 1
    assert doubt in found[0]


def test_doubts_of_a_file_name_its_key(tmp_path, caplog):
    text = ORB.replace("1e-3 #", "0.2 #") + matrix("Tbc", T_BC)
    with caplog.at_level(logging.WARNING):
        read_imu_settings(*written(tmp_path, {"a.yaml": text}))
    assert "a.yaml:2: IMU.NoiseGyro: gyro_noise is 0.2" in caplog.text


def test_the_camera_of_such_a_file_is_read_as_before(tmp_path):
    camera = builtin_settings("tum1", Sensor.MONOCULAR).to_yaml()
    text = camera + ORB.removeprefix("%YAML:1.0\n") + matrix("IMU.T_b_c1", T_BC)
    assert Settings.from_yaml(text, Sensor.MONOCULAR) == builtin_settings("tum1", Sensor.MONOCULAR)


def test_a_rectified_camera():
    R = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    turned = ImuSettings(**NOISE, T_ci=T_CI).seen_by(R)
    assert turned.T_ci[:3, :3] == pytest.approx(R @ T_CI[:3, :3])
    assert turned.T_ci[:3, 3] == pytest.approx(R @ T_CI[:3, 3])

# SPDX-License-Identifier: BSD-3-Clause
"""The check of an IMU against the path of the camera, with every fault made on purpose."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from orbslam2py.datasets import ImuSamples, open_sequence
from orbslam2py.inertial.check import check_imu, draw_imu_check
from orbslam2py.inertial.check.streams import saturated
from orbslam2py.settings import ImuSettings, imu_noise, read_imu_settings
from orbslam2py.synthetic.imu import T_CI
from orbslam2py.synthetic.spline import PoseSpline
from orbslam2py.trajectory import Trajectory, read_tum
from orbslam2py.trajectory.rotations import inverse_poses

NOISE = imu_noise("bmi088")
START = 1000.0  # seconds
GRAVITY = np.array([0.0, 9.81, 0.0])
SETTINGS = ImuSettings(
    NOISE.gyro_noise, NOISE.accel_noise, NOISE.gyro_walk, NOISE.accel_walk, T_ci=T_CI
)


def made_up(seed=0, seconds=12.0, swing=1.0, scale=0.3):
    """Poses of a camera by hand, 20 a second with the errors of vision, and samples."""
    random = np.random.default_rng(seed)
    t = START + np.arange(0, seconds, 0.05)
    frequencies, phases = random.uniform(0.1, 0.6, (2, 3, 3)), random.uniform(0, 6, (2, 3, 3))
    sines = [
        np.sin(2 * np.pi * t[:, None, None] * f + p).sum(axis=1)
        for f, p in zip(frequencies, phases, strict=True)
    ]
    T_wc = np.tile(np.eye(4), (len(t), 1, 1))
    for T, turn, place in zip(T_wc, *sines, strict=True):
        T[:3, :3] = cv2.Rodrigues(0.2 * swing * turn)[0]
        T[:3, 3] = 0.15 * swing * place
    path = PoseSpline(t, T_wc @ T_CI)
    at = np.arange(START, t[-1], 0.005)
    R = path.poses(at)[:, :3, :3]
    force = np.einsum("nji,nj->ni", R, path.accelerations(at) - GRAVITY)
    readings = np.hstack([path.rates(at), force])
    readings += [0.01, -0.02, 0.015, 0.05, -0.1, 0.08]
    white = np.repeat([NOISE.gyro_noise, NOISE.accel_noise], 3) * np.sqrt(200)
    readings += white * random.standard_normal(readings.shape)
    seen = T_wc.copy()
    for T in seen:
        T[:3, :3] = T[:3, :3] @ cv2.Rodrigues(random.normal(0, 5e-4, 3))[0]
        T[:3, 3] = scale * (T[:3, 3] + random.normal(0, 2e-3, 3))
    return np.column_stack([at, readings]), Trajectory(t, seen)


def report_of(data, path, settings=SETTINGS):
    return check_imu(ImuSamples("made up", data), [path], settings)


@pytest.fixture(scope="module")
def recording():
    return made_up()


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("settings", [SETTINGS, None], ids=["settings", "none"])
def test_what_is_right_fits(seed, settings):
    report = report_of(*made_up(seed), settings)
    assert report.faults == []
    assert report.open_questions == []
    assert report.rates.offset == pytest.approx(0, abs=1e-3)
    assert pytest.approx(T_CI[:3, :3], abs=0.01) == report.rates.R
    assert report.rates.bias == pytest.approx([0.01, -0.02, 0.015], abs=2e-3)
    assert report.gravity.magnitude == pytest.approx(9.81, rel=0.02)
    assert report.gravity.scale == pytest.approx(1 / 0.3, rel=0.03)


def turned_extrinsics(data):
    T = T_CI.copy()
    T[:3, :3] = T[:3, :3] @ cv2.Rodrigues(np.array([0.2, -0.2, 0.2]))[0]
    return data, replace(SETTINGS, T_ci=T)


def columns(*order, signs=(1, 1, 1, 1, 1, 1)):
    def change(data):
        data[:, 1:] = data[:, 1:][:, order] * signs
        return data, SETTINGS

    return change


def scaled(gyro=1.0, accel=1.0):
    return columns(*range(6), signs=(*[gyro] * 3, *[accel] * 3))


def shifted(seconds):
    def change(data):
        data[:, 0] += seconds
        return data, SETTINGS

    return change


def clipped(column, limit):
    def change(data):
        data[:, column] = np.clip(data[:, column], -limit, limit)
        return data, SETTINGS

    return change


def set_to(column, value):
    def change(data):
        data[:, column] = value
        return data, SETTINGS

    return change


def of_another_recording(data):
    data[:, 1:] = made_up(99)[0][: len(data), 1:]
    return data, SETTINGS


FAULTS = {
    "degrees": (scaled(gyro=180 / np.pi), "degrees", "multiply by 0.0174533"),
    "g": (scaled(accel=1 / 9.81), "g", "multiply by 9.81"),
    "milli-g": (scaled(accel=1000 / 9.81), "scale", "a factor of 0.009"),
    "half gyro": (scaled(gyro=0.5), "scale", "0.5"),
    "late": (shifted(0.03), "time_offset", "differ by +3"),
    "early": (shifted(-0.21), "time_offset", "differ by -2"),
    "a little late": (shifted(0.008), "time_offset", "set the time offset"),
    "no common time": (shifted(1e6), "time_offset", "no time in common"),
    "swapped": (columns(3, 4, 5, 0, 1, 2), "swapped", "exchange the columns"),
    "inverse": (
        lambda data: (data, replace(SETTINGS, T_ci=inverse_poses(T_CI))),
        "inverse",
        "invert the whole matrix",
    ),
    "turned": (turned_extrinsics, "rotation", "20 degrees off"),
    "both exchanged": (columns(1, 2, 0, 4, 5, 3), None, "x = z, y = x, z = y"),
    "gyro exchanged": (columns(1, 0, 2, 3, 4, 5), "axes", "of the gyro are"),
    "gyro z": (columns(*range(6), signs=(1, 1, -1, 1, 1, 1)), "axes", "x = x, y = y, z = -z"),
    "gyro": (scaled(gyro=-1), "axes", "x = -x, y = -y, z = -z"),
    "accelerometer": (scaled(accel=-1), "sign", "multiply its columns by -1"),
    "accelerometer z": (
        columns(*range(6), signs=(1, 1, 1, 1, 1, -1)),
        "axes",
        "of the accelerometer are",
    ),
    "accelerometer exchanged": (columns(0, 1, 2, 5, 4, 3), "axes", "x = z, y = y, z = x"),
    "dead gyro": (set_to(2, 0.0), "dead", "axis y of the gyro"),
    "dead accelerometer": (set_to(6, 9.81), "dead", "axis z of the accelerometer"),
    "clipped gyro": (clipped(1, 0.6), "saturated", "axis x of the gyro is saturated at 0.6"),
    "clipped accelerometer": (clipped(6, 10.5), "saturated", "axis z of the accelerometer"),
    "other recording": (of_another_recording, "unrelated", "stabilised"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_each_fault_is_found(recording, name):
    data, path = recording
    change, kind, text = FAULTS[name]
    changed, settings = change(data.copy())
    report = report_of(changed, path, settings)
    assert not report.fits
    if kind is not None:
        assert kind in [fault.kind for fault in report.faults]
    assert any(text in fault.text for fault in report.faults), report.faults


def test_the_settings_know_the_offset(recording):
    data, path = recording
    data = data.copy()
    data[:, 0] += 0.7
    assert report_of(data, path, replace(SETTINGS, time_offset=0.7)).fits


def test_at_rest_nothing_is_blamed():
    report = report_of(*made_up(swing=0.0))
    assert report.fits
    assert "turns too little" in report.open_questions[0]


def test_without_a_path_the_samples_alone_are_checked(recording):
    report = check_imu(ImuSamples("made up", recording[0]), [], SETTINGS)
    assert report.fits
    assert "was not tracked" in report.open_questions[0]


def test_several_maps_and_lost_frames(recording):
    data, path = recording
    lost = np.zeros(len(path), dtype=bool)
    lost[100:110] = True
    first = Trajectory(path.timestamps[:150], path.T_wc[:150], lost[:150])
    T = np.eye(4)
    T[:3, :3] = cv2.Rodrigues(np.array([0.5, 1.0, -2.0]))[0]
    second = Trajectory(path.timestamps[150:], T @ path.T_wc[150:])
    report = check_imu(ImuSamples("made up", data), [first, second], SETTINGS)
    assert report.fits
    assert report.open_questions == []


def test_a_coarse_reading_at_rest_is_not_saturated():
    random = np.random.default_rng(1)
    coarse = np.round(random.normal(0, 0.6, 20000)) * 1e-3 + 0.05
    assert not saturated(coarse).any()
    wave = np.sin(np.arange(4000) * 0.01)
    assert not saturated(np.round(wave, 3)).any()
    assert saturated(np.clip(np.sin(np.arange(4000) * 0.05), -0.8, 0.8)).sum() > 1000


def shaken(data):
    """The same samples, shaken five times a second with 20 m/s^2."""
    changed = data.copy()
    seconds = data[:, :1] - data[0, 0]
    changed[:, 4:] += 20 * np.sin(2 * np.pi * (5 * seconds + [0.0, 0.3, 0.6]))
    return changed


@pytest.mark.parametrize(
    ("kind", "order", "factor"),
    [("g", [0, 1, 2, 3, 4, 5], 1 / 9.81), ("swapped", [3, 4, 5, 0, 1, 2], 1.0)],
)
def test_shaking_does_not_hide_gravity(recording, kind, order, factor):
    data, _ = recording
    changed = shaken(data)
    changed[:, 4:] *= factor
    changed[:, 1:] = changed[:, 1:][:, order]
    lost = Trajectory([START, START + 1], np.stack([np.eye(4)] * 2), np.array([True, True]))
    assert [fault.kind for fault in report_of(changed, lost).faults] == [kind]
    assert report_of(shaken(data), lost).faults == []


def test_a_saturated_gyro_is_not_called_turned(recording):
    data, path = recording
    changed = data.copy()
    limit = np.quantile(np.abs(data[:, 3]), 0.7)
    changed[:, 3] = np.clip(data[:, 3], -limit, limit)
    assert [fault.kind for fault in report_of(changed, path).faults] == ["saturated"]


@pytest.mark.parametrize("seed", range(3))
def test_small_motion_tells_the_sign(seed):
    """Millimetres suffice if the path is as exact."""
    data, path = made_up(seed, seconds=6.0)
    for sign, faults in ((1, []), (-1, ["sign"])):
        changed = data.copy()
        changed[:, 4:] *= sign
        report = report_of(changed, path)
        assert [fault.kind for fault in report.faults] == faults
        assert report.gravity.knows_sign == (sign > 0)
        assert report.gravity.is_negated == (sign < 0)


def test_a_scene_that_turns_is_no_fault_of_a_gyro_at_rest():
    data, _ = made_up(swing=0.0)
    _, path = made_up()
    report = report_of(data, path)
    assert report.faults == []
    assert any("the scene moves" in one for one in report.open_questions)


def test_a_scene_that_falls_is_no_fault_of_the_accelerometer(recording):
    data, path = recording
    T_wc = path.T_wc.copy()
    T_wc[:, 1, 3] -= 0.3 * 0.5 * 2.0 * (path.timestamps - START) ** 2
    report = report_of(data, Trajectory(path.timestamps, T_wc))
    assert report.faults == []
    assert any("the path may be wrong" in one for one in report.open_questions)


def test_the_picture(tmp_path, recording):
    data, path = recording
    report = report_of(data, path)
    draw_imu_check(tmp_path / "a.png", report, ImuSamples("made up", data), title="$a$ made up")
    picture = cv2.imread(str(tmp_path / "a.png"))
    assert picture.shape[:2] == (900, 1000)
    assert picture.std() > 10


@pytest.mark.shared
def test_the_true_path_of_euroc(shared_data):
    folder = shared_data / "sequences" / "euroc_MH_01_first170"
    samples = open_sequence(folder, "mono").imu()
    settings = read_imu_settings(folder)
    path = read_tum(folder / "groundtruth_leftcam.txt")
    report = check_imu(samples, [path], settings)
    assert report.fits
    assert report.gravity.magnitude == pytest.approx(9.81, abs=0.1)
    assert report.gravity.scale == pytest.approx(1.0, abs=0.02)

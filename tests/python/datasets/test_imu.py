# SPDX-License-Identifier: BSD-3-Clause
"""Samples of an IMU: tables, EuRoC, two streams, and what is wrong with them."""

import logging

import numpy as np
import pytest

from orbslam2py import DatasetError
from orbslam2py.datasets import imu_of, open_sequence, read_imu_csv, read_imu_streams
from orbslam2py.datasets.imu import joined_streams
from orbslam2py.datasets.imu_csv import read_stream
from orbslam2py.datasets.layouts.kitti_raw_poses import read_oxts_imu

EUROC = (
    "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
    "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]"
)


def written(path, lines):
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def rows(times, readings="0.1,0.2,0.3,1,2,9.8"):
    return [f"{time},{readings}" for time in times]


def test_the_table_of_euroc(tmp_path):
    start = 1403636583763555584
    times = [start + 5_000_000 * k for k in range(4)]
    samples = read_imu_csv(written(tmp_path / "data.csv", [EUROC, *rows(times)]))
    assert samples.timestamps == pytest.approx(np.array(times) / 1e9, abs=1e-6)
    assert samples.rate == pytest.approx(200, rel=1e-3)
    assert samples.gyro[1].tolist() == [0.1, 0.2, 0.3]
    assert samples.accel[3].tolist() == [1.0, 2.0, 9.8]
    assert samples.doubts == ()
    assert not samples.data.flags.writeable


@pytest.mark.parametrize(
    ("header", "step", "gyro", "accel"),
    [
        ("timestamp,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z", 0.01, 1.0, 1.0),
        ("time [ms];gx (deg/s);gy (deg/s);gz (deg/s);ax (g);ay (g);az (g)", 10, 0.0174533, 9.80665),
        ("t\taccX\taccY\taccZ\tgyroX\tgyroY\tgyroZ", 10_000, 1.0, 1.0),
        (
            "seconds_elapsed,rotation_rate_x,rotation_rate_y,rotation_rate_z,ax,ay,az",
            0.01,
            1.0,
            1.0,
        ),
    ],
)
def test_headers_of_phones(tmp_path, header, step, gyro, accel):
    separator = next(one for one in ",;\t" if one in header)
    swapped = header.startswith("t\tacc")
    first, second = ("4,5,6", "1,2,3") if swapped else ("1,2,3", "4,5,6")
    lines = [f"{step * k:.3f},{first},{second}".replace(",", separator) for k in range(5)]
    samples = read_imu_csv(written(tmp_path / "phone.csv", [header, *lines]))
    assert samples.timestamps == pytest.approx(0.01 * np.arange(5))
    assert samples.gyro[0] == pytest.approx(gyro * np.array([1, 2, 3]), rel=1e-6)
    assert samples.accel[0] == pytest.approx(accel * np.array([4, 5, 6]))


def test_units_that_are_given_go_before_those_of_the_header(tmp_path):
    path = written(tmp_path / "a.csv", rows([0.0, 0.01, 0.02]))
    samples = read_imu_csv(path, gyro_unit="deg/s", accel_unit="g")
    assert samples.gyro[0] == pytest.approx(np.radians([0.1, 0.2, 0.3]))
    assert samples.accel[0, 2] == pytest.approx(9.8 * 9.80665)


def test_unsorted_doubled_and_missing_samples_are_counted(tmp_path, caplog):
    lines = rows([0.0, 0.02, 0.01, 0.03, 0.03, 0.04])
    lines.append("0.05,nan,0,0,0,0,9.8")
    lines.append("0.06,,0,0,0,0,9.8")
    with caplog.at_level(logging.WARNING):
        samples = read_imu_csv(written(tmp_path / "a.csv", lines))
    assert samples.timestamps == pytest.approx([0, 0.01, 0.02, 0.03, 0.04])
    assert [doubt.partition(": ")[2].partition(";")[0] for doubt in samples.doubts] == [
        "2 of 8 samples of the IMU are not finite and were left out",
        "1 of 8 samples of the IMU come before their predecessor in time",
        "1 of 8 samples of the IMU repeat the time of another",
    ]
    assert len(caplog.records) == 3


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ([], "holds 0 usable samples"),
        (["time,a,b,c", "0,1,2,3"], "is no sample of the IMU"),
        (["time,gyro_x,gyro_y,gyro_z,acc_x,acc_y", "0,1,2,3,4,5"], "is no sample of the IMU"),
        (
            ["time,gyro_x,gyro_y,gyro_z,acc_x,acc_y,foo", "0,1,2,3,4,5,6"],
            "names no column accel_z; name the columns timestamp",
        ),
        ([*rows([0.0, 0.01]), "0.02,what"], r"a\.csv:3: '0\.02,what' is no sample"),
        (rows([0, 1e9, 2e9, 3e9]), "is no step of an IMU"),
    ],
)
def test_wrong_tables(tmp_path, lines, message):
    with pytest.raises(DatasetError, match=message):
        read_imu_csv(written(tmp_path / "a.csv", lines))


def test_a_missing_table_is_named(tmp_path):
    with pytest.raises(DatasetError, match=r"none\.csv"):
        read_imu_csv(tmp_path / "none.csv")


def test_two_streams_meet_at_the_times_of_the_gyro():
    t_g, t_a = np.arange(0, 1, 0.005), np.arange(0.1, 1, 0.016)
    gyro = np.column_stack([t_g, t_g, 2 * t_g, 3 * t_g])
    accel = np.column_stack([t_a, t_a, -t_a, 9.8 + t_a])
    samples = joined_streams("device", gyro, accel)
    assert samples.timestamps[0] == pytest.approx(0.1)
    assert samples.gyro[:, 1] == pytest.approx(2 * samples.timestamps)
    assert samples.accel[:, 2] == pytest.approx(9.8 + samples.timestamps)
    with pytest.raises(DatasetError, match="no time in common"):
        joined_streams("device", gyro, accel + np.array([5, 0, 0, 0]))


def test_objects_without_an_imu_have_no_samples():
    assert imu_of(object()) is None


def test_packets_of_kitti_raw(tmp_path):
    for k in range(3):
        written(tmp_path / f"{k:010d}.txt", [" ".join(str(n + 100 * k) for n in range(30))])
    numbers, readings = read_oxts_imu(tmp_path, 3)
    assert numbers == [0, 1, 2]
    assert readings[1].tolist() == [117, 118, 119, 111, 112, 113]
    written(tmp_path / "0000000001.txt", ["1 2 3 4 5 6"])
    with pytest.raises(DatasetError, match=r"0000000001\.txt .* and all readings"):
        read_oxts_imu(tmp_path, 3)


def test_a_list_of_one_stream(tmp_path):
    path = written(tmp_path / "gyro.txt", ["#Time wx wy wz", "1.5 1 2 3", "1.505 4 5 6"])
    assert read_stream(path).tolist() == [[1.5, 1, 2, 3], [1.505, 4, 5, 6]]
    with pytest.raises(DatasetError, match=r"bad\.txt:1"):
        read_stream(written(tmp_path / "bad.txt", ["1.5 1 2"]))


@pytest.mark.shared
def test_euroc(shared_data):
    folder = shared_data / "sequences" / "euroc_V1_01_rest40"
    sequence = open_sequence(folder, "mono")
    samples = sequence.imu()
    assert len(samples) == 431
    assert samples.rate == pytest.approx(200, rel=1e-3)
    assert samples.timestamps[0] == pytest.approx(sequence.timestamps[0], abs=1e-6)
    assert samples.gyro.mean(axis=0) == pytest.approx([-0.003, 0.021, 0.077], abs=4e-3)
    assert np.linalg.norm(samples.accel.mean(axis=0)) == pytest.approx(9.8, abs=0.05)
    assert sequence.imu_settings().T_ci[0, 1] == pytest.approx(0.999557, abs=1e-6)


PHONES = {
    "Sensor Logger": (
        "time,seconds_elapsed,z,y,x",
        1e9,
        (3, 2, 1),
        "Gyroscope",
        "TotalAcceleration",
    ),
    "Phyphox": (
        '"Time (s)","{} x ({})","{} y ({})","{} z ({})"',
        1.0,
        (1, 2, 3),
        "Raw",
        "Data",
    ),
}


@pytest.mark.parametrize("app", PHONES)
def test_two_tables_of_a_phone(tmp_path, app):
    header, per_second, order, gyro_name, accel_name = PHONES[app]
    t, t_a = np.arange(0, 2, 0.01), np.arange(0.003, 1.99, 0.02)
    gyro = np.column_stack([t, 0.1 * t, 0.2 * t, 0.3 * t])
    accel = np.column_stack([t_a, 1 + t_a, 2 + t_a, 9 + t_a])
    for name, rows, what, unit in (
        (gyro_name, gyro, "Gyroscope", "rad/s"),
        (accel_name, accel, "Acceleration", "m/s^2"),
    ):
        lines = [header.replace("{} ", what + " ").replace("{}", unit)]
        for row in rows:
            stamp = int((1.7e9 + row[0]) * 1e9) if per_second > 1 else float(row[0])
            elapsed = [float(row[0])] if per_second > 1 else []
            lines.append(",".join(map(repr, [stamp, *elapsed, *row[list(order)].tolist()])))
        (tmp_path / f"{name}.csv").write_text("\n".join(lines) + "\n")
    for names in ((gyro_name, accel_name), (accel_name, gyro_name)):
        samples = read_imu_streams(*(tmp_path / f"{name}.csv" for name in names))
        start = 1.7e9 if per_second > 1 else 0.0
        at = samples.timestamps - start
        assert len(samples) == 198
        np.testing.assert_allclose(samples.gyro, np.outer(at, [0.1, 0.2, 0.3]), atol=1e-6)
        np.testing.assert_allclose(samples.accel, at[:, None] + [1, 2, 9], atol=1e-6)


@pytest.mark.parametrize(
    ("names", "headers", "message"),
    [
        (("gyro", "gyro2"), ("t,x,y,z", "t,x,y,z"), "both tables of the gyro"),
        (("a", "accel"), ("t,x,y,z", "t,x,y,z"), "neither its header nor its name says"),
        (("gyro", "accel"), ("t,x,y,z", "t,x,y,w"), "names no column z"),
        (("gyro", "accel"), ("a,x,y,z", "t,x,y,z"), "names no column time"),
        (("gyro", "accel"), ("", "t,x,y,z"), "names no column time, x, y, z"),
    ],
)
def test_two_tables_that_do_not_fit(tmp_path, names, headers, message):
    for name, header in zip(names, headers, strict=True):
        rows = "".join(f"{0.01 * k},1,2,3\n" for k in range(5))
        (tmp_path / f"{name}.csv").write_text(f"{header}\n{rows}")
    with pytest.raises(DatasetError, match=message):
        read_imu_streams(*(tmp_path / f"{name}.csv" for name in names))


def test_units_in_two_tables(tmp_path):
    rows = "".join(f"{0.01 * k},90,0,1\n" for k in range(5))
    (tmp_path / "gyro.csv").write_text(f"t,x [deg/s],y,z\n{rows}")
    (tmp_path / "accel.csv").write_text(f"t,x [g],y,z\n{rows}")
    samples = read_imu_streams(tmp_path / "gyro.csv", tmp_path / "accel.csv")
    assert samples.gyro[0].tolist() == pytest.approx([np.pi / 2, 0, np.pi / 180])
    assert samples.accel[0, 2] == pytest.approx(9.80665)

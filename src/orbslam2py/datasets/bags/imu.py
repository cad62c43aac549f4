# SPDX-License-Identifier: BSD-3-Clause
"""Samples of an IMU that was recorded in a bag."""

from __future__ import annotations

import logging

import numpy as np

from orbslam2py._arguments import number_of
from orbslam2py._arrays import FloatArray
from orbslam2py.datasets.bags.bag import Bag, Topic
from orbslam2py.datasets.bags.messages import ENCODINGS, IMU, read_message, stamp_of
from orbslam2py.datasets.bags.parts import naming_damage
from orbslam2py.datasets.bags.realsense import stamps_of_imu
from orbslam2py.datasets.imu import ImuSamples, joined_streams, make_samples

_log = logging.getLogger(__name__)


def read_imu(bag: Bag) -> ImuSamples | None:
    """Read the messages of the type Imu.

    Parameters
    ----------
    bag
        With one topic of samples, or with one of a gyro and one of an accelerometer by their
        names, as RealSense cameras have them: the latter is interpolated at the times of the gyro.
        Of several topics that with the most messages is taken, and a warning names it.

    Returns
    -------
    ImuSamples or None
        None if there is no such topic.

    Raises
    ------
    DatasetError
        If a message is damaged, or no sample can be used.
    """
    topics = [one for one in bag.topics if one.kind == IMU and one.n and one.encoding in ENCODINGS]
    gyros = [one for one in topics if "gyro" in one.name.lower()]
    accels = [one for one in topics if "accel" in one.name.lower()]
    whole = [one for one in topics if one not in gyros and one not in accels]
    if not whole and len(gyros) == len(accels) == 1:
        gyro, accel = _rows(bag, gyros[0]), _rows(bag, accels[0])
        return joined_streams(str(bag.path), gyro[:, :4], accel[:, [0, 4, 5, 6]])
    if not whole:
        if topics:
            _log.warning(
                "%s: the IMU is not used: cannot distinguish gyro and accelerometer of %s",
                *(bag.path, ", ".join(one.name for one in topics)),
            )
        return None
    topic = max(whole, key=lambda one: one.n)
    if len(whole) > 1:
        _log.warning(
            "%s: of the IMUs %s that with the most messages is taken, %s",
            *(bag.path, ", ".join(one.name for one in whole), topic.name),
        )
    return make_samples(f"{bag.path} ({topic.name})", _rows(bag, topic))


def _rows(bag: Bag, topic: Topic) -> FloatArray:
    """Rows of a topic: time [s], angular rate and specific force, (n, 7)."""
    rows = []
    stamps, n_untimed = stamps_of_imu(bag, topic), 0
    for message in bag.messages(topic):
        with naming_damage(bag.path):
            read = read_message(bag.read(message), topic.kind, topic.encoding)
        w, a = read.angular_velocity, read.linear_acceleration
        stamp = stamps.get(message.recorded) if stamps else stamp_of(read.header)
        if stamp is None:
            n_untimed += 1
            continue
        rows.append([stamp / 1e9, w.x, w.y, w.z, a.x, a.y, a.z])
    if n_untimed:
        _log.warning(
            "%s: %s of %s without a time of the camera, left out",
            *(bag.path, number_of(n_untimed, "sample"), topic.name),
        )
    return np.array(rows, dtype=np.float64).reshape(-1, 7)

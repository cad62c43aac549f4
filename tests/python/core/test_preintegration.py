# SPDX-License-Identifier: BSD-3-Clause
"""The binding of `Preintegration`; the mathematics is tested in C++."""

import numpy as np
import pytest

from orbslam2py import _core as core

NOISE = {"gyro_noise": 1e-3, "accel_noise": 2e-2, "gyro_walk": 1e-4, "accel_walk": 1e-3}


def samples(n=201, rate=200.0):
    """At rest but for a turn about z and a push along x."""
    t = np.arange(n) / rate
    rows = np.zeros((n, 7))
    rows[:, 0] = t
    rows[:, 3] = 0.5
    rows[:, 6] = 9.81
    return rows


def test_a_turn_about_the_vertical_keeps_the_position():
    at = core.Preintegration(samples(), **NOISE)
    assert (at.begin, at.end, at.dt) == (0.0, 1.0, 1.0)
    assert np.arctan2(at.dR[1, 0], at.dR[0, 0]) == pytest.approx(0.5)
    assert at.dv == pytest.approx([0, 0, 9.81])
    assert at.dp == pytest.approx([0, 0, 9.81 / 2])
    T_wb, velocity = at.predict(core.Pose(), np.zeros(3), np.array([0, 0, -9.81]))
    assert T_wb.translation == pytest.approx(np.zeros(3), abs=1e-12)
    assert velocity == pytest.approx(np.zeros(3), abs=1e-12)
    assert at.covariance.shape == (9, 9)
    assert at.covariance[2, 2] == pytest.approx(1e-6)
    assert at.by_bias[5, 5] == pytest.approx(-1.0)
    assert np.diag(at.bias_walk_covariance) == pytest.approx([1e-8] * 3 + [1e-6] * 3)


def test_a_part_begins_and_ends_between_samples():
    at = core.Preintegration(samples(), **NOISE, begin=0.1015, end=0.5005)
    assert at.dt == pytest.approx(0.399)
    assert np.arctan2(at.dR[1, 0], at.dR[0, 0]) == pytest.approx(0.5 * 0.399)
    assert at.samples[0, 0] == 0.1015
    assert at.samples[1, 0] == 0.105


def test_bias_and_joining():
    rows = samples()
    bias = np.array([0, 0, 0.1, 0, 0, 0.2])
    whole = core.Preintegration(rows, **NOISE, bias=bias)
    halves = [core.Preintegration(part, **NOISE, bias=bias) for part in (rows[:101], rows[100:])]
    joined = halves[0].joined(halves[1])
    assert joined.dp == pytest.approx(whole.dp)
    assert joined.bias == pytest.approx(bias)
    dR, dv, _ = core.Preintegration(rows, **NOISE).corrected(bias)
    assert dR == pytest.approx(whole.dR)
    assert dv == pytest.approx(whole.dv)
    assert whole.reintegrated(np.zeros(6)).dv == pytest.approx([0, 0, 9.81])


def test_flags():
    rows = np.delete(samples(), slice(50, 70), axis=0)
    rows[10, 1] = 35.0
    at = core.Preintegration(rows, **NOISE, gyro_range=34.9, max_gap=0.02)
    assert (at.n_gaps, at.n_saturated_gyro, at.n_saturated_accel) == (1, 1, 0)
    assert at.longest_gap == pytest.approx(0.105)


@pytest.mark.parametrize(
    ("rows", "options", "message"),
    [
        (samples()[:1], {}, "two samples"),
        (samples()[::-1], {}, "does not grow; sort the samples"),
        (np.full((5, 7), np.nan), {}, "sample 0 is not finite"),
        (np.zeros((5, 6)), {}, "samples"),
        (samples(), {"begin": 5.0, "end": 6.0}, "no sample lies between"),
        (samples(), {"begin": 0.5, "end": 0.4}, "is empty"),
    ],
)
def test_wrong_samples(rows, options, message):
    with pytest.raises(ValueError, match=message):
        core.Preintegration(rows, **NOISE, **options)

# SPDX-License-Identifier: BSD-3-Clause
"""Compares the IMU with the camera while images are tracked, before it is used.

The same tests as of the command ``check-imu`` run on the first seconds of motion. See
``docs/method/inertial.md#online``.
"""

from __future__ import annotations

import enum
import logging
import threading
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.inertial.check import Finding, ImuReport, check_imu
from orbslam2py.inertial.samples import ImuSamples, clean_rows
from orbslam2py.settings.imu import ImuSettings
from orbslam2py.slam.inertial.imu_buffer import ImuInterval
from orbslam2py.slam.records import TrackingRecord
from orbslam2py.trajectory.trajectory import Trajectory

_log = logging.getLogger(__name__)

#: Tracked seconds before the first test, and between tests. Seconds without a pose count half.
_FIRST, _STEP = 2.0, 0.5
#: Tracked seconds between tests after this number of seconds with a fit, or without a verdict.
_LATER_STEP, _FITTING, _PATIENCE = 2.0, 5.0, 8.0
#: Tracked seconds after which an IMU that fits, with a known time offset, is not tested any more.
_ENOUGH = 20.0
#: Seconds of samples and poses that are compared.
_WINDOW = 10.0
#: Tests in a row that must agree.
_AGREEING = 2
#: Time offsets [s] that are tried, before and after that of the settings.
_REACH = 0.25
#: Rates [rad/s], root mean square, above which an axis that never changes counts as dead.
_MOVING = 0.08
#: Largest standard deviation of the time offset [s] with which the IMU counts as tested: slow
#: motion does not show it, and an error that does not show does no harm in it. The tests continue
#: until it is known to the second value, because faster motion may follow.
_USABLE_OFFSET, _KNOWN_OFFSET = 0.04, 0.015
#: Share of the samples at the end of the range, above which the range is too small.
_SATURATED = 0.01

#: Kinds of changes of a map.
_WORLDS = 1_000_000

#: Runs a test, now or in another thread.
Run = Callable[[Callable[[], None]], object]


class ImuVerdict(str, enum.Enum):
    """Whether the IMU may be used."""

    UNKNOWN = "unknown"
    """There was too little motion for a decision, or there are no samples."""
    FITS = "fits"
    """Gyro and accelerometer agree with the path of the camera."""
    HELD_BACK = "held back"
    """They do not; see `ImuCheck.reason`."""

    def __str__(self) -> str:
        return self.value


@dataclass(frozen=True)
class _Window:
    """Input of one test."""

    samples: FloatArray
    poses: FloatArray


class ImuCheck:
    """The verdict on an IMU, from the samples and poses of the frames so far.

    It is asked from any thread. A fault must show in two tests in a row, which are half a second
    apart; so must a fit. After a fault the tests continue with later samples. An IMU that fits is
    tested for 20 s, because slow motion does not show all faults.

    Parameters
    ----------
    settings
        The IMU beside the camera that is tracked.
    run
        Runs a test: at once, which makes two runs equal, or in another thread.
    """

    def __init__(self, settings: ImuSettings, run: Run) -> None:
        self._settings = settings
        self._run = run
        self._lock = threading.Lock()
        self._testing = False
        self._done = False
        self._begins_anew = False  # set by the test, carried out with the next frame
        self._samples: list[FloatArray] = []
        self._poses: list[FloatArray] = []
        self._tracked = 0.0
        self._next = _FIRST
        self._before: FloatArray | None = None
        self._kinds: list[frozenset[str]] = []
        self._told: set[str] = set()
        self._verdict = ImuVerdict.UNKNOWN
        self._report: ImuReport | None = None
        self._faults: tuple[Finding, ...] = ()

    @property
    def verdict(self) -> ImuVerdict:
        """Whether the IMU may be used."""
        return self._verdict

    @property
    def faults(self) -> tuple[Finding, ...]:
        """Why it is held back; none otherwise."""
        return self._faults

    @property
    def reason(self) -> str:
        """The faults as text; empty if it is not held back."""
        return "; ".join(fault.text for fault in self._faults)

    @property
    def report(self) -> ImuReport | None:
        """Measurements of the last test, such as the time offset; None before the first one."""
        return self._report

    def add(self, interval: ImuInterval | None, record: TrackingRecord, n_changes: int = 0) -> None:
        """Add a frame and its pose.

        Parameters
        ----------
        interval
            Samples since the frame before.
        record
            Its pose; one that the IMU alone predicted counts as none.
        n_changes
            Number of motions of the whole map: poses before and after are not compared with each
            other.
        """
        if self._done:
            return
        if self._begins_anew:
            self._begins_anew = False
            self._forget()
        row = np.full(18, np.nan)
        row[:2] = record.timestamp, record.map_index * _WORLDS + n_changes % _WORLDS
        T_wc = None if str(getattr(record, "method", "")) == "imu" else record.T_wc
        if T_wc is not None:
            row[2:] = T_wc.ravel()
        before, self._before = self._before, row
        if interval is not None and len(interval.samples):
            rows = interval.samples.copy()
            rows[:, 0] += self._settings.time_offset
            self._samples.append(rows if not self._samples else rows[1:])
        self._poses.append(row)
        if before is not None:
            passed = min(float(row[0] - before[0]), _STEP)
            self._tracked += passed if _follows(before, row) else 0.5 * passed
        if self._tracked >= self._next:
            fits = self._verdict is ImuVerdict.FITS
            later = self._tracked > (_FITTING if fits else _PATIENCE)
            self._next = self._tracked + (_LATER_STEP if later else _STEP)
            self._test()
            if fits and self._tracked > _ENOUGH and _knows_offset(self._report):
                self._done = True
                self._samples, self._poses = [], []

    def restart(self) -> None:
        """Restart after a reset; a verdict stays."""
        self._forget()

    def _forget(self) -> None:
        self._samples, self._poses, self._before = [], [], None
        self._tracked, self._next = 0.0, _FIRST
        self._kinds = []

    def _test(self) -> None:
        with self._lock:
            if self._testing:  # the machine is busy; the next test has more to go by
                return
            self._testing = True
        self._trim()
        if not self._samples:
            self._testing = False
            return
        window = _Window(np.concatenate(self._samples), np.stack(self._poses))
        self._run(lambda: self._judge(window))

    def _trim(self) -> None:
        """Drop poses and samples that are older than the window."""
        begin = self._poses[-1][0] - _WINDOW
        self._poses = [row for row in self._poses if row[0] >= begin]
        begin += self._settings.time_offset
        self._samples = [rows for rows in self._samples if rows[-1, 0] >= begin]

    def _judge(self, window: _Window) -> None:
        try:
            self._conclude(compared(window.samples, window.poses, self._settings))
        except Exception:  # a failure here must not stop the camera
            _log.exception("the test of the IMU failed")
        finally:
            self._testing = False

    def _conclude(self, report: ImuReport) -> None:
        self._report = report
        kinds = frozenset(fault.kind for fault in report.faults)
        fits = not kinds and _is_tested(report)
        self._kinds.append(kinds or frozenset({"fits"} if fits else ()))
        common = frozenset.intersection(*self._kinds[-_AGREEING:])
        if len(self._kinds) < _AGREEING or not common:
            return
        if "fits" in common:
            if self._verdict is ImuVerdict.HELD_BACK:
                _log.warning("the IMU fits the camera now")
            self._faults, self._verdict = (), ImuVerdict.FITS
            return
        self._faults = tuple(fault for fault in report.faults if fault.kind in common)
        self._verdict = ImuVerdict.HELD_BACK
        new = [fault for fault in self._faults if fault.kind not in self._told]
        self._told |= common
        for fault in new:
            _log.warning(
                "the IMU does not fit the camera, and its use is held back: %s", fault.text
            )
        self._begins_anew, self._kinds = True, []


def compared(samples: FloatArray, poses: FloatArray, settings: ImuSettings) -> ImuReport:
    """Compare samples with the poses of frames.

    Parameters
    ----------
    samples
        Rows as `ImuSamples` has them, on the clock of the IMU.
    poses
        One row for each frame: time stamp, number of the world, and ``T_wc`` row by row; NaN for a
        frame without a pose. (n, 18).
    settings
        The IMU beside the camera that the poses are of.
    """
    cleaned = clean_rows(samples).rows
    paths = []
    for number in np.unique(poses[:, 1]):
        rows = poses[poses[:, 1] == number]
        lost = np.isnan(rows[:, 2])
        T_wc = rows[:, 2:].reshape(-1, 4, 4).copy()
        T_wc[lost] = np.eye(4)
        if not lost.all():
            paths.append(Trajectory(rows[:, 0], T_wc, lost))
    report = check_imu(ImuSamples("the IMU", cleaned), paths, settings, reach=_REACH)
    moving = _moving(report, cleaned)
    return replace(report, faults=[one for one in report.faults if _counts(one, moving)])


def _is_tested(report: ImuReport) -> bool:
    """Whether the motion so far would have shown a fault."""
    rates, gravity = report.rates, report.gravity
    if report.open_questions or rates is None or gravity is None:
        return False
    return gravity.knows_sign and rates.offset_deviation < _USABLE_OFFSET


def _knows_offset(report: ImuReport | None) -> bool:
    rates = None if report is None else report.rates
    return rates is not None and rates.offset_deviation < _KNOWN_OFFSET


def _moving(report: ImuReport, samples: FloatArray) -> bool:
    rates = samples[:, 1:4] - samples[:, 1:4].mean(axis=0)
    turning = 0.0 if report.rates is None else report.rates.camera_rms
    return max(turning, float(np.sqrt((rates**2).sum(axis=1).mean()))) > _MOVING


def _counts(fault: Finding, moving: bool) -> bool:
    """Whether a fault of the whole window is one of the IMU: at rest coarse readings stay equal."""
    if fault.kind == "dead":
        return moving
    return fault.kind != "saturated" or fault.share > _SATURATED


def _follows(before: FloatArray, row: FloatArray) -> bool:
    """Whether two frames in a row have poses in one world."""
    return not np.isnan(before[2]) and before[1] == row[1] and row[0] - before[0] < _STEP

# SPDX-License-Identifier: BSD-3-Clause
"""Checks whether a calibration fits the first images of a run, and warns once."""

from __future__ import annotations

import itertools
import logging
import threading
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from orbslam2py import _core as core
from orbslam2py._arguments import shown
from orbslam2py._arrays import ByteArray
from orbslam2py.calibration.data_misfit import find_data_misfit, find_pair_misfit
from orbslam2py.calibration.pair_rows import PairRows, disparities_of, measure_curves, measure_rows
from orbslam2py.calibration.self_calibration import CalibrationGains, calibration_gains
from orbslam2py.calibration.tracks import PointTracker, TrackedPair
from orbslam2py.calibration.two_views import PointPair, without_gross_errors
from orbslam2py.datasets.base import Images
from orbslam2py.datasets.rectification import Rectifiers, rectifiers_of, with_rectified_images
from orbslam2py.errors import OrbSlamError, SettingsError
from orbslam2py.settings.comparison import compare_calibrations
from orbslam2py.settings.depth_check import is_known
from orbslam2py.settings.fit import FitThresholds, Misfit, find_misfit
from orbslam2py.settings.sensor import Sensor
from orbslam2py.settings.settings import Settings, resolve_settings
from orbslam2py.slam.frame_source import FrameSource, timed_images

_log = logging.getLogger(__name__)

#: Images that are used; images between two searches for points; and pairs whose rows are measured.
N_IMAGES, _EVERY, _N_ROWS = 49, 8, 3
#: Pairs of images that decide: those with most motion, and the points of each.
_N_PAIRS, _N_POINTS = 8, 150
#: Least median motion of a pair's points, in image widths: fewer are not enough.
_MOTION = 0.012
_LEAST_POINTS = 60


@dataclass(frozen=True)
class _MovedPair:
    motion: float
    frames: tuple[int, int]
    points: PointPair


class CalibrationWatch:
    """Checks the first images of a run after tracking, and warns once.

    It only reads images and does not change the system.

    Parameters
    ----------
    settings : Settings
        The calibration that is used.
    sensor : Sensor
        The sensor.
    known : Settings, optional
        The calibration beside the images, if there is one.
    in_background : bool
        Judge the points in a separate thread, because the next image does not wait.
    raw_pairs : bool
        Pairs come as the cameras take them, and are tracked after rectification by the settings.
    thresholds : FitThresholds, optional
        The limits.

    Attributes
    ----------
    rows : list of PairRows
        Result of the first pairs of a stereo camera.
    gains : CalibrationGains or None
        Result of the points, once they have been judged.
    """

    def __init__(
        self,
        settings: Settings,
        sensor: Sensor,
        *,
        known: Settings | None = None,
        in_background: bool = False,
        raw_pairs: bool = False,
        thresholds: FitThresholds | None = None,
    ) -> None:
        self._raw_pairs = raw_pairs
        self._settings, self._sensor, self._known = settings, sensor, known
        self._limits = thresholds or FitThresholds()
        self._tracker = PointTracker(every=_EVERY, least=_LEAST_POINTS)
        self._in_background = in_background
        self._thread: threading.Thread | None = None
        self._n_seen = 0
        self._size = (0, 0)
        self._begun: dict[int, Images] = {}
        self._rectifiers: Rectifiers | None = None
        self.rows: list[PairRows] = []
        self.gains: CalibrationGains | None = None
        self._pairs: list[_MovedPair] = []
        self._misfit: Misfit | None = None
        self._done = False

    def look(self, images: Images) -> None:
        """Check the next images of the run; they have been tracked, so they are valid."""
        if self._done:
            return
        images = self._as_tracked(images)
        if self._n_seen == 0:
            self._size = images.image.shape[1], images.image.shape[0]
            self._tell(self._misfit_of_size())
        if not self._done:
            self._follow(images)
        self._n_seen += 1
        if self._n_seen >= N_IMAGES and not self._done:
            self._judge()

    def finish(self) -> Misfit | None:
        """Judge the images so far, if fewer came, and report what did not fit."""
        if not self._done:
            self._judge()
        if self._thread is not None:
            self._thread.join()
        return self._misfit

    def _misfit_of_size(self) -> Misfit | None:
        if self._known is not None and self._known != self._settings:
            misfit = compare_calibrations(self._settings, self._known, self._size, self._limits)
            if misfit is not None:
                return misfit
        return find_misfit(self._settings, self._size, self._limits)

    def _follow(self, images: Images) -> None:
        grey = self._grey(images.image)
        if self._n_seen % _EVERY == 0:
            self._begun[self._n_seen] = images
            self._measure_rows(grey, images)
        for pair in self._tracker.add(grey, images.mask):
            self._keep(pair)

    def _as_tracked(self, images: Images) -> Images:
        """Rectify a pair that the system rectifies as well."""
        pair = self._settings.rectification
        if not self._raw_pairs or pair is None or images.right is None:
            return images
        if images.image.shape[:2] != (pair.left.height, pair.left.width):
            return images  # another calibration: the size shows it
        if self._rectifiers is None:
            self._rectifiers = rectifiers_of(self._settings)
        assert self._rectifiers is not None
        left, right = self._rectifiers
        return replace(
            images, image=left.rectify(images.image), right=right.rectify(images.right), mask=None
        )

    def _grey(self, image: ByteArray) -> ByteArray:
        return core.to_grey(image, self._settings.camera.rgb)

    def _measure_rows(self, grey: ByteArray, images: Images) -> None:
        if images.right is None or len(self.rows) == _N_ROWS:
            return
        right = self._grey(images.right)
        if self._settings.right is not None:
            rows = measure_curves(grey, right, self._settings)
        else:
            rows = measure_rows(grey, right)
        if rows is not None:
            self.rows.append(rows)
        if len(self.rows) == _N_ROWS:
            self._tell(self._misfit_of_pair())

    def _misfit_of_pair(self) -> Misfit | None:
        fisheye = self._settings.right is not None
        return find_pair_misfit(self.rows, self._limits, fisheye=fisheye)

    def _keep(self, pair: TrackedPair) -> None:
        motion = float(np.median(np.linalg.norm(pair.second - pair.first, axis=1)))
        if motion < _MOTION * self._size[0]:
            return
        good = without_gross_errors(PointPair(pair.first, pair.second))
        if good is not None and len(good.first) >= _LEAST_POINTS:
            self._pairs.append(_MovedPair(motion, pair.frames, good))

    def _judge(self) -> None:
        self._done = True
        if 0 < len(self.rows) < _N_ROWS:
            self._tell(self._misfit_of_pair())
        if self._misfit is not None or len(self._pairs) < self._limits.least_pairs:
            return
        if self._in_background:
            self._thread = threading.Thread(target=self._judge_points, name="calibration watch")
            self._thread.start()
        else:
            self._judge_points()

    def _judge_points(self) -> None:
        most = sorted(self._pairs, key=lambda pair: (-pair.motion, pair.frames))[:_N_PAIRS]
        pairs = [self._with_depths(pair) for pair in most]
        camera = self._settings.camera
        self.gains = calibration_gains(camera, pairs)
        self._tell(find_data_misfit(camera, pairs, self.gains, self._limits))
        self._begun.clear()
        self._pairs.clear()

    def _with_depths(self, pair: _MovedPair) -> PointPair:
        n = len(pair.points.first)
        chosen = np.linspace(0, n - 1, min(n, _N_POINTS)).astype(np.int64)
        first, second = pair.points.first[chosen], pair.points.second[chosen]
        images = self._begun[pair.frames[0]]
        if self._sensor is Sensor.RGBD and images.depth is not None:
            shape = np.array(images.image.shape[:2])
            pixels = np.clip(np.rint(first[:, ::-1]).astype(np.int64), 0, shape - 1)
            # Depth may be smaller than its image: that of the pixel which covers this one.
            rows, columns = (pixels * np.array(images.depth.shape) // shape).T
            depths = images.depth[rows, columns]
            known = np.where(is_known(depths), depths, 0).astype(np.float64)
            return PointPair(first, second, known)
        fisheye_pair = self._settings.right is not None
        if self._sensor is Sensor.STEREO and images.right is not None and not fisheye_pair:
            found = disparities_of(self._grey(images.image), self._grey(images.right), first)
            with np.errstate(divide="ignore"):
                return PointPair(first, second, np.where(found > 0, 1.0 / found, 0.0))
        return PointPair(first, second)

    def _tell(self, misfit: Misfit | None) -> None:
        if misfit is None or self._misfit is not None:
            return
        self._misfit, self._done = misfit, True
        _log.warning("%s", misfit)


def settings_beside(source: object) -> Settings | None:
    """Return the calibration beside the images, even if it is not used; None if there is none."""
    default = getattr(source, "default_settings", None)
    if default is None:
        return None
    try:
        settings: Settings = default()
    except (OrbSlamError, OSError):
        # The calibration of the images is not used if the user has given another one.
        return None
    return settings


def check_calibration(
    source: FrameSource,
    settings: Settings | str | Path | None = None,
    *,
    thresholds: FitThresholds | None = None,
) -> Misfit | None:
    """Check whether a calibration fits the first images of a sequence.

    `orbslam2py.run_sequence` makes the same checks during a run: size and centre of the images,
    known data sets, the rows of a stereo pair, and whether another focal length or lens explains
    the motion of the first 49 images better. Logs the misfit as a warning.

    Parameters
    ----------
    source : sequence, or iterable of frames
        A sequence from `orbslam2py.open_sequence`, or any source of consecutive frames with
        ``timestamp`` and ``images``.
    settings : Settings, str or Path, optional
        The calibration: settings, or, for a source with a known sensor, a file or a built-in name;
        by default the source's own.

    Returns
    -------
    Misfit or None
        The observation, its likely cause and the remedy, also as text; None if nothing contradicts
        the calibration. None is no proof: straight motion does not show a wrong focal length.

    Raises
    ------
    StateError
        If the sensors of the source and of the settings differ.
    SettingsError
        If there are no settings, or they cannot be read.
    DatasetError, ImageError
        If images cannot be read.

    Examples
    --------
    >>> sequence = orb.open_sequence("rgbd_dataset_freiburg1_desk", "rgbd")  # doctest: +SKIP
    >>> print(orb.check_calibration(sequence, orb.Settings.load("tum3", "rgbd")))  # doctest: +SKIP
    """
    images_of: Any = source
    own = _as_images_come(images_of, _settings_for(images_of, settings))
    watch = CalibrationWatch(
        own,
        own.sensor,
        known=settings_beside(images_of),
        raw_pairs=come_raw(own),
        thresholds=thresholds,
    )
    for one in itertools.islice(timed_images(images_of, own.sensor), N_IMAGES):
        images = one.images
        watch.look(Images(images.image, images.right, images.depth, images.mask))
    return watch.finish()


def come_raw(settings: Settings) -> bool:
    """Whether the system rectifies the pairs that go with settings."""
    pair = settings.rectification
    return pair is not None and not pair.applied


def _as_images_come(source: object, own: Settings) -> Settings:
    """Settings that do not rectify what a source with settings of its own delivers."""
    its = getattr(source, "settings", None)
    if isinstance(its, Settings) and (its.rectification is None or its.rectification.applied):
        return with_rectified_images(own)
    return own


def _settings_for(source: object, choice: Settings | str | Path | None) -> Settings:
    """Return the given settings, or those beside the images."""
    choice = getattr(source, "settings", None) if choice is None else choice
    if choice is None:
        raise SettingsError(
            f"{shown(source)} has no settings; give them: check_calibration(images, settings)"
        )
    if isinstance(choice, Settings):
        return choice
    sensor = getattr(source, "sensor", None)
    if sensor is None and isinstance(choice, str | Path):
        raise SettingsError(
            f"{shown(source)} does not name its sensor, which is needed to read settings from a "
            f"file or by a name; give Settings.load({str(choice)!r}, sensor)"
        )
    return resolve_settings(choice, sensor or Sensor.MONOCULAR)

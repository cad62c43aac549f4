# SPDX-License-Identifier: BSD-3-Clause
"""Recent views, each matched with every new frame."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from orbslam2py import _core as core
from orbslam2py.slam.config import InitializationConfig
from orbslam2py.slam.initialization.image_motion import ImageMotion, Pixels

Indices = npt.NDArray[np.int32]

_VIEWS = 6  # that a map may begin from: each is matched with every frame
_DISTANT_VIEWS = 3  # that have too few matches left to begin a map, but may confirm a motion
_WIDE, _NARROW = 2.0, 0.25  # search windows after a failure and around a prediction, of the usual


class View:
    """A kept frame, and the present positions of its keypoints.

    Parameters
    ----------
    frame
        The frame.

    Attributes
    ----------
    frame
        The frame.
    positions
        Positions of its keypoints in the last frame, measured or predicted, (n, 2).
    matches
        Per keypoint the index in the last frame or -1, (n,).
    displacement
        Median displacement of matched keypoints since this view [pixels].
    """

    def __init__(self, frame: core.Frame) -> None:
        self.frame = frame
        self.keypoints: Pixels = frame.keypoints
        self.positions: Pixels = self.keypoints
        self.matches: Indices = np.arange(frame.size, dtype=np.int32)
        self.displacement = 0.0
        # By the id of the frame of a view kept later: its keypoint for each of this one, or -1.
        self._linked: dict[int, Indices] = {}

    @property
    def n_matches(self) -> int:
        """Keypoints matched with the last frame."""
        return int(np.count_nonzero(self.matches >= 0))

    def follow(self, frame: core.Frame, seen: Pixels, motion: ImageMotion, window: float) -> None:
        """Match with the next frame, whose keypoints are `seen`, around the predicted positions."""
        expected = self.positions + motion.at(self.positions)
        matches = core.match_views(self.frame, frame, expected, window=window)
        found = _one_per_place(self.keypoints, matches)
        self.matches = np.full(len(matches), -1, np.int32)
        self.matches[found] = matches[found]
        expected[found] = seen[matches[found]]
        self.positions = expected
        moved = expected[found] - self.keypoints[found]
        self.displacement = float(np.median(np.linalg.norm(moved, axis=1))) if len(found) else 0.0

    def link(self, later: View) -> None:
        """Store the matches of these keypoints in the last frame, which becomes a view itself."""
        self._linked[later.frame.id] = self.matches

    def unlink_all_but(self, kept: set[int]) -> None:
        """Drop the stored matches with other views than those with these ids."""
        self._linked = {frame: links for frame, links in self._linked.items() if frame in kept}

    def partners(self, other: View) -> Indices:
        """Return per keypoint of this view its index in another view, linked by the last frame."""
        return _inverse(other.matches, int(self.matches.max(initial=-1)) + 1)[self.matches]

    def all_partners(self, other: View) -> Indices:
        """Return these links, and the matches stored when one of the two was the last frame."""
        partners = self.partners(other)
        if other.frame.id in self._linked:
            then = self._linked[other.frame.id]
        elif self.frame.id in other._linked:
            every = np.arange(len(self.matches))
            then = _inverse(other._linked[self.frame.id], len(every))[every]
        else:
            return partners
        # One to one: the last frame decides.
        taken = np.isin(then, partners[partners >= 0])
        return np.where(partners >= 0, partners, np.where(taken, -1, then))


def _inverse(matches: Indices, n: int) -> Indices:
    """Per keypoint of the matched frame, `n` or more, its match; -1 for none.

    The last entry is -1 too, so that the index -1 (no match) gives -1.
    """
    back = np.full(max(n, int(matches.max(initial=-1)) + 1) + 1, -1, np.int32)
    matched = np.flatnonzero(matches >= 0)
    back[matches[matched]] = matched
    return back


def _one_per_place(keypoints: Pixels, matches: Indices) -> npt.NDArray[np.int64]:
    """Return matched keypoints, at most one in each cell of two by two pixels.

    A corner gives keypoints on several levels; only the finest one is kept, so that it counts once.
    """
    found = np.flatnonzero(matches >= 0)
    cells = np.floor(keypoints[found] / 2).astype(np.int64)
    _, first = np.unique(cells[:, 1] * 100_000 + cells[:, 0], return_index=True)
    return np.asarray(found[np.sort(first)])


class InitialViews:
    """Follows the image from frame to frame and keeps a few views, thinned by parallax.

    Parameters
    ----------
    limits
        Search windows, counts, and the number of views to keep.

    Attributes
    ----------
    views
        Views that a map may begin from, oldest first.
    distant
        Views with too few matches to begin a map; they may confirm one.
    """

    def __init__(self, limits: InitializationConfig) -> None:
        self._limits = limits
        self.clear()

    def clear(self) -> None:
        """Keep nothing."""
        self.views: list[View] = []
        self.distant: list[View] = []
        self._last: View | None = None
        self._motion: ImageMotion | None = None
        self._n_usual = 0

    def follow(self, frame: core.Frame) -> None:
        """Match all views with the next frame; drop those with too few matches."""
        limits, last = self._limits, self._last
        seen: Pixels = frame.keypoints
        if last is not None:
            motion = self._follow_image(last, frame, seen)
            narrow = limits.window
            if motion.spread is not None:
                narrow = min(limits.window, max(_NARROW * limits.window, 4 * motion.spread))
            for view in (*self.distant, *self.views):
                view.follow(frame, seen, motion, narrow)
            self._let_go()
        self._last = View(frame)

    def _let_go(self) -> None:
        """Sort views by their remaining matches: for starts, for confirmation, the rest."""
        limits = self._limits
        lost = [view for view in self.views if view.n_matches < limits.matches]
        self.views = [view for view in self.views if view.n_matches >= limits.matches]
        distant = [*self.distant, *lost]
        distant = [view for view in distant if view.n_matches >= limits.third_view_points]
        self.distant = distant[-_DISTANT_VIEWS:]

    def _follow_image(self, last: View, frame: core.Frame, seen: Pixels) -> ImageMotion:
        """Return the motion from the last frame, searched in wide windows around its prediction."""
        if self._motion is None:
            pinhole = frame.camera.pinhole
            centre = np.array([pinhole.cx, pinhole.cy])
            self._motion = ImageMotion(centre, centre)
        limits = self._limits
        # As before, a search near the prediction is enough; else ever wider.
        enough, windows = self._n_usual // 2, [(self._motion, limits.window)]
        if self._motion.spread is not None:
            windows.insert(0, (self._motion, _NARROW * limits.window + 4 * self._motion.spread))
        still = ImageMotion(*self._motion.frame)
        for motion, window in (*windows, (still, _WIDE * limits.window)):
            last.positions = last.keypoints
            last.follow(frame, seen, motion, window)
            if last.n_matches >= max(limits.matches, enough):
                break
            enough = 0
        self._n_usual = last.n_matches
        found = last.matches >= 0
        self._motion.fit(last.keypoints[found], (last.positions - last.keypoints)[found])
        return self._motion

    def keep_last(self) -> None:
        """Keep the last frame as a view, if it shows enough new parts of the scene."""
        last, views = self._last, self.views
        if last is None or (views and views[-1].displacement < self._limits.displacement):
            return
        kept = View(last.frame)
        for view in (*views, *self.distant):
            view.link(kept)
        views.append(kept)
        if len(views) > _VIEWS:
            # The one that differs least from its neighbours; the first and the last stay.
            moved = np.array([view.displacement for view in views])
            gaps = np.abs(moved[:-2] - moved[2:])
            del views[1 + int(np.argmin(gaps))]
        left = {view.frame.id for view in (*views, *self.distant)}
        for view in (*views, *self.distant):
            view.unlink_all_but(left)

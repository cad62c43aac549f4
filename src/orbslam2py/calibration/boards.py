# SPDX-License-Identifier: BSD-3-Clause
"""Boards with coded tags, of which a part may be out of the image: ChArUco and AprilGrid."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import NamedTuple, Protocol, runtime_checkable

import cv2
import numpy as np
from numpy.typing import NDArray

from orbslam2py._arguments import finite_number, is_whole, shown
from orbslam2py._arrays import ByteArray, FloatArray, IntArray
from orbslam2py.errors import SettingsError

#: Fewest corners of a board in an image.
LEAST_CORNERS = 8
_MOST_TAGS = 100
#: Half windows in which corners are refined, one after the other, as parts of the side of a tag:
#: the next corner is 0.3 sides away. Those of ChArUco are parts of the gap between a corner and
#: the markers beside it.
_TAG_WINDOWS, _CHARUCO_WINDOW = (0.2, 0.12), 0.7
_LEAST_WINDOW, _MOST_WINDOW = 2, 8


class BoardCorners(NamedTuple):
    """Corners of a board in an image.

    Attributes
    ----------
    ids
        Their rows in the points of the board, (n,).
    pixels
        Where they are seen, (n, 2).
    """

    ids: IntArray
    pixels: FloatArray


@runtime_checkable
class Target(Protocol):
    """A board of known corners."""

    @property
    def points(self) -> FloatArray:
        """Corners (n, 3) in the frame of the board [m]: z = 0."""

    @property
    def title(self) -> str:
        """What the board consists of, for messages."""

    @property
    def advice(self) -> str:
        """What to check if the board is found in no image."""

    def find(self, image: ByteArray) -> BoardCorners | None:
        """Find corners in a grey image uint8 (h, w); None if there are too few."""


@dataclass(frozen=True)
class CharucoBoard:
    """A chessboard with ArUco markers in its white squares (OpenCV's ChArUco).

    Attributes
    ----------
    columns, rows
        Squares, not corners.
    square, marker
        Sides of a square and of a marker [m].
    dictionary
        Name of the markers' dictionary in OpenCV without ``DICT_``, such as ``4X4_50``.
    legacy
        Whether the first square is a marker, as OpenCV made boards of an even number of rows
        before version 4.6. None: find out from the images.
    """

    columns: int
    rows: int
    square: float
    marker: float
    dictionary: str = "4X4_50"
    legacy: bool | None = None

    def __post_init__(self) -> None:
        _check_grid(self.columns, self.rows, "squares", 3)
        _check_length(self.square, "the side of the squares")
        _check_length(self.marker, "the side of the markers")
        if not self.marker < self.square:
            raise SettingsError(
                f"the markers of the ChArUco board are {self.marker:g} m and its squares "
                f"{self.square:g} m; markers lie inside of the squares: give the smaller length "
                "as the marker's"
            )
        n = self.columns * self.rows // 2
        if len(_dictionary(self.dictionary).bytesList) < n:
            raise SettingsError(
                f"the dictionary {self.dictionary} has fewer than the {n} markers of a board of "
                f"{self.columns} x {self.rows} squares; give the dictionary of the board"
            )

    @property
    def points(self) -> FloatArray:
        """Inner corners (n, 3) in the frame of the board [m]: z = 0, row by row."""
        grid = np.zeros(((self.rows - 1) * (self.columns - 1), 3))
        inner = np.mgrid[1 : self.columns, 1 : self.rows].T.reshape(-1, 2)
        grid[:, :2] = inner * self.square
        return grid

    @cached_property
    def _detectors(self) -> list[cv2.aruco.CharucoDetector]:
        patterns = (False, True) if self.legacy is None else (self.legacy,)
        detectors = []
        for legacy in patterns:
            board = cv2.aruco.CharucoBoard(
                (self.columns, self.rows),
                self.square,
                self.marker,
                _dictionary(self.dictionary),
            )
            board.setLegacyPattern(legacy)
            detectors.append(cv2.aruco.CharucoDetector(board))
        return detectors

    def find(self, image: ByteArray) -> BoardCorners | None:
        """Find corners in a grey image uint8 (h, w); None if there are too few."""
        best: BoardCorners | None = None
        for detector in self._detectors:
            corners, ids, _, _ = detector.detectBoard(image)
            if ids is None or len(ids) < max(LEAST_CORNERS, 0 if best is None else len(best.ids)):
                continue
            pixels = np.asarray(corners, np.float64).reshape(-1, 2)
            rows = np.asarray(ids, np.int64).ravel()
            best = BoardCorners(rows, self._refine(image, rows, pixels))
            if len(ids) >= 0.5 * len(self.points):
                break
        return best if best is not None and _spread_in_plane(self.points[best.ids]) else None

    def _refine(self, image: ByteArray, ids: IntArray, pixels: FloatArray) -> FloatArray:
        """Refine with a window that does not reach the markers."""
        there = self.points[ids]
        apart = np.linalg.norm(there[:, None] - there[None], axis=2)
        neighbours = np.nonzero((apart > 0) & (apart < 1.1 * self.square))
        if not len(neighbours[0]):
            return pixels
        steps = np.linalg.norm(pixels[neighbours[0]] - pixels[neighbours[1]], axis=1)
        gap = (self.square - self.marker) / 2 / self.square * float(steps.min())
        return _refined(image, pixels, _CHARUCO_WINDOW * gap)

    @property
    def title(self) -> str:
        """What the board consists of, for messages."""
        return f"{self.columns}x{self.rows} ChArUco squares ({self.dictionary})"

    @property
    def advice(self) -> str:
        """What to check if the board is found in no image."""
        return (
            "count the squares, not the corners, and give the dictionary of its markers "
            "(--dictionary)"
        )

    def __str__(self) -> str:
        return f"charuco {self.columns}x{self.rows}"


@dataclass(frozen=True)
class AprilGrid:
    """A grid of AprilTags of the family 36h11 as Kalibr prints it.

    Tag 0 is at the lower left; numbers grow to the right, then upwards. The frame has its origin at
    the lower left corner of tag 0, x to the right and y up.

    Attributes
    ----------
    columns, rows
        Tags.
    tag
        Side of a tag, the outer border of its black frame [m].
    spacing
        Gap between two tags as a part of the side of a tag.
    first
        Number of the tag at the lower left.
    """

    columns: int
    rows: int
    tag: float
    spacing: float = 0.3
    first: int = 0

    def __post_init__(self) -> None:
        _require_tags()
        _check_grid(self.columns, self.rows, "tags", 1)
        _check_length(self.tag, "the side of a tag")
        what = "the gap between tags by the side of a tag, such as 0.3"
        if not 0 < finite_number(self.spacing, "the spacing of the tags", what) <= 2:
            raise SettingsError(
                f"the spacing of the tags is {self.spacing:g}; give {what} (not in metres)"
            )
        if not is_whole(self.first) or not 0 <= self.first <= 586 - self.columns * self.rows + 1:
            raise SettingsError(
                f"the first tag is {shown(self.first)}; the family 36h11 has the tags 0 to 586"
            )

    @property
    def points(self) -> FloatArray:
        """Corners (n, 3) in the frame of the board [m]: four per tag, from the lower left on."""
        step = self.tag * (1 + self.spacing)
        corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * self.tag
        origins = [(step * x, step * y) for y, x in product(range(self.rows), range(self.columns))]
        points = np.zeros((4 * len(origins), 3))
        points[:, :2] = (np.array(origins)[:, None, :] + corners).reshape(-1, 2)
        return points

    @cached_property
    def _detectors(self) -> list[cv2.aruco.ArucoDetector]:
        detectors = []
        # Kalibr prints a black frame of two cells, others one of one cell.
        for border in (2, 1):
            parameters = cv2.aruco.DetectorParameters()
            parameters.markerBorderBits = border
            parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_NONE
            detectors.append(cv2.aruco.ArucoDetector(_dictionary("APRILTAG_36h11"), parameters))
        return detectors

    def find(self, image: ByteArray) -> BoardCorners | None:
        """Find corners in a grey image uint8 (h, w); None if there are too few."""
        tags: dict[int, FloatArray] = {}
        for detector in self._detectors:
            corners, ids, _ = detector.detectMarkers(image)
            numbers = [] if ids is None else (np.ravel(ids) - self.first).tolist()
            found = {
                int(number): np.asarray(quad, np.float64).reshape(4, 2)
                for number, quad in zip(numbers, corners, strict=True)
                if 0 <= number < self.columns * self.rows
            }
            tags = found if len(found) > len(tags) else tags
            if len(tags) >= 0.5 * self.columns * self.rows:
                break
        if 4 * len(tags) < LEAST_CORNERS:
            return None
        # A mirrored order is that of the detector: clockwise in the image, from any corner on.
        order = _order_of_corners(self.points, tags)
        ids = np.concatenate([4 * number + order for number in tags])
        pixels, sure = zip(*(_refined_tag(image, quad) for quad in tags.values()), strict=True)
        good = np.concatenate(sure)
        if good.sum() < LEAST_CORNERS:
            return None
        return BoardCorners(ids[good], np.concatenate(pixels)[good])

    @property
    def title(self) -> str:
        """What the board consists of, for messages."""
        return f"{self.columns}x{self.rows} AprilTags (36h11)"

    @property
    def advice(self) -> str:
        """What to check if the board is found in no image."""
        return "the tags must be of the family 36h11, with the number 0 at the lower left"

    def __str__(self) -> str:
        return f"aprilgrid {self.columns}x{self.rows}"


def _order_of_corners(points: FloatArray, tags: dict[int, FloatArray]) -> IntArray:
    """Rows, within a tag, of the corners that the detector gives clockwise.

    Programs differ in the corner with which a tag begins: the one that fits a homography is right.
    """
    pixels = np.concatenate(list(tags.values()))
    best, least = np.arange(4), float("inf")
    for begin in range(4):
        order = (begin - np.arange(4)) % 4
        there = np.concatenate([points[4 * number + order, :2] for number in tags])
        H, _ = cv2.findHomography(there, pixels)
        if H is None:
            continue
        plane = np.column_stack([there, np.ones(len(there))]) @ H.T
        error = float(np.linalg.norm(plane[:, :2] / plane[:, 2:] - pixels, axis=1).mean())
        best, least = (order, error) if error < least else (best, least)
    return np.asarray(best, np.int64)


def _refined_tag(image: ByteArray, quad: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Refine the corners (4, 2) of a tag; return also which of them were found."""
    side = float(np.linalg.norm(quad - np.roll(quad, 1, axis=0), axis=1).min())
    pixels = quad
    for part in _TAG_WINDOWS:
        pixels = _refined(image, pixels, part * side)
    moved = np.linalg.norm(pixels - quad, axis=1)
    # A corner that would leave the window stays where it was.
    return pixels, (moved > 0) & (moved < _TAG_WINDOWS[0] * side)


def _refined(image: ByteArray, pixels: FloatArray, window: float) -> FloatArray:
    """Move corners (n, 2) to the saddle points beside them, in a half window of some pixels."""
    half = int(np.clip(window, _LEAST_WINDOW, _MOST_WINDOW))
    refined = cv2.cornerSubPix(
        image,
        pixels.astype(np.float32).reshape(-1, 1, 2),
        (half, half),
        (-1, -1),
        (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 50, 1e-4),
    )
    return np.asarray(refined, np.float64).reshape(-1, 2)


def _spread_in_plane(points: FloatArray) -> bool:
    """Whether points are not all on a line, which determines no pose."""
    values = np.linalg.svd(points[:, :2] - points[:, :2].mean(axis=0), compute_uv=False)
    return bool(values[1] > 0.05 * values[0])


def _require_tags() -> None:
    """Raise `SettingsError` unless OpenCV finds boards with tags."""
    if not hasattr(getattr(cv2, "aruco", None), "CharucoDetector"):
        raise SettingsError(
            f"OpenCV {cv2.__version__} cannot find boards with tags; install 4.8 or later (pip "
            "install --upgrade opencv-python-headless), or use a chessboard"
        )


def dictionary_names() -> list[str]:
    """Names of the dictionaries of markers, without ``DICT_``."""
    return [name[5:] for name in dir(cv2.aruco) if name.startswith("DICT_")]


def _dictionary(name: str) -> cv2.aruco.Dictionary:
    _require_tags()
    plain = str(name).upper().removeprefix("DICT_")
    names = {known.upper(): known for known in dictionary_names()}
    if plain not in names:
        raise SettingsError(
            f"there is no dictionary of markers {shown(name)}; give one of OpenCV's: "
            f"{', '.join(dictionary_names())}"
        )
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{names[plain]}"))


def _check_grid(columns: object, rows: object, what: str, least: int) -> None:
    if not (is_whole(columns) and is_whole(rows)):
        raise SettingsError(
            f"the board has {shown(columns)} x {shown(rows)} {what}; give whole numbers, such as "
            "8 x 6"
        )
    fewest, most = sorted((int(columns), int(rows)))  # type: ignore[call-overload]
    if fewest < least or most > _MOST_TAGS or most < 2:
        raise SettingsError(
            f"a board of {columns} x {rows} {what} cannot be used: give {least} to {_MOST_TAGS} "
            "each way"
        )


def _check_length(value: object, what: str) -> None:
    if not 0 < finite_number(value, what, "metres, such as 0.025") < 100:
        raise SettingsError(f"{what} is {value:g} m; give metres, such as 0.025")

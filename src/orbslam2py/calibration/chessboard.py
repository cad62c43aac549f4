# SPDX-License-Identifier: BSD-3-Clause
"""Views of a board: found in images, and those chosen that differ most."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np

from orbslam2py._arguments import finite_number, is_whole, path_of, shown
from orbslam2py._arrays import ByteArray, FloatArray, IntArray
from orbslam2py.calibration.boards import BoardCorners, Target
from orbslam2py.datasets import VideoReader
from orbslam2py.datasets.image_folder import image_files
from orbslam2py.datasets.images import read_image
from orbslam2py.errors import DatasetError, ImageError, SettingsError

_log = logging.getLogger(__name__)


#: Images of a video that are searched per second, if nothing else is said.
_PER_SECOND = 4.0
#: Views closer to a chosen one than this add no information; see `_features`.
_LEAST_DIFFERENCE = 0.03


@dataclass(frozen=True)
class Board:
    """A chessboard.

    Attributes
    ----------
    columns, rows
        Inner corners: where two black and two white squares meet.
    square
        Side of a square [m].
    """

    columns: int
    rows: int
    square: float = 1.0

    def __post_init__(self) -> None:
        if not (is_whole(self.columns) and is_whole(self.rows)):
            raise SettingsError(
                f"the board has {shown(self.columns)} x {shown(self.rows)} inner corners; give "
                "whole numbers, such as 9 x 6"
            )
        finite_number(self.square, "the side of the squares", "metres, such as 0.025")
        if min(self.columns, self.rows) < 3 or max(self.columns, self.rows) > 100:
            raise SettingsError(
                f"a board of {self.columns} x {self.rows} inner corners cannot be used: give 3 to "
                "100 each way"
            )
        if not 0 < self.square < 100:
            raise SettingsError(f"the squares are {self.square:g} m; give metres, such as 0.025")

    @classmethod
    def parse(cls, text: str, square: float) -> Board:
        """Make a board of a text such as ``9x6``.

        Parameters
        ----------
        text
            Inner corners, columns x rows.
        square
            Side of a square [m].

        Raises
        ------
        SettingsError
            If the text or a number is wrong.
        """
        parts = text.lower().replace("×", "x").split("x")  # noqa: RUF001
        if len(parts) != 2 or not all(part.strip().isdecimal() for part in parts):
            raise SettingsError(
                f"board '{text}' is not understood: give inner corners as columns x rows: 9x6"
            )
        return cls(int(parts[0]), int(parts[1]), square)

    @property
    def points(self) -> FloatArray:
        """Corners (n, 3) in the frame of the board [m]: z = 0, row by row."""
        grid = np.zeros((self.rows * self.columns, 3))
        grid[:, :2] = np.mgrid[: self.columns, : self.rows].T.reshape(-1, 2) * self.square
        return grid

    @property
    def title(self) -> str:
        """What the board consists of, for messages."""
        return f"{self} inner corners"

    @property
    def advice(self) -> str:
        """What to check if the board is found in no image."""
        return "count the inner corners, not the squares, and have the whole board in view"

    def find(self, image: ByteArray) -> BoardCorners | None:
        """Find all corners in a grey image uint8 (h, w); None if not all are seen."""
        corners = find_board(image, self)
        if corners is None:
            return None
        if self._is_turned(image, corners):
            corners = corners[::-1].copy()
        return BoardCorners(np.arange(len(corners)), corners)

    def _is_turned(self, image: ByteArray, corners: FloatArray) -> bool:
        """Whether the corners begin at the other end, which the colours of the squares tell.

        Several cameras must call a corner the same; a board with two even or two odd numbers of
        corners looks the same from both ends.
        """
        if (self.columns + self.rows) % 2 == 0:
            return False
        grid = corners.reshape(self.rows, self.columns, 2)
        middles = (grid[:-1, :-1] + grid[1:, 1:] + grid[:-1, 1:] + grid[1:, :-1]) / 4
        u, v = np.rint(middles).astype(int).reshape(-1, 2).T
        levels = image[v, u].reshape(middles.shape[:2]).astype(np.float64)
        even = np.indices(levels.shape).sum(axis=0) % 2 == 0
        return bool(levels[even].mean() > levels[~even].mean())

    def __str__(self) -> str:
        return f"{self.columns}x{self.rows}"


@dataclass(frozen=True, eq=False)
class BoardView:
    """The board in one image.

    Attributes
    ----------
    name
        File name, or number of the frame in the video.
    corners
        Pixels, float64 (n, 2).
    ids
        Their rows in the points of the board, (n,); None if these are all, in this order.
    """

    name: str
    corners: FloatArray
    ids: IntArray | None = None

    def points_of(self, board: Target) -> FloatArray:
        """The corners in the frame of the board, (n, 3) metres."""
        return board.points if self.ids is None else board.points[self.ids]


@dataclass
class BoardViews:
    """Result of a search for the board in a folder or a video.

    Attributes
    ----------
    size
        Width and height of the images [pixels].
    views
        Images with the board, in order.
    n_searched, n_unreadable
        Images looked at, and those that could not be read.
    fps
        Frames per second of the video, None for a folder.
    names
        Names of all images that could be read, in order.
    """

    size: tuple[int, int] = (0, 0)
    views: list[BoardView] = field(default_factory=list)
    n_searched: int = 0
    n_unreadable: int = 0
    fps: float | None = None
    names: list[str] = field(default_factory=list)


def find_board(image: ByteArray, board: Board) -> FloatArray | None:
    """Find all inner corners with sub-pixel accuracy.

    Parameters
    ----------
    image
        uint8 (h, w), or (h, w, 3 or 4) in the order BGR.
    board
        The board to search for.

    Returns
    -------
    FloatArray or None
        (n, 2) pixels; None if they are not all seen.
    """
    grey = _grey(image)
    found, corners = cv2.findChessboardCornersSB(
        grey, (board.columns, board.rows), flags=cv2.CALIB_CB_NORMALIZE_IMAGE
    )
    if not found:
        return None
    # The detector is robust, but off by some 0.02 pixels in one direction; the refinement is not.
    # Its window must not reach the next corner.
    grid = np.asarray(corners, dtype=np.float32).reshape(board.rows, board.columns, 2)
    steps = [np.linalg.norm(np.diff(grid, axis=axis), axis=2).min() for axis in (0, 1)]
    window = int(np.clip(min(steps) / 3, 2, 8))
    refined = cv2.cornerSubPix(
        grey,
        grid.reshape(-1, 1, 2),
        (window, window),
        (-1, -1),
        (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 50, 1e-4),
    )
    return np.asarray(refined, dtype=np.float64).reshape(-1, 2)


def find_views(
    source: str | Path,
    board: Target,
    *,
    every: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> BoardViews:
    """Search for the board in a video or a folder of images.

    Parameters
    ----------
    source
        Video file or folder.
    board
        The board to search for.
    every
        Search every Nth image; by default all of a folder, four per second of a video.
    progress
        Called after every image with the numbers of images looked at and with the board.

    Raises
    ------
    DatasetError
        If there are no images, the board is in none, or the images have different sizes.
    ImageError
        If no image can be read.
    """
    result = BoardViews()
    for name, image in _images(path_of(source, "the source"), every, result):
        result.n_searched += 1
        if isinstance(image, ImageError):
            _log.warning("left out: %s", image)
            result.n_unreadable += 1
        else:
            _check_size(source, name, (image.shape[1], image.shape[0]), result)
            result.names.append(name)
            found = board.find(_grey(image))
            if found is not None:
                ids = None if isinstance(board, Board) else found.ids
                result.views.append(BoardView(name, found.pixels, ids))
        if progress is not None:
            progress(result.n_searched, len(result.views))
    if result.n_unreadable == result.n_searched:
        raise ImageError(
            f"none of the {result.n_searched} images of {source} can be read; give others"
        )
    if not result.views:
        raise DatasetError(
            f"no board of {board.title} in any of the {result.n_searched} images of {source}; "
            f"{board.advice}"
        )
    return result


def choose_views(found: BoardViews, most: int) -> list[BoardView]:
    """Choose views that differ most: in place, size and slant.

    Starts with the largest board; then always takes the view least like those taken, until there
    are enough or all the others are much the same as one of them.

    Parameters
    ----------
    found
        Result of the search.
    most
        How many at most.

    Returns
    -------
    list of BoardView
        In the order of the images.
    """
    if not found.views:
        return []
    features = np.array([_features(view.corners, found.size) for view in found.views])
    chosen = [int(np.argmax(features[:, 2]))]
    distance = np.linalg.norm(features - features[chosen[0]], axis=1)
    while len(chosen) < most:
        farthest = int(np.argmax(distance))
        if distance[farthest] < _LEAST_DIFFERENCE:
            break
        chosen.append(farthest)
        distance = np.minimum(distance, np.linalg.norm(features - features[farthest], axis=1))
    return [found.views[i] for i in sorted(chosen)]


def _features(corners: FloatArray, size: tuple[int, int]) -> FloatArray:
    """Describe a view by numbers of about 0 to 1: centre, size, and moments that show slant."""
    scale = float(np.hypot(*size))
    centre = corners.mean(axis=0)
    centred = (corners - centre) / scale
    width, height = float(np.ptp(centred[:, 0])), float(np.ptp(centred[:, 1]))
    spread = np.sqrt((centred**2).sum(axis=1).mean())
    # The second moments show turning and foreshortening, the third ones perspective.
    x, y = (centred / spread).T
    second = [float((x * x - y * y).mean()), float((x * y).mean())]
    square = x * x + y * y
    third = [float((x * square).mean()), float((y * square).mean())]
    return np.array([*(centre / scale), np.sqrt(width * height), *(0.3 * np.array(second + third))])


def _images(
    source: Path, every: int | None, result: BoardViews
) -> Iterator[tuple[str, ByteArray | ImageError]]:
    if every is not None and every < 1:
        raise SettingsError(f"every {every} images makes no sense; give 1 or more")
    if source.is_dir():
        paths = image_files(source)[:: every or 1]
        if not paths:
            raise DatasetError(f"no images in {source}; give a folder of images, or a video")
        for path in paths:
            try:
                yield path.name, read_image(path, rgb=False)
            except ImageError as error:
                yield path.name, error
        return
    if not source.exists():
        raise DatasetError(f"{source} does not exist; give a video or a folder of images")
    reader = VideoReader(source)
    result.fps = reader.fps or None
    step = every or max(1, round(reader.fps / _PER_SECOND))
    for index, image in enumerate(reader.frames(step)):
        yield f"frame {index * step}", image
    reader.close()


def _check_size(source: str | Path, name: str, size: tuple[int, int], result: BoardViews) -> None:
    if result.size == (0, 0):
        result.size = size
    if size != result.size:
        raise DatasetError(
            f"{name} of {source} is {size[0]} x {size[1]}, the images before it "
            f"{result.size[0]} x {result.size[1]}; a calibration is for one size"
        )


def _grey(image: ByteArray) -> ByteArray:
    if image.ndim == 2:
        return image
    code = cv2.COLOR_BGR2GRAY if image.shape[2] == 3 else cv2.COLOR_BGRA2GRAY
    return np.asarray(cv2.cvtColor(image, code), dtype=np.uint8)

# SPDX-License-Identifier: BSD-3-Clause
"""Video files."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from orbslam2py._arguments import index_of
from orbslam2py._arrays import ByteArray, FloatArray
from orbslam2py._files import IMAGE_SUFFIXES
from orbslam2py.datasets.base import Images, Stamps
from orbslam2py.datasets.choose_settings import SettingsChoice
from orbslam2py.datasets.frames import FramesInOrder
from orbslam2py.datasets.gopro import read_gopro_imu
from orbslam2py.datasets.images import open_video
from orbslam2py.datasets.imu import ImuSamples, first_file
from orbslam2py.datasets.imu_csv import read_imu_csv
from orbslam2py.datasets.time_files import stamps_of_rate, stamps_of_seconds
from orbslam2py.datasets.unposed import UnposedSource, chosen_stamps
from orbslam2py.errors import DatasetError, ImageError
from orbslam2py.settings import ImuSettings, Sensor, Settings, read_imu_settings

_log = logging.getLogger(__name__)

#: So much may be missing untold [s; share of the length]: sound may last a little longer.
_MISSING, _MISSING_SHARE = 0.25, 0.03
#: A file that says it has more frames does not know.
_MOST_FRAMES = 1e9


class VideoReader:
    """Frames of a video file by their number, exact for any distance of its key frames.

    Frames are decoded one after the other. Going forward decodes the frames between, going back
    starts at the beginning: a seek in compressed video may end at another frame.

    Parameters
    ----------
    path
        Any file that OpenCV's video input reads.

    Raises
    ------
    DatasetError
        If there is no such file, it is no video, or its path is not UTF-8.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        if not self.path.is_file():
            raise DatasetError(f"video {self.path} does not exist; check the path")
        self._capture = self._open()
        self._next = 0
        #: Frames per second in the file; 0 if it does not.
        self.fps = _rate(self._capture)

    def scan(self) -> FloatArray:
        """Decode the file once and return the time of every frame in seconds, float64 (n,).

        The number of frames in a file's header is often wrong; a warning says if many are missing.

        Raises
        ------
        DatasetError
            If there are no frames.
        """
        self._rewind()
        seconds = []
        while self._capture.grab():
            seconds.append(self._capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3)
        promised = self._promised_seconds()
        self._rewind()
        if not seconds:
            raise self._no_frames()
        if self.fps:
            found = max(seconds[-1] - seconds[0], len(seconds) / self.fps)
            if promised - found > max(_MISSING, _MISSING_SHARE * promised):
                _log.warning(
                    "%s says it lasts %.1f s, but its pictures end after %.1f s (%d frames): it "
                    "was cut off or damaged, unless its sound lasts longer or it was trimmed",
                    *(self.path, promised, found, len(seconds)),
                )
        return np.array(seconds, dtype=np.float64)

    def _promised_seconds(self) -> float:
        """Return the length in the file's header; 0 if there is none."""
        n_frames = self._capture.get(cv2.CAP_PROP_FRAME_COUNT)
        known = math.isfinite(n_frames) and 0 < n_frames < _MOST_FRAMES and self.fps
        return n_frames / self.fps if known else 0.0

    def read(self, index: int) -> ByteArray:
        """Decode a frame.

        Parameters
        ----------
        index
            Number of the frame in the video, from 0.

        Returns
        -------
        ByteArray
            (h, w, 3) in the order BGR, or (h, w).

        Raises
        ------
        ImageError
            If it cannot be decoded.
        """
        if index < self._next:
            self._rewind()
        good = True
        while good and self._next <= index:
            good = bool(self._capture.grab())
            self._next += 1
        good, image = self._capture.retrieve() if good else (False, None)
        if not good or image is None:
            raise ImageError(f"frame {index} of video {self.path} cannot be decoded")
        if image.dtype != np.uint8:
            raise ImageError(f"video {self.path} has {image.dtype} pixels; 8 bits are needed")
        return np.asarray(image, dtype=np.uint8)

    def frames(self, step: int = 1) -> Iterator[ByteArray | ImageError]:
        """Yield every `step`-th frame from the beginning, or an error for a bad one.

        Parameters
        ----------
        step
            1 for all frames, 2 for every second one.

        Yields
        ------
        ByteArray or ImageError
            (h, w, 3) in the order BGR, or (h, w).

        Raises
        ------
        DatasetError
            If there are no frames.
        """
        self._rewind()
        while self._capture.grab():
            self._next += 1
            if (self._next - 1) % step:
                continue
            good, image = self._capture.retrieve()
            if good and image is not None:
                yield np.asarray(image, dtype=np.uint8)
            else:
                yield ImageError(f"frame {self._next - 1} of {self.path} cannot be decoded")
        if not self._next:
            raise self._no_frames()

    def close(self) -> None:
        """Close the file."""
        self._capture.release()

    def _no_frames(self) -> DatasetError:
        return DatasetError(f"video {self.path} has no frames that can be decoded")

    def _open(self) -> cv2.VideoCapture:
        if self.path.suffix.lower() in IMAGE_SUFFIXES:
            raise DatasetError(f"{self.path} is an image, no video; give the folder it is in")
        capture = open_video(self.path)
        if not capture.isOpened():
            raise DatasetError(
                f"{self.path} is no video that can be read; convert it, for example to MP4 (H.264)"
            )
        return capture

    def _rewind(self) -> None:
        if self._next or self._capture.get(cv2.CAP_PROP_POS_FRAMES):
            self._capture.release()
            self._capture = self._open()
        self._next = 0


def _rate(capture: cv2.VideoCapture) -> float:
    fps = float(capture.get(cv2.CAP_PROP_FPS))
    return fps if math.isfinite(fps) and 0 < fps <= 1e5 else 0.0


class VideoSequence(FramesInOrder, UnposedSource):
    """The frames of a video file; see `datasets.base.Sequence`.

    Parameters
    ----------
    path
        The file.
    sensor
        Monocular; if frames are split also stereo, the default then.
    settings
        Settings, a file or a built-in name.
    fps
        Frames per second; by default the time stamps of the file count.
    times
        File with one time stamp per frame.
    split
        Whether the left and right half of every frame are the left and right view.

    Raises
    ------
    DatasetError
        If the file is no video or has no frames, or the time stamps do not fit.
    SettingsError
        If there are no settings, or they are invalid.
    """

    layout = "video"

    def __init__(
        self,
        path: str | Path,
        sensor: Sensor | str | None = None,
        *,
        settings: SettingsChoice = None,
        fps: float | None = None,
        times: str | Path | None = None,
        split: bool = False,
    ) -> None:
        self._reader = VideoReader(path)
        self.path = self._reader.path
        super().__init__(self.path, self.path.stem, sensor, settings, fps, split)
        own = self._reader.scan()
        self.check_size(self._reader.read(0))
        if fps is None and times is None:
            self._stamps = self._own_stamps(own)
        else:
            self._stamps = chosen_stamps(len(own), fps, times, 0.0, rate=self.settings.camera.fps)

    def __len__(self) -> int:
        return len(self._stamps.texts)

    @property
    def timestamps(self) -> FloatArray:
        """Time of every frame in seconds, float64 (n,); read-only."""
        return self._stamps.seconds

    def timestamp_text(self, index: int, /) -> str:
        """Return the time of a frame in seconds."""
        return self._stamps.texts[index_of(index, len(self))]

    def default_settings(self) -> Settings:
        """Return the settings; a video has none of its own."""
        return self.settings

    def load(self, index: int, /) -> Images:
        """Decode a frame; see `datasets.base.Sequence.load`. Fast only in order."""
        return self._delivered(self._reader.read(index_of(index, len(self))))

    def imu(self) -> ImuSamples | None:
        """Read the samples of the IMU: those of a GoPro video, or of a table beside the video.

        The table is ``VIDEO.imu.csv`` or ``imu.csv``; see `read_imu_csv`. Its times must be on the
        clock of `timestamps`.

        Raises
        ------
        DatasetError
            If there are samples that cannot be read.
        """
        table = first_file(self._beside("csv"))
        return read_gopro_imu(self.path) if table is None else read_imu_csv(table)

    def imu_settings(self) -> ImuSettings | None:
        """Read ``VIDEO.imu.yaml`` or ``imu.yaml`` beside the video; None if there are none.

        Raises
        ------
        SettingsError
            If they are wrong.
        """
        path = first_file(self._beside("yaml"))
        return None if path is None else read_imu_settings(path)

    def _beside(self, suffix: str) -> tuple[Path, Path]:
        return self.path.with_suffix(f".imu.{suffix}"), self.path.parent / f"imu.{suffix}"

    def _own_stamps(self, seconds: FloatArray) -> Stamps:
        if np.isfinite(seconds).all() and (np.diff(seconds) > 0).all():
            return stamps_of_seconds(seconds)
        if not self._reader.fps:
            raise DatasetError(
                f"video {self.path} contains neither time stamps nor a frame rate; give --fps"
            )
        _log.warning(
            "the time stamps of %s do not grow; taking a constant %g frames per second",
            self.path,
            self._reader.fps,
        )
        return stamps_of_rate(len(seconds), self._reader.fps)

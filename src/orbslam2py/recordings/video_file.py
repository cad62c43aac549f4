# SPDX-License-Identifier: BSD-3-Clause
"""Pictures into a video file, by the FFmpeg in OpenCV."""

from __future__ import annotations

import os
from pathlib import Path

import cv2

from orbslam2py._arrays import ByteArray
from orbslam2py._files import utf8_path
from orbslam2py.datasets.images import open_video, quiet_opencv
from orbslam2py.errors import OutputFileError
from orbslam2py.recordings.output_file import OutputFile

#: Codecs by the ending of the name, as FFmpeg calls them. All wheels of OpenCV have them.
CODECS = {".mp4": "mp4v", ".mov": "mp4v", ".mkv": "mp4v", ".avi": "MJPG", ".webm": "VP80"}
#: Number of pictures after which the free space is checked again.
_LOOK = 8


class VideoFile:
    """Writes pictures one after the other.

    Parameters
    ----------
    path : str or Path
        Ends with ``.mp4``, ``.mov``, ``.mkv``, ``.avi`` or ``.webm``. It appears when it is closed;
        it replaces an existing file.
    size : (int, int)
        Width and height of the pictures [px], both even.
    frames_per_second : float
        Frames per second.

    Raises
    ------
    OutputFileError
        If the video certainly cannot be written.
    """

    def __init__(
        self, path: str | os.PathLike[str], size: tuple[int, int], frames_per_second: float
    ) -> None:
        self._file = OutputFile(path, "video", CODECS)
        self.n_frames = 0
        suffix = self._file.path.suffix.lower()
        codec = cv2.VideoWriter.fourcc(*CODECS[suffix])
        place = utf8_path(self._file.temporary, OutputFileError)
        with quiet_opencv():
            self._writer = cv2.VideoWriter(place, cv2.CAP_FFMPEG, codec, frames_per_second, size)
        self._open = self._writer.isOpened()
        if not self._open:
            self._file.discard()
            raise self._file.error(
                f"this OpenCV has no encoder for {suffix} files; take another ending, such as .avi"
            )

    @property
    def path(self) -> Path:
        """Path of the file."""
        return self._file.path

    def write(self, picture: ByteArray) -> None:
        """Append a picture, (h, w, 3) RGB.

        Raises
        ------
        OutputFileError
            If the disk is nearly full. The pictures so far are kept: close the file.
        """
        if self.n_frames % _LOOK == 0:
            self._file.require_room()
        self._writer.write(cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))
        self.n_frames += 1

    def close(self) -> None:
        """Finish the file and give it its name; without a picture there is none.

        Raises
        ------
        OutputFileError
            If it is not a valid video; an existing file is kept.
        """
        if not self._open:
            return
        self._open = False
        self._writer.release()
        try:
            if self.n_frames:
                # OpenCV does not report failed writing, so the file is read as a test.
                if not _is_video(self._file.temporary):
                    raise self._file.error("no whole file has come to the disk; is it full?")
                self._file.publish()
        finally:
            self._file.discard()


def _is_video(path: Path) -> bool:
    with quiet_opencv():
        video = open_video(path, OutputFileError)
        try:
            return bool(video.isOpened() and video.read()[0])
        finally:
            video.release()

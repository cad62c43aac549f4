# SPDX-License-Identifier: BSD-3-Clause
"""A video file that appears when it is whole."""

from __future__ import annotations

import contextlib
import os
import secrets
import shutil
from pathlib import Path

import cv2

from orbslam2py._arrays import ByteArray
from orbslam2py._files import reason_of
from orbslam2py.datasets.images import quiet_opencv
from orbslam2py.errors import OrbSlamError

#: Codecs by the ending of the name, as FFmpeg in OpenCV calls them. All wheels of OpenCV have them.
CODECS = {".mp4": "mp4v", ".mov": "mp4v", ".mkv": "mp4v", ".avi": "MJPG", ".webm": "VP80"}
#: So much is left free on a disk, for what else a run has to write [bytes].
RESERVE = 32 * 2**20
#: Looks at the free space happen once in so many pictures.
_LOOK = 8


class VideoFileError(OrbSlamError):
    """A video cannot be written."""


class VideoFile:
    """Writes pictures one after the other.

    They go to a hidden file in the same folder, which gets its name when it is closed. The disk is
    never filled to the brim: the last part of a video is what makes it readable.

    Parameters
    ----------
    path : str or Path
        Ends with ``.mp4``, ``.mov``, ``.mkv``, ``.avi`` or ``.webm``.
    size : (int, int)
        Width and height of the pictures [px], both even.
    frames_per_second : float
        How fast it is played.

    Raises
    ------
    VideoFileError
        If it can be told already that there will be no video.
    """

    def __init__(
        self, path: str | os.PathLike[str], size: tuple[int, int], frames_per_second: float
    ) -> None:
        self.path = Path(path)
        check_video_path(self.path)
        self.n_frames = 0
        token = f"{os.getpid()}-{secrets.token_hex(4)}"
        target = Path(os.path.realpath(self.path))
        self._target = target
        self._temporary = target.with_name(f".{target.stem}.{token}.tmp{target.suffix.lower()}")
        codec = cv2.VideoWriter.fourcc(*CODECS[target.suffix.lower()])
        with quiet_opencv():
            self._writer = cv2.VideoWriter(
                str(self._temporary), cv2.CAP_FFMPEG, codec, frames_per_second, size
            )
        self._open = True
        if not self._writer.isOpened():
            self.discard()
            raise VideoFileError(
                f"cannot write the video {self.path}: this OpenCV has no encoder for "
                f"{target.suffix} files; take another ending, .avi for example"
            )

    def write(self, picture: ByteArray) -> None:
        """Append a picture, (h, w, 3) RGB.

        Raises
        ------
        VideoFileError
            If the disk is about to be full. What was written stays: close the file.
        """
        if self.n_frames % _LOOK == 0 and free_bytes(self._temporary.parent) < RESERVE:
            raise VideoFileError(_no_room(self.path))
        self._writer.write(cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))
        self.n_frames += 1

    def close(self) -> None:
        """Finish the file and give it its name; nothing if it is closed.

        Raises
        ------
        VideoFileError
            If it has not become a video; a file that was there before is kept.
        """
        if not self._open:
            return
        self._open = False
        self._writer.release()
        if self.n_frames == 0:
            self.discard()
            return
        try:
            # OpenCV does not tell when writing fails, so what was written is counted.
            if not _is_video(self._temporary):
                raise VideoFileError(
                    f"cannot write the video {self.path}: what has come to the disk is no whole "
                    "file; is it full?"
                )
            self._temporary.replace(self._target)
        except OSError as error:
            why = f"cannot write the video {self.path}: {reason_of(error)}"
            raise VideoFileError(why) from error
        finally:
            self.discard()

    def discard(self) -> None:
        """Drop what was written and has no name yet."""
        self._open = False
        self._writer.release()
        with contextlib.suppress(OSError):
            self._temporary.unlink()


def check_video_path(path: str | os.PathLike[str]) -> None:
    """See that a video can be written to a place.

    Raises
    ------
    VideoFileError
        Naming what is wrong with it, and the remedy.
    """
    path = Path(path)
    if path.suffix.lower() not in CODECS:
        *others, last = CODECS
        raise VideoFileError(
            f"{path} does not end like a video; name it with {', '.join(others)} or {last}"
        )
    folder = path.parent
    if path.is_dir():
        raise VideoFileError(f"{path} is a folder; give the name of a file")
    if not folder.is_dir():
        raise VideoFileError(
            f"there is no folder {folder} for the video {path.name}; make it first"
        )
    if not os.access(folder, os.W_OK):
        raise VideoFileError(f"cannot write into {folder}; take another folder for {path.name}")
    if free_bytes(folder) < RESERVE:
        raise VideoFileError(_no_room(path))


def free_bytes(folder: Path) -> int:
    """Free space of the disk that a folder is on; 0 if nobody can tell."""
    try:
        return shutil.disk_usage(folder).free
    except OSError:
        return 0


def _no_room(path: Path) -> str:
    return (
        f"the disk of {path} is full: {RESERVE // 2**20} MB are left to the files of the run; "
        "take a place with more room"
    )


def _is_video(path: Path) -> bool:
    with quiet_opencv():
        video = cv2.VideoCapture(str(path))
        try:
            return bool(video.isOpened() and video.read()[0])
        finally:
            video.release()

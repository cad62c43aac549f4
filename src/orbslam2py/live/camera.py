# SPDX-License-Identifier: BSD-3-Clause
"""A webcam by its number."""

from __future__ import annotations

from collections.abc import Callable

from orbslam2py.datasets.choose_settings import SettingsChoice
from orbslam2py.live.capture import Capture, webcam
from orbslam2py.live.device import Request
from orbslam2py.live.stream import LiveStream
from orbslam2py.settings import Sensor, Settings, resolve_settings


class LiveCamera(LiveStream):
    """A camera of this machine, read in a thread of its own; see `datasets.LiveSource`.

    There is room for one image: a newer one takes its place, so that a slow reader is never
    behind; `n_dropped` counts the images that were lost that way.

    Parameters
    ----------
    number
        Number of the camera among those of the machine, from 0.
    sensor
        Monocular; if images are split also stereo, the default then.
    settings
        Settings, a file or a built-in name. The camera is asked for their image size, or for twice
        their width if images are split.
    fps
        Images per second that the camera is asked for; by default it decides.
    open_capture
        Opens a camera by its number; ``cv2.VideoCapture`` if None.
    split
        Whether every image holds the left view in its left half, the right view in its right half.
    patience
        Seconds to wait for a lost camera before `take` raises; None: as long as it takes.

    Raises
    ------
    SettingsError
        If there are no settings, or they are wrong.

    Examples
    --------
    >>> with LiveCamera(0, settings="my_camera.yaml") as camera:  # doctest: +SKIP
    ...     for frame in camera:
    ...         slam.track_monocular(frame.images.image, frame.timestamp)
    """

    def __init__(
        self,
        number: int,
        sensor: Sensor | str | None = None,
        *,
        settings: SettingsChoice = None,
        fps: float | None = None,
        open_capture: Callable[[int], Capture] | None = None,
        split: bool = False,
        patience: float | None = None,
    ) -> None:
        self.number = number
        if settings is not None:
            usual = Sensor.STEREO if split else Sensor.MONOCULAR
            settings = resolve_settings(settings, usual if sensor is None else Sensor(sensor))
        request = Request(fps=fps, size=requested_size(settings, split=split), split=split)
        super().__init__(
            webcam(number, request, open_capture=open_capture),
            sensor,
            settings=settings,
            fps=fps,
            split=split,
            room=1,
            patience=patience,
        )


def requested_size(settings: Settings | None, *, split: bool) -> tuple[int, int] | None:
    """Return the size of the images that fit settings; None if they do not give it."""
    if settings is None or settings.camera.width is None or settings.camera.height is None:
        return None
    return (1 + split) * settings.camera.width, settings.camera.height

# SPDX-License-Identifier: BSD-3-Clause
"""Common parts of sequences without a list: images are paired by their names."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from pathlib import Path

from orbslam2py.datasets.base import Stamps
from orbslam2py.datasets.recorded import RecordedSequence
from orbslam2py.datasets.time_files import stamps_of_names
from orbslam2py.datasets.unposed import chosen_stamps, with_rate
from orbslam2py.settings import Settings
from orbslam2py.trajectory import Trajectory


class UnlistedSequence(RecordedSequence):
    """Images of one or two cameras without a list; see `RecordedSequence`.

    A subclass sets these attributes, and then calls `_choose_times`.
    """

    #: Images per second that the user gave.
    _fps: float | None
    #: The (left or colour) image of every frame.
    _paths: list[Path]
    #: Its right image or its depth; empty if the images are used alone.
    _partners: list[Path]

    @cached_property
    def settings(self) -> Settings:
        """The settings the caller chose, or `default_settings`, with the rate that was given."""
        chosen = self.default_settings() if self._chosen is None else self._chosen
        if self._fps is None:
            return chosen
        return replace(chosen, camera=with_rate(chosen.camera, self._fps))

    def image_path(self, index: int, /) -> Path:
        """Return the file of the (left) image of a frame."""
        return self._paths[index]

    def ground_truth(self) -> Trajectory | None:
        """Return None: there are no true poses."""
        return None

    def _files(self, index: int) -> tuple[Path, ...]:
        if not self._partners:
            return (self._paths[index],)
        return self._paths[index], self._partners[index]

    def _choose_times(self, names: list[Path], times: str | Path | None) -> str:
        """Set the time stamps, and log their source.

        Parameters
        ----------
        names
            Names of the frames, which may be times.
        times
            File with one time stamp per image, or None.
        """
        otherwise: Stamps | float = 0.0  # not needed, and there may be no settings yet
        source = "are the given ones"
        if self._fps is None and times is None:
            own = stamps_of_names(names)
            otherwise = own or self.settings.camera.fps
            source = "are their names" if own else f"count {otherwise:g} images per second"
        files = [path.name for path in self._paths]
        rate = None if times is None else self.known_rate()
        self._stamps = chosen_stamps(len(files), self._fps, times, otherwise, files, rate)
        return source

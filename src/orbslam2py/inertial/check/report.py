# SPDX-License-Identifier: BSD-3-Clause
"""Result of the check of an IMU."""

from __future__ import annotations

from dataclasses import dataclass, field

from orbslam2py.inertial.check.gravity import GravityFit
from orbslam2py.inertial.check.rates import RateFit


@dataclass(frozen=True)
class Finding:
    """One fault of an IMU, or of its settings.

    Attributes
    ----------
    kind
        A short name: ``time_offset``, ``axes``, ``inverse``, ``rotation``, ``degrees``, ``g``,
        ``scale``, ``swapped``, ``dead``, ``saturated``, ``sign`` or ``unrelated``.
    text
        The fault and the likely remedy.
    share
        Share of the samples that show it, 0 to 1.
    """

    kind: str
    text: str
    share: float = 1.0


@dataclass
class ImuReport:
    """What `check_imu` found.

    Attributes
    ----------
    faults
        All faults; none if the IMU fits.
    notes
        The measurements, one sentence each.
    open_questions
        What could not be checked, and why.
    rates
        The gyro beside the camera; None if it could not be compared.
    gravity
        The accelerometer beside the path; None if it could not be compared.
    """

    faults: list[Finding] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    open_questions: list[str] = field(default_factory=list)
    rates: RateFit | None = None
    gravity: GravityFit | None = None

    @property
    def fits(self) -> bool:
        """Whether no fault was found."""
        return not self.faults

    def blame(self, kind: str, text: str, share: float = 1.0) -> None:
        """Add a fault."""
        self.faults.append(Finding(kind, text, share))

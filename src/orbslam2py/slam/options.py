# SPDX-License-Identifier: BSD-3-Clause
"""What a system is asked for, beside its camera."""

from __future__ import annotations

import math
from dataclasses import dataclass

from orbslam2py.errors import SettingsError


@dataclass(frozen=True)
class SystemOptions:
    """How a `System` works. Each is also a keyword of its constructor, which describes them.

    Raises
    ------
    SettingsError
        If the time limit is not more than 0, or given for the deterministic mode.
    """

    deterministic: bool = False
    wait_for_mapping: bool = False
    loop_closing: bool = True
    full_adjustment: bool = True
    full_adjustment_time_limit: float | None = None
    seed: int = 0
    check_calibration: bool = True

    def __post_init__(self) -> None:
        seconds = self.full_adjustment_time_limit
        if seconds is None:
            return
        if not (math.isfinite(seconds) and seconds > 0):
            raise SettingsError(
                f"the time limit of the full adjustment must be more than 0 s, got {seconds}"
            )
        if self.deterministic:
            raise SettingsError(
                "deterministic mode takes no time limit for the full adjustment: what is reached "
                "in a given time differs from run to run"
            )

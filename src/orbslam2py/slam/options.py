# SPDX-License-Identifier: BSD-3-Clause
"""What a system is asked for, beside its camera."""

from __future__ import annotations

import math
from dataclasses import dataclass

from orbslam2py._arguments import choice_of, is_number, seed_of, shown
from orbslam2py.errors import SettingsError


@dataclass(frozen=True)
class SystemOptions:
    """How a `System` works. Each is also a keyword of its constructor, which describes them.

    Raises
    ------
    SettingsError
        If a switch is not True or False, the seed is no whole number from 0 to 2^64 - 1, or the
        time limit is not more than 0 or given for the deterministic mode.
    """

    deterministic: bool = False
    wait_for_mapping: bool = False
    loop_closing: bool = True
    full_adjustment: bool = True
    full_adjustment_time_limit: float | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        object.__setattr__(self, "seed", seed_of(self.seed))
        for name in ("deterministic", "wait_for_mapping", "loop_closing", "full_adjustment"):
            object.__setattr__(self, name, choice_of(getattr(self, name), name))
        seconds = self.full_adjustment_time_limit
        if seconds is None:
            return
        if not (is_number(seconds) and math.isfinite(seconds) and seconds > 0):
            raise SettingsError(
                "the time limit of the full adjustment must be more than 0 s, got "
                f"{shown(seconds)}; give seconds, or leave it out"
            )
        if self.deterministic:
            raise SettingsError(
                "deterministic mode takes no time limit for the full adjustment: what is reached "
                "in a given time differs from run to run; leave the limit out"
            )

# SPDX-License-Identifier: BSD-3-Clause
"""Varied keys of settings and configuration: a grid of all combinations, or random values."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from orbslam2py._arguments import choice_of, is_number, is_whole, seed_of, shown
from orbslam2py.errors import SettingsError
from orbslam2py.settings import Settings
from orbslam2py.settings.keys import KEYS, Key, Rule, convert, nearest, nearest_key
from orbslam2py.slam.config import Config, all_values

_NOT_NEGATIVE = Rule("a number from 0 on", lambda value: value >= 0)
_CONFIG_KEYS = {
    name: Key(name, "config", name, type(value), _NOT_NEGATIVE)
    for name, value in all_values(Config())
}
#: Names of the configuration's values.
CONFIG_NAMES = frozenset(_CONFIG_KEYS)
_KEYS = {key.name: key for key in KEYS} | _CONFIG_KEYS
_RANGE_KEYS = ("from", "to", "log")
#: What a sweep holds beside keys of the settings.
_OTHER_KEYS = ("random", "seed")


#: Draws for each one that is wanted, until there are said to be no more different ones.
_DRAWS_IN_VAIN = 20


@dataclass(frozen=True)
class Sweep:
    """Points in the space of some keys of the settings.

    Attributes
    ----------
    grid
        Values by key.
    ranges
        Lower and upper end by key, and whether values are uniform in the logarithm.
    n_draws
        Number of random points; 0: all points of the grid.
    seed
        Seed of the draws.
    """

    grid: tuple[tuple[str, tuple[float, ...]], ...] = ()
    ranges: tuple[tuple[str, float, float, bool], ...] = ()
    n_draws: int = 0
    seed: int = 0

    def points(self) -> Iterator[tuple[tuple[str, float], ...]]:
        """Yield the values of each point; one empty point if nothing is varied.

        Points differ; there are fewer than requested if fewer different ones exist.
        """
        if not self.n_draws:
            names = [name for name, _ in self.grid]
            for values in itertools.product(*(values for _, values in self.grid)):
                yield tuple(zip(names, values, strict=True))
            return
        random = np.random.default_rng(self.seed)
        drawn: set[tuple[tuple[str, float], ...]] = set()
        left = self.n_draws + _DRAWS_IN_VAIN * (self.n_draws + 50)
        while len(drawn) < self.n_draws and left > 0:
            left -= 1
            point = [(name, values[random.integers(len(values))]) for name, values in self.grid]
            for name, low, high, even_in_logarithm in self.ranges:
                if even_in_logarithm:
                    value = math.exp(random.uniform(math.log(low), math.log(high)))
                else:
                    value = float(random.uniform(low, high))
                point.append((name, _rounded(name, value)))
            new = tuple(sorted(point))
            if new not in drawn:  # equal ones would be the same run
                drawn.add(new)
                yield new


def read_sweep(values: Any) -> Sweep:
    """Read the section ``sweep`` of a job file.

    Parameters
    ----------
    values
        Keys of the settings with a list of values, or with ``from`` and ``to`` (and ``log: true``);
        ``random`` with the number of points, and ``seed``.

    Raises
    ------
    SettingsError
        If a key is unknown, or values are invalid or not allowed.
    """
    if not isinstance(values, Mapping) or not set(values) - set(_OTHER_KEYS):
        is_other = values is not None and not isinstance(values, Mapping)
        found = shown(values) if is_other else "empty" if not values else "without a key"
        raise SettingsError(f"sweep is {found}; give 'KEY: [VALUE, ...]' with keys of the settings")
    n_draws = values.get("random", 0)
    if not is_whole(n_draws) or n_draws < 0:
        raise SettingsError(f"sweep: random is {shown(n_draws)}; give how many draws")
    grid, ranges = [], []
    for name, value in values.items():
        if name in _OTHER_KEYS:
            continue
        if name not in _KEYS:
            near = nearest(str(name), CONFIG_NAMES) or nearest_key(str(name))
            known = "see 'orbslam2py settings show tum1' and 'orbslam2py config'"
            hint = f"did you mean {near}?" if near in _KEYS else known
            raise SettingsError(f"sweep: '{name}' is no key of the settings; {hint}")
        if isinstance(value, Mapping):
            ranges.append((name, *_range(name, value)))
        else:
            grid.append((name, _values(name, value if isinstance(value, list) else [value])))
    if ranges and not n_draws:
        raise SettingsError(
            f"sweep: {ranges[0][0]} has a range; add 'random: N' for N draws, or list its values"
        )
    seed = seed_of(values.get("seed", 0), "sweep: seed")
    sweep = Sweep(tuple(sorted(grid)), tuple(sorted(ranges)), int(n_draws), seed)
    _require_different_draws(sweep)
    return sweep


def with_parameters(settings: Settings, parameters: tuple[tuple[str, float], ...]) -> Settings:
    """Return settings with other values of some keys.

    Raises
    ------
    SettingsError
        If a value is not allowed, or the settings have no such group.
    """
    fields: dict[str, dict[str, Any]] = {}
    for name, value in parameters:
        if name in CONFIG_NAMES:
            continue  # the run's options have it
        key = _KEYS[name]
        if getattr(settings, key.group) is None:
            raise SettingsError(f"{name} is not used by {settings.sensor}; leave it out of sweep")
        fields.setdefault(key.group, {})[key.field] = key.kind(value)
    # All of a group at once: some values are only allowed together with others.
    groups = {name: replace(getattr(settings, name), **new) for name, new in fields.items()}
    return replace(settings, **groups)


def _values(name: str, listed: list[Any]) -> tuple[float, ...]:
    """Take the values of a list."""
    if not listed:
        raise SettingsError(f"sweep: {name} has no values; give a list of numbers")
    values: list[float] = []
    for value in listed:
        if not is_number(value):
            raise SettingsError(f"sweep: a value of {name} is {shown(value)}; give numbers")
        try:
            convert(_KEYS[name], value)
        except OverflowError as error:
            raise SettingsError(
                f"sweep: {name} is {shown(value)}; allowed: {_KEYS[name].allowed}"
            ) from error
        except ValueError as error:
            raise SettingsError(f"sweep: {error}") from error
        if value in values:
            raise SettingsError(f"sweep: {name} has the value {value} twice; leave one out")
        # Numbers of NumPy and others as Python's own, which files can hold.
        values.append(int(value) if is_whole(value) else float(value))
    return tuple(values)


def _require_different_draws(sweep: Sweep) -> None:
    """Refuse more points than there are different ones."""
    n_different = sum(1 for _ in sweep.points()) if sweep.n_draws else 0
    if n_different < sweep.n_draws:
        raise SettingsError(
            f"sweep: of {sweep.n_draws} random draws only {n_different} could be different; draw "
            "fewer, or give more values or wider ranges"
        )


def _range(name: str, value: Mapping[str, Any]) -> tuple[float, float, bool]:
    for wrong in set(value) - set(_RANGE_KEYS):
        raise SettingsError(
            f"sweep: {name} has an unknown key '{wrong}'; there are {', '.join(_RANGE_KEYS)}"
        )
    low, high = (_end(name, which, value.get(which)) for which in ("from", "to"))
    logarithm = choice_of(value.get("log", False), f"sweep: log of {name}")
    if not low < high or (logarithm and low <= 0):
        raise SettingsError(
            f"sweep: {name} goes from {low} to {high}; 'from' must be less than 'to'"
            + (", and above 0 for log" if logarithm else "")
        )
    return low, high, logarithm


def _end(name: str, which: str, value: Any) -> float:
    """Take an end of a range."""
    key = _KEYS[name]
    if value is None or not is_number(value):
        wrong = f"has no '{which}'" if value is None else f"goes {which} {shown(value)}"
        raise SettingsError(f"sweep: {name} {wrong}; give numbers 'from' and 'to'")
    try:
        end = float(value)
    except OverflowError:
        end = math.inf
    if not math.isfinite(end) or not key.rule.allows(end):
        raise SettingsError(f"sweep: {name} goes {which} {shown(value)}; allowed: {key.allowed}")
    return end


def _rounded(name: str, value: float) -> float:
    """Return whole numbers for keys that need them, else four digits for short names."""
    return round(value) if _KEYS[name].kind is int else float(f"{value:.4g}")

# SPDX-License-Identifier: BSD-3-Clause
"""Sizes in bytes, in the usual form: ``20GB``."""

from __future__ import annotations

import math
import re

from orbslam2py._arguments import shown
from orbslam2py.errors import SettingsError

_UNITS = {"TB": 10**12, "GB": 10**9, "MB": 10**6, "KB": 10**3, "B": 1}
_BINARY_UNITS = {"TIB": 2**40, "GIB": 2**30, "MIB": 2**20, "KIB": 2**10}
_SIZE = re.compile(r"\s*([0-9]+(?:\.[0-9]+)?)\s*((?:[KMGT]I?)?B?)\s*", re.IGNORECASE)


def bytes_of(size: str | int, what: str, example: str, least: int = 1) -> int:
    """Read a size such as ``20GB`` or ``20GiB``.

    Parameters
    ----------
    size
        The text; a number alone is in bytes.
    what
        Its name, for the message.
    example
        A size to give.
    least
        The smallest useful size, in bytes.

    Raises
    ------
    SettingsError
        If it is no size, or too small.
    """
    found = _SIZE.fullmatch(str(size))
    if found:
        unit = found[2].upper()
        unit = unit if unit.endswith("B") else f"{unit}B"
        value = float(found[1]) * (_UNITS | _BINARY_UNITS)[unit]
        if math.isfinite(value) and round(value) >= max(least, 1):
            return round(value)
    enough = f", at least {text_of(least)}" if least > 1 else ""
    raise SettingsError(f"{what} is {shown(size)}; give one such as {example}{enough}")


def text_of(size: int) -> str:
    """Write a size with three digits: ``1.5 GB``."""
    unit = next((unit for unit in _UNITS if size >= _UNITS[unit]), "B")
    return f"{size / _UNITS[unit]:.3g} {unit}"

# SPDX-License-Identifier: BSD-3-Clause
"""Checks of arguments at the interface: a wrong type gets an error with the remedy.

Otherwise the error would appear deep inside, as a bare `TypeError` about an unknown object.
"""

from __future__ import annotations

import errno
import math
import numbers
import os
from enum import Enum
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from orbslam2py.errors import DatasetError, OrbSlamError, SettingsError, StateError

#: Seeds are unsigned 64-bit numbers in the core.
LARGEST_SEED = 2**64 - 1
_LONGEST = 60
#: How far the product of a rotation and its transpose may be from the identity: a few digits do.
_ROTATION_TOLERANCE = 1e-2

_Kind = TypeVar("_Kind")
_Member = TypeVar("_Member", bound=Enum)


def shown(value: object) -> str:
    """Describe a value in a few words for a message: ``None``, ``a dict``, ``'abc'``."""
    if value is None or isinstance(value, bool | numbers.Number | str):
        try:
            text = repr(value)
        except ValueError:  # of more digits than Python writes out
            return "a number of thousands of digits"
        return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 3]}..."
    name = type(value).__name__
    if name == "bytes":
        return name
    return f"{'an' if name[0].lower() in 'aeiou' else 'a'} {name}"


def is_whole(value: object) -> bool:
    """Return whether a value is a whole number, Python's or NumPy's, but not True or False."""
    return isinstance(value, numbers.Integral) and not isinstance(value, bool)


def is_number(value: object) -> bool:
    """Return whether a value is a real number, Python's or NumPy's, but not True or False."""
    return isinstance(value, numbers.Real) and not isinstance(value, bool)


def float_of(value: Any) -> float:
    """Convert a number; a number that no float can hold, such as ``10**400``, becomes infinite."""
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf


def is_finite(value: object) -> bool:
    """Return whether a value is a real number that a float can hold."""
    return is_number(value) and math.isfinite(float_of(value))


def choice_of(value: Any, what: str) -> bool:
    """Take True or False.

    Raises
    ------
    SettingsError
        For any other object: the text ``"no"`` would count as true.
    """
    if not isinstance(value, bool | np.bool_):
        raise SettingsError(f"{what} is {shown(value)}; give True or False")
    return bool(value)


def member_of(
    names: type[_Member], value: object, what: str, error: type[OrbSlamError] = DatasetError
) -> _Member:
    """Take a member of an enumeration, or the name of one.

    Parameters
    ----------
    names
        The enumeration.
    value
        The given object.
    what
        Its name, for the message.
    error
        For any other object; the message lists all names.
    """
    if isinstance(value, str) and value in {one.value for one in names}:
        return names(value)
    choice = ", ".join(str(one.value) for one in names)
    raise error(f"{what} is {shown(value)}; give one of {choice}")


def index_of(value: Any, length: int) -> int:
    """Check the number of a frame in a sequence.

    Raises
    ------
    DatasetError
        For an object that is no whole number.
    IndexError
        If there is no such frame.
    """
    known = f"give a whole number from 0 to {length - 1}"
    if not is_whole(value):
        raise DatasetError(f"the index of the frame is {shown(value)}; {known}")
    if not 0 <= value < length:
        raise IndexError(f"there is no frame {value} among {length}; {known}")
    return int(value)


def finite_number(
    value: Any, what: str, remedy: str, error: type[OrbSlamError] = SettingsError
) -> float:
    """Take a finite number.

    Parameters
    ----------
    value
        The given object.
    what, remedy
        Its name, and the remedy, for the message.
    error
        Raised for anything else.
    """
    if not is_finite(value):
        raise error(f"{what} is {shown(value)}; give {remedy}")
    return float(value)


def instance_of(
    value: Any,
    kind: type[_Kind],
    what: str,
    remedy: str,
    error: type[OrbSlamError],
) -> _Kind:
    """Take an object of a class.

    Parameters
    ----------
    value
        The given object.
    kind
        The class.
    what, remedy
        Its name, and the remedy, for the message.
    error
        Raised for anything else.
    """
    if not isinstance(value, kind):
        raise error(f"{what} is {shown(value)}; give {remedy}")
    return value


def number_above_zero(
    value: Any, what: str, remedy: str, error: type[OrbSlamError] = SettingsError
) -> float:
    """Take a finite number above 0; parameters as of `instance_of`."""
    number = finite_number(value, what, remedy, error)
    if number <= 0:
        raise error(f"{what} is {number:g}; give {remedy}")
    return number


def seed_of(value: Any, what: str = "seed", most: int = LARGEST_SEED) -> int:
    """Take a seed: a whole number from 0.

    Raises
    ------
    SettingsError
        For any other object, also for True and for 1.0.
    """
    if not is_whole(value) or not 0 <= value <= most:
        raise SettingsError(f"{what} is {shown(value)}; give a whole number from 0 to {most}")
    return int(value)


def patience_of(timeout: Any) -> float | None:
    """Take a waiting time in seconds; None means no limit.

    Raises
    ------
    StateError
        For any other object.
    """
    if timeout is None:
        return None
    seconds = float_of(timeout) if is_number(timeout) else math.nan
    if seconds >= 0 and (seconds < math.inf or timeout == math.inf):
        return seconds
    raise StateError(f"timeout is {shown(timeout)}; give seconds from 0, or None to wait for ever")


_REMEDIES = {
    errno.ENOENT: "check the path",
    errno.EISDIR: "give a file, not a folder",
    errno.ENOTDIR: "check the path: a part of it is a file",
    errno.EACCES: "ask for the right to read it, or give another one",
}


def cannot_open(path: object, error: OSError, what: str = "") -> str:
    """Return a message: which file cannot be read, why, and the remedy."""
    named = f"{what} {path}" if what else f"{path}"
    remedy = _REMEDIES.get(error.errno or 0, "give another file")
    return f"cannot open {named}: {error.strerror or error}; {remedy}"


def path_of(value: Any, what: str, error: type[OrbSlamError] = DatasetError) -> Path:
    """Take a path, as text or as a `Path`.

    Raises
    ------
    error
        For any other object, and for text that cannot be the name of a file.
    """
    path = value if isinstance(value, str) else _text_of(value)
    if path is None:
        raise error(f"{what} is {shown(value)}; give a path, as text or as a pathlib.Path")
    if not path or "\0" in path:
        raise error(f"{what} is {path!r}, which is the name of no file; give a path")
    return Path(path)


def _text_of(value: object) -> str | None:
    if not isinstance(value, os.PathLike):
        return None
    text = os.fspath(value)
    return text if isinstance(text, str) else None


def numbers_of(
    value: Any, what: str, error: type[OrbSlamError] = DatasetError, wanted: str = ""
) -> npt.NDArray[np.float64]:
    """Take an array of numbers of any shape, float64; lists of numbers are allowed.

    Raises
    ------
    error
        For any other object; the message names the required shape, if it is given.
    """
    try:
        array = np.asarray(value)
        if array.dtype.kind not in "iuf" and array.size:
            raise TypeError
        return array.astype(np.float64)
    except (TypeError, ValueError):
        shape = wanted and f" of shape {wanted}"
        raise error(f"{what} is {shown(value)}; give an array of numbers{shape}") from None


def array_of(
    value: Any,
    what: str,
    shape: tuple[int, ...],
    error: type[OrbSlamError] = DatasetError,
    *,
    finite: bool = True,
) -> npt.NDArray[np.float64]:
    """Take an array of numbers.

    Parameters
    ----------
    value
        The object; lists of numbers are allowed.
    what
        Its name, for the message.
    shape
        Required shape; -1 allows any length.
    error
        Raised for anything else.
    finite
        Whether all of them must be finite.

    Returns
    -------
    array of float64
        Of that shape.
    """
    wanted = "(" + ", ".join("n" if length < 0 else str(length) for length in shape) + ")"
    array = numbers_of(value, what, error, wanted)
    if array.size == 0 and -1 in shape and array.ndim <= len(shape):
        array = array.reshape([0 if length < 0 else length for length in shape])
    fits = array.ndim == len(shape) and all(
        length in (-1, found) for length, found in zip(shape, array.shape, strict=True)
    )
    if not fits:
        raise error(f"{what} has shape {array.shape}; give {wanted}")
    if finite and not np.isfinite(array).all():
        raise error(f"{what} holds a number that is not finite; leave such entries out")
    return array


def are_poses(T: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
    """Return which transforms (n, 4, 4) are rigid: finite, with a rotation, without reflection."""
    finite = np.asarray(np.isfinite(T).all(axis=(1, 2)))
    T = T.copy()
    T[~finite] = 0.0
    R = T[:, :3, :3]
    with np.errstate(over="ignore", invalid="ignore"):
        off = np.max(np.abs(R @ np.swapaxes(R, 1, 2) - np.eye(3)), axis=(1, 2))
        is_rotation = (off < _ROTATION_TOLERANCE) & (np.linalg.det(R) > 0)
    rigid: npt.NDArray[np.bool_] = finite & is_rotation & (T[:, 3] == (0, 0, 0, 1)).all(axis=1)
    return rigid


def pose_of(
    value: Any, what: str, error: type[OrbSlamError] = SettingsError
) -> npt.NDArray[np.float64]:
    """Take a pose: a rigid transform, float64 (4, 4).

    Raises
    ------
    error
        For any other object, also for a reflection or a change of scale.
    """
    T = array_of(value, what, (4, 4), error)
    if not are_poses(T[None])[0]:
        raise error(
            f"{what} is no pose; give 4 x 4 numbers: a rotation (no mirror, no scale), the "
            "translation beside it, and the last row 0 0 0 1"
        )
    return T


def number_of(count: int, noun: str) -> str:
    """Return a count with its noun: ``1 frame``, ``2 frames``."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"

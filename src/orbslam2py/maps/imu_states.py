# SPDX-License-Identifier: BSD-3-Clause
"""States of an IMU at the keyframes of a map: copied, put back, kept of a part, and checked."""

from __future__ import annotations

import numpy as np

from orbslam2py import _core as core
from orbslam2py._arrays import FloatArray, IntArray
from orbslam2py.errors import MapFileError
from orbslam2py.maps.content_groups import BoolArray, ImuStates, Keyframes

#: Time without a sample [s] at a keyframe that the nearest sample serves for, and the shortest time
#: between two samples: as in ``src/cpp/optimize/inertial_keyframes.cpp``.
_MISSING, _SAME = 1e-3, 1e-6


def take_states(
    keeper: core.InertialKeyframes, keyframes: Keyframes, known: IntArray
) -> tuple[ImuStates, IntArray, BoolArray]:
    """Copy the states of keyframes, and the samples between them.

    Parameters
    ----------
    keeper
        Who has them.
    keyframes
        Of the map.
    known
        (n, 3) versions from an earlier call; the samples of these are left out.

    Returns
    -------
    states : ImuStates
        All of them.
    versions : array of int64, (m, 3)
        Equal for states that are equal.
    changed : array of bool, (m,)
        Whether the version is not known.
    """
    arrays = keeper.take(keyframes.ids, keyframes.timestamps, known)
    versions, changed = arrays.pop("versions"), arrays.pop("changed")
    return ImuStates(**arrays), versions, changed


def put_states(states: ImuStates, keeper: core.InertialKeyframes) -> None:
    """Give the states of an earlier run to who keeps them; what was there before is dropped."""
    keeper.put(**dict(states.arrays()))


def states_of_part(states: ImuStates, keyframes: Keyframes) -> ImuStates:
    """Keep the states of some keyframes, with all samples from one to the next.

    Parameters
    ----------
    states
        Of all keyframes.
    keyframes
        Those that stay.
    """
    if not len(states):
        return states
    keeper = new_keeper()
    put_states(states, keeper)
    return take_states(keeper, keyframes, np.zeros((0, 3), np.int64))[0]


def new_keeper() -> core.InertialKeyframes:
    """Make what keeps states without an IMU that is used."""
    return core.InertialKeyframes(core.Pose(), np.zeros(4))


def check_states(states: ImuStates, ids: IntArray, timestamps: FloatArray) -> None:
    """Raise `MapFileError` with the fault, unless these can be states of keyframes of a map.

    Parameters
    ----------
    states
        The states.
    ids, timestamps
        Of all keyframes, (k,) each.
    """
    _check_lengths(states)
    if (np.diff(states.ids) <= 0).any() or not np.isin(states.ids, ids).all():
        raise MapFileError("a state of the IMU is out of order, or its keyframe is not there")
    times = timestamps[np.searchsorted(ids, states.ids)]
    for row, keyframe in enumerate(states.ids.tolist()):
        state = f"the state of the IMU at keyframe {keyframe}"
        numbers = (*states.velocity[row], *states.bias[row])
        if not (np.isfinite(numbers).all() and np.isfinite(states.scale[row])):
            raise MapFileError(f"{state} has a number that is not finite")
        if states.scale[row] <= 0:
            raise MapFileError(f"{state} has a scale that is not above 0")
        samples = states.samples[states.offsets[row] : states.offsets[row + 1]]
        if len(samples) and not _join(samples, times[row - 1] if row else np.inf, times[row]):
            raise MapFileError(
                f"the samples before {state} are not finite, out of order, or do not reach from "
                "the keyframe before to this one"
            )


def _check_lengths(states: ImuStates) -> None:
    n, offsets = len(states), states.offsets
    shapes = {
        "ids": (n,),
        "velocity": (n, 3),
        "scale": (n,),
        "bias": (n, 6),
        "offsets": (n + 1,),
        "samples": (len(states.samples), 7),
    }
    for name, array in states.arrays():
        kind = np.int64 if name in ("ids", "offsets") else np.float64
        if array.shape != shapes[name] or array.dtype != kind:
            raise MapFileError(f"imu_states.{name} has the wrong type or length")
    ends = offsets[0] == 0 and offsets[-1] == len(states.samples)
    if not ends or (np.diff(offsets) < 0).any():
        raise MapFileError("the states of the IMU count other samples than there are")


def _join(samples: FloatArray, begin: float, end: float) -> bool:
    """Whether samples reach from one time to the other."""
    times = samples[:, 0]
    return bool(
        np.isfinite(samples).all()
        and (np.diff(times) > _SAME).all()
        and times[0] <= begin + _MISSING
        and times[-1] >= end - _MISSING
        and begin < end
    )

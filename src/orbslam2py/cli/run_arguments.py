# SPDX-License-Identifier: BSD-3-Clause
"""Arguments of ``orbslam2py run`` with more than one word or number."""

from __future__ import annotations

from itertools import zip_longest
from typing import Any

import numpy as np
import typer.core

from orbslam2py._arrays import FloatArray
from orbslam2py.errors import DatasetError
from orbslam2py.maps.edits.placement import FARTHEST
from orbslam2py.trajectory.rotations import poses_from, rotations_from_quaternions

#: Numbers of a position, and of a position with a quaternion.
_POSITION, _POSE = 3, 7


class RunCommand(typer.core.TyperCommand):
    """Takes ``--localize`` with and without a number."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Give ``--localize`` the number 0 if none follows."""
        complete: list[str] = []
        for argument, following in zip_longest(args, args[1:], fillvalue=""):
            complete.append(argument)
            if argument == "--localize" and not following.lstrip("-").isdecimal():
                complete.append("0")
        return super().parse_args(ctx, complete)


def read_initial_pose(text: str) -> FloatArray:
    """Read the pose of a camera in the world: a position, and optionally a unit quaternion.

    Returns
    -------
    array (4, 4)
        Camera to world.

    Raises
    ------
    DatasetError
        If it has neither three nor seven numbers, or is impossibly far away.
    """
    try:
        numbers = np.array([float(number) for number in text.split(",")])
    except ValueError:
        numbers = np.zeros(0)
    if len(numbers) == _POSITION:
        numbers = np.append(numbers, [0, 0, 0, 1])
    if len(numbers) != _POSE or not np.isfinite(numbers).all() or not numbers[3:].any():
        raise DatasetError(
            f"--initial-pose {text} is not a pose; give three numbers x,y,z or seven "
            "x,y,z,qx,qy,qz,qw"
        )
    if (np.abs(numbers[:_POSITION]) > FARTHEST).any():
        raise DatasetError(
            f"--initial-pose {text} is too far away to be meant; give a position in the map's "
            f"world, with numbers up to {FARTHEST:g}"
        )
    # Only its direction counts; of very large and very small numbers the squares are none.
    quaternion = numbers[_POSITION:] / np.abs(numbers[_POSITION:]).max()
    T_wc = poses_from(rotations_from_quaternions(quaternion[None]), numbers[None, :_POSITION])
    return np.asarray(T_wc[0])

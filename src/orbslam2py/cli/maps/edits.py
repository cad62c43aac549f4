# SPDX-License-Identifier: BSD-3-Clause
"""``orbslam2py map crop``, ``align`` and ``optimize``: another map file of one."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console

from orbslam2py._arrays import FloatArray
from orbslam2py._text_lines import content_lines, numbers_of
from orbslam2py.cli.calibrate import Force, Quiet
from orbslam2py.cli.maps.true_path import read_true_path
from orbslam2py.cli.messages import log_to
from orbslam2py.cli.targets import check_target
from orbslam2py.errors import MapFileError
from orbslam2py.maps import (
    MapContents,
    Placement,
    SavedMap,
    load_map,
    place_by_length,
    place_by_points,
    place_by_trajectory,
    save_map,
    transform_map,
)
from orbslam2py.maps.edits.crop import inside_box, keyframes_in_box, keyframes_of_times
from orbslam2py.maps.edits.parts import take_map
from orbslam2py.maps.edits.saved import crop_saved_map
from orbslam2py.maps.units import unit_of
from orbslam2py.slam.full_bundle_adjustment import optimize_map

MapFile = Annotated[Path, typer.Argument(help="Map file.")]
MapNumber = Annotated[
    int | None,
    typer.Option(
        "--map", help="Which one, if the file holds several; 0 is the oldest.", metavar="K", min=0
    ),
]
Output = Annotated[Path, typer.Option("--output", "-o", help="Map file to write.")]

_LINE_OF_TIME, _LINE_OF_POSITION = 4, 6


def save_edited(saved: SavedMap, output: Path, *, force: bool) -> None:
    """Write a map file that a command has made."""
    check_target(output, force=force)
    save_map(saved, output)


def crop(
    file: MapFile,
    output: Output,
    begin: Annotated[
        float | None,
        typer.Option("--from", help="Seconds since the first keyframe.", metavar="SECONDS"),
    ] = None,
    end: Annotated[
        float | None,
        typer.Option("--to", help="Seconds since the first keyframe.", metavar="SECONDS"),
    ] = None,
    low: Annotated[
        str | None, typer.Option(help="A corner of a box in the map's world.", metavar="X,Y,Z")
    ] = None,
    high: Annotated[str | None, typer.Option(help="The other corner.", metavar="X,Y,Z")] = None,
    points: Annotated[
        bool,
        typer.Option("--points", help="Drop points outside of the box, too, not only cameras."),
    ] = False,
    number: MapNumber = None,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Keep a part of a map: the keyframes of a time, or whose cameras stood in a box.

    What these see is kept, too; a point that loses observations goes if what is left does not hold
    it. If the first keyframe goes, the next becomes the one that paths are relative to.
    """
    by_time, by_box = not (begin is None and end is None), not (low is None and high is None)
    if by_time == by_box:
        raise MapFileError("say what to keep: either --from and --to, or --low and --high")
    if by_box and (low is None or high is None):
        raise MapFileError("a box has two corners; give both --low and --high")
    if points and not by_box:
        raise MapFileError("--points needs a box; give --low and --high")
    check_target(output, force=force)
    saved = take_map(load_map(file, images=True), number)
    contents = saved.contents
    inside = None
    if by_time:
        first = float(contents.keyframes.timestamps.min())
        since = first + (-math.inf if begin is None else begin)
        kept = keyframes_of_times(contents, since, first + (math.inf if end is None else end))
    else:
        corners = [read_position("--low", low or ""), read_position("--high", high or "")]
        least, most = np.minimum(*corners), np.maximum(*corners)
        kept = keyframes_in_box(contents, least, most)
        inside = inside_box(contents.points.positions, least, most) if points else None
    cropped = crop_saved_map(saved, kept, inside)
    save_edited(cropped, output, force=force)
    left = cropped.contents
    _say(
        quiet,
        f"{len(left.keyframes)} of {len(contents.keyframes)} keyframes and {len(left.points)} of "
        f"{len(contents.points)} points are in {output}",
    )


def align(
    file: MapFile,
    output: Output,
    truth: Annotated[
        Path | None,
        typer.Option(
            help="Ground truth: a trajectory file with time stamps, or the folder of a sequence.",
            metavar="FILE_OR_FOLDER",
        ),
    ] = None,
    points: Annotated[
        Path | None,
        typer.Option(
            help="Known points, at least three, one per line: x y z in the map and x y z in the "
            "world; or seconds since the first keyframe and x y z, where the camera was then.",
            metavar="FILE",
        ),
    ] = None,
    length: Annotated[
        float | None,
        typer.Option(help="Of one camera: a known length, between ...", metavar="METRES"),
    ] = None,
    between: Annotated[
        tuple[str, str] | None,
        typer.Option(
            help="... two places: x,y,z in the map, or seconds since the first keyframe, where the "
            "camera was then.",
            metavar="PLACE PLACE",
        ),
    ] = None,
    number: MapNumber = None,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Lay a map onto the world: by a true path, by known points, or by a known length.

    The map of a single camera gets metres by that; maps that see metres are only turned and
    shifted.
    """
    ways = [way is not None for way in (truth, points, length)]
    if sum(ways) != 1:
        raise MapFileError("say how to align: by one of --truth, --points and --length")
    if (length is None) != (between is None):
        raise MapFileError("a length is that between two places: give --length and --between")
    check_target(output, force=force)
    log_to(Console(stderr=True), quiet=quiet)
    saved = take_map(load_map(file, images=True), number)
    contents = saved.contents
    if truth is not None:
        placement = place_by_trajectory(contents, read_true_path(truth, saved.sensor))
    elif points is not None:
        placement = place_by_points(contents, *read_known_points(points, contents))
    else:
        assert length is not None
        assert between is not None
        first, second = (_place(contents, text) for text in between)
        placement = place_by_length(contents, first, second, length)
    moved = transform_map(contents, placement.similarity)
    save_edited(replace(saved, contents=moved), output, force=force)
    for line in _described(placement, metric=unit_of(contents) == "m"):
        _say(quiet, line)
    _say(quiet, f"The map is in {output}")


def optimize(
    file: MapFile,
    output: Output,
    time_limit: Annotated[
        float | None,
        typer.Option(help="Seconds after which it ends with what it has reached."),
    ] = None,
    number: MapNumber = None,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Refine all keyframes and points of a map together (full bundle adjustment)."""
    if time_limit is not None and not (math.isfinite(time_limit) and time_limit > 0):
        raise MapFileError(f"--time-limit must be more than 0 seconds, got {time_limit:g}")
    check_target(output, force=force)
    saved = take_map(load_map(file, images=True), number)
    refined, record = optimize_map(saved.contents, time_limit=time_limit)
    save_edited(replace(saved, contents=refined), output, force=force)
    seconds = sum(record.milliseconds.values()) / 1000
    _say(
        quiet,
        f"{record.n_keyframes} keyframes, {record.n_points} points: cost {record.initial_cost:.0f} "
        f"to {record.final_cost:.0f} in {record.iterations} steps, {seconds:.1f} s",
    )
    _say(quiet, f"The map is in {output}")


# ---- what is typed -------------------------------------------------------------------------------
def read_position(option: str, text: str) -> FloatArray:
    """Read ``1.5,0,-2``.

    Raises
    ------
    MapFileError
        If it is anything else.
    """
    try:
        numbers = np.array([float(word) for word in text.split(",")])
    except ValueError:
        numbers = np.zeros(0)
    if len(numbers) != 3 or not np.isfinite(numbers).all():
        raise MapFileError(f"{option} is '{text}'; give a position like 1.5,0,-2")
    return numbers


def _place(contents: MapContents, text: str) -> FloatArray:
    """A position in the map, or where the camera was at a time."""
    if "," in text:
        return read_position("--between", text)
    try:
        seconds = float(text)
    except ValueError:
        raise MapFileError(
            f"--between has '{text}'; give places like 1.5,0,-2 or seconds like 12.4"
        ) from None
    return _camera_at(contents, seconds)


def _camera_at(contents: MapContents, seconds: float) -> FloatArray:
    """Where the camera was, from the keyframes before and after."""
    times = contents.keyframes.timestamps
    order = np.argsort(times, kind="stable")
    since = times[order] - times[order[0]]
    if not 0 <= seconds <= since[-1]:
        raise MapFileError(
            f"{seconds:g} s is not within the map, whose keyframes are of 0 to {since[-1]:g} s"
        )
    centres = contents.keyframes.T_wc[order, :3, 3]
    return np.array([np.interp(seconds, since, centres[:, axis]) for axis in range(3)])


def read_known_points(path: Path, contents: MapContents) -> tuple[FloatArray, FloatArray]:
    """Read points known in the map and in the world, (m, 3) each.

    Raises
    ------
    DatasetError, MapFileError
        Naming file and line.
    """
    in_map, in_world = [], []
    for line in content_lines(path):
        numbers = numbers_of(path, line, (_LINE_OF_TIME, _LINE_OF_POSITION))
        if len(numbers) == _LINE_OF_TIME:
            in_map.append(_camera_at(contents, numbers[0]))
        else:
            in_map.append(np.array(numbers[:3]))
        in_world.append(np.array(numbers[-3:]))
    return np.array(in_map).reshape(-1, 3), np.array(in_world).reshape(-1, 3)


def _described(placement: Placement, *, metric: bool) -> list[str]:
    lines = []
    if not metric:
        lines.append(f"A unit of the map is {placement.similarity.scale:.6g} m")
    if placement.rmse or placement.n_pairs > 2:
        lines.append(
            f"{placement.n_pairs} positions are {placement.rmse:.4f} m from where they should be "
            "(RMSE)"
        )
    if placement.on_a_line:
        lines.append(
            "They lie on a line, so the turn around it is not known; points beside it would tell"
        )
    return lines


def _say(quiet: bool, text: str) -> None:
    Console(quiet=quiet, highlight=False, soft_wrap=True).print(text, markup=False)

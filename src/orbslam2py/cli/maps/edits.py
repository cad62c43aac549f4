# SPDX-License-Identifier: BSD-3-Clause
"""``orbslam2py map crop``, ``align`` and ``optimize``: make another map file from one."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

from orbslam2py.cli.calibrate import Force, Quiet
from orbslam2py.cli.maps.images import open_images
from orbslam2py.cli.maps.places import (
    keyframes_between,
    read_known_points,
    read_place,
    read_position,
)
from orbslam2py.cli.maps.true_path import read_true_path
from orbslam2py.cli.messages import log_to
from orbslam2py.cli.targets import check_target
from orbslam2py.errors import MapFileError
from orbslam2py.maps import (
    AlignmentRecord,
    MapContents,
    Placement,
    SavedMap,
    align_sightings,
    load_map,
    place_by_length,
    place_by_points,
    place_by_trajectory,
    save_map,
    transform_map,
)
from orbslam2py.maps.edits.crop import inside_box, keyframes_in_box
from orbslam2py.maps.edits.parts import crop_among_others, map_numbers, put_back, take_map
from orbslam2py.maps.edits.saved import crop_saved_map
from orbslam2py.maps.units import sees_metres, unit_of
from orbslam2py.slam.full_bundle_adjustment import optimize_map

MapFile = Annotated[Path, typer.Argument(help="Map file.")]
MapNumber = Annotated[
    int | None,
    typer.Option(
        "--map", help="Number of the map in a file of several; 0 is the oldest.", metavar="K", min=0
    ),
]
Output = Annotated[Path, typer.Option("--output", "-o", help="Map file to write.")]


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
    only: Annotated[
        bool, typer.Option("--only", help="Leave the other maps of the file out.")
    ] = False,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Keep a part of a map: the keyframes of a time, or whose cameras stood in a box.

    The points that these observe are kept, too; a point that loses observations is removed if the
    remaining ones do not suffice. If the first keyframe goes, the next becomes the one that paths
    are relative to. Other maps of the file stay as they are; --only leaves them out, and alone
    takes one map out of several.
    """
    by_time, by_box = not (begin is None and end is None), not (low is None and high is None)
    if by_time == by_box and not (only and not by_time):
        raise MapFileError("say what to keep: either --from and --to, or --low and --high")
    if by_box and (low is None or high is None):
        raise MapFileError("a box has two corners; give both --low and --high")
    if points and not by_box:
        raise MapFileError("--points needs a box; give --low and --high")
    check_target(output, force=force)
    file_of_maps = load_map(file, images=True)
    taken = take_map(file_of_maps, number)
    contents = taken.contents
    inside = None
    if by_box:
        corners = [read_position("--low", low or ""), read_position("--high", high or "")]
        least, most = np.minimum(*corners), np.maximum(*corners)
        kept = keyframes_in_box(contents, least, most)
        inside = inside_box(contents.points.positions, least, most) if points else None
    else:
        kept = keyframes_between(contents, begin, end)
    if only or taken is file_of_maps:
        cropped = left = crop_saved_map(taken, kept, inside)
        told = f"are in {output}"
    else:
        assert number is not None
        cropped, new_number = crop_among_others(file_of_maps, number, kept, inside)
        left = take_map(cropped, new_number)
        told = f"of map {number} are in {output}{_others(file_of_maps)}"
        told += f"; the file has it as map {new_number}" if new_number != number else ""
    save_edited(cropped, output, force=force)
    _say(
        quiet,
        f"{left.n_keyframes} of {taken.n_keyframes} keyframes and {left.n_points} of "
        f"{taken.n_points} points {told}",
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
        typer.Option(help="Known length between the places of --between [m].", metavar="METRES"),
    ] = None,
    between: Annotated[
        tuple[str, str] | None,
        typer.Option(
            help="The two places of --length: x,y,z in the map, or seconds since the first "
            "keyframe for the place of the camera then.",
            metavar="PLACE PLACE",
        ),
    ] = None,
    number: MapNumber = None,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Lay a map onto the world: by a true path, by known points, or by a known length.

    The map of a single camera gets metres by that; maps that see metres are only turned and
    shifted. Other maps of the file stay as they are.
    """
    ways = [way is not None for way in (truth, points, length)]
    if sum(ways) != 1:
        raise MapFileError("say how to align: by one of --truth, --points and --length")
    if (length is None) != (between is None):
        raise MapFileError("a length is that between two places: give --length and --between")
    check_target(output, force=force)
    log_to(Console(stderr=True), quiet=quiet)
    saved = load_map(file, images=True)
    contents = take_map(saved, number).contents
    if truth is not None:
        placement = place_by_trajectory(contents, read_true_path(truth, saved.sensor))
    elif points is not None:
        placement = place_by_points(contents, *read_known_points(points, contents))
    else:
        assert length is not None
        assert between is not None
        first, second = (read_place(contents, text) for text in between)
        placement = place_by_length(contents, first, second, length)
    moved = transform_map(contents, placement.similarity, metric=True)
    save_edited(put_back(saved, number or 0, moved), output, force=force)
    for line in _described(placement, contents):
        _say(quiet, line)
    _say(quiet, _where(saved, number, output))


def optimize(
    file: MapFile,
    output: Output,
    time_limit: Annotated[
        float | None,
        typer.Option(help="Seconds after which it stops and keeps its result so far."),
    ] = None,
    aligned: Annotated[
        bool,
        typer.Option(
            "--align",
            help="First align the sightings of each point to each other in the images, to a "
            "fraction of a pixel; needs --images.",
        ),
    ] = False,
    images: Annotated[
        str | None,
        typer.Option(help="The sequence that the map was made of.", metavar="SEQUENCE"),
    ] = None,
    fps: Annotated[float | None, typer.Option(help="For --images: the same as in the run.")] = None,
    times: Annotated[
        Path | None, typer.Option(help="For --images: the same as in the run.")
    ] = None,
    split: Annotated[
        bool, typer.Option("--split", help="For --images: the same as in the run.")
    ] = False,
    number: MapNumber = None,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Refine all keyframes and points of a map together (full bundle adjustment).

    Other maps of the file stay as they are. The keypoints of the map stay, also with --align.
    """
    if time_limit is not None and not (math.isfinite(time_limit) and time_limit > 0):
        raise MapFileError(f"--time-limit must be more than 0 seconds, got {time_limit:g}")
    _check_image_options(aligned, images, [fps, times, split or None], time_limit)
    check_target(output, force=force)
    if images is not None:
        log_to(Console(stderr=True), quiet=quiet)
    saved = load_map(file, images=True)
    contents = take_map(saved, number).contents
    if images is not None:
        sequence = open_images(saved, images, fps, times, split)
        with _progress(quiet) as show:
            refined, alignment = align_sightings(contents, sequence, progress=show)
        save_edited(put_back(saved, number or 0, refined), output, force=force)
        for line in _alignment_lines(alignment):
            _say(quiet, line)
        _say(quiet, _where(saved, number, output))
        return
    refined, record = optimize_map(contents, time_limit=time_limit)
    save_edited(put_back(saved, number or 0, refined), output, force=force)
    seconds = sum(record.milliseconds.values()) / 1000
    _say(
        quiet,
        f"{record.n_keyframes} keyframes, {record.n_points} points: cost {record.initial_cost:.0f} "
        f"to {record.final_cost:.0f} in {record.iterations} steps, {seconds:.1f} s",
    )
    _say(quiet, _where(saved, number, output))


def _check_image_options(
    aligned: bool, images: str | None, others: list[object], time_limit: float | None
) -> None:
    if aligned and images is None:
        raise MapFileError(
            "--align needs the images that the map was made of; give the sequence with --images"
        )
    if not aligned and (images is not None or any(option is not None for option in others)):
        raise MapFileError(
            "--images, --fps, --times and --split serve --align alone; add --align or leave them "
            "out"
        )
    if aligned and time_limit is not None:
        raise MapFileError("--align has no time limit; leave --time-limit out")


@contextmanager
def _progress(quiet: bool) -> Iterator[Callable[[int, int], None]]:
    """Show how many images have been read, if there is a terminal."""
    console = Console(quiet=quiet)
    columns = (TextColumn("images"), BarColumn(), MofNCompleteColumn())
    with Progress(
        *columns, console=console, transient=True, disable=not console.is_terminal
    ) as bar:
        task = bar.add_task("images", total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)


# ---- printed text --------------------------------------------------------------------------------
def _alignment_lines(record: AlignmentRecord) -> list[str]:
    lines = [
        f"{record.n_keyframes} keyframes, {record.n_points} points, {record.n_observations} "
        f"sightings: {_share(record.n_aligned, record.failures)}"
    ]
    if record.n_right_aligned or any(record.right_failures.values()):
        lines.append(f"Right images: {_share(record.n_right_aligned, record.right_failures)}")
    lines.append(
        f"Reprojection error, median: {record.error_before:.3f} to {record.error_after:.3f} pixels "
        f"(noise of an aligned coordinate {record.noise:.3f}) in {record.seconds:.1f} s"
    )
    if not record.used:
        lines.append("The adjustment found nothing better: the map is as it was")
    return lines


def _share(n_aligned: int, failures: dict[str, int]) -> str:
    reasons = ", ".join(f"{n} {name.replace('_', ' ')}" for name, n in failures.items() if n)
    n = n_aligned + sum(failures.values())
    return f"{n_aligned} of {n} aligned" + (f" ({reasons})" if reasons else "")


def _where(saved: SavedMap, number: int | None, output: Path) -> str:
    others = _others(saved)
    return f"{f'Map {number}' if others else 'The map'} is in {output}{others}"


def _others(saved: SavedMap) -> str:
    """Print that the other maps of a file do not change, if there are any."""
    n = int(map_numbers(saved.contents.keyframes).max())
    return ", the other map as it was" if n == 1 else f", the {n} other maps as they were" * (n > 1)


def _described(placement: Placement, contents: MapContents) -> list[str]:
    lines = []
    if not sees_metres(contents):
        unit = "metre" if unit_of(contents) == "m" else "unit"
        lines.append(f"A {unit} of the map is {placement.similarity.scale:.6g} m")
    if placement.rmse or placement.n_pairs > 2:
        lines.append(
            f"{placement.n_pairs} positions are {placement.rmse:.4f} m from where they should be "
            "(RMSE)"
        )
    if placement.on_a_line:
        lines.append(
            "They lie on a line, so the rotation about it is not determined; add points beside it"
        )
    return lines


def _say(quiet: bool, text: str) -> None:
    Console(quiet=quiet, highlight=False, soft_wrap=True).print(text, markup=False)

# SPDX-License-Identifier: BSD-3-Clause
"""``orbslam2py map merge``: maps of different runs, days and places made one."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console

from orbslam2py._arguments import number_of
from orbslam2py.cli.calibrate import Force, Quiet
from orbslam2py.cli.messages import log_to
from orbslam2py.cli.run_options import VocabularyOption
from orbslam2py.cli.targets import check_target
from orbslam2py.errors import MapFileError
from orbslam2py.maps import SavedMap, load_map, save_map
from orbslam2py.maps.edits.parts import map_numbers
from orbslam2py.maps.units import sees_metres
from orbslam2py.slam.events import MapsMerged
from orbslam2py.slam.saved_map_merging import merge_maps


def merge(
    files: Annotated[list[Path], typer.Argument(help="Map files, two or more.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Map file to write.")],
    vocabulary: VocabularyOption = None,
    full_adjustment: Annotated[
        bool,
        typer.Option("--full-adjustment/--no-full-adjustment", help="Refine the merged map."),
    ] = True,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Make one map of maps of different runs, as far as they show the same places.

    The world and the scale of the first stay. A map without a common place remains a separate map
    in the same file.
    """
    if len(files) < 2:
        raise MapFileError(f"{files[0]} alone cannot be merged; name two map files or more")
    check_target(output, force=force)
    log_to(Console(stderr=True), quiet=quiet)
    saved = [load_map(file, images=True) for file in files]
    merged, merges = merge_maps(saved, vocabulary, full_adjustment=full_adjustment)
    save_map(merged, output)
    console = Console(quiet=quiet, highlight=False, soft_wrap=True)
    for one in merges:
        console.print(described(one, merged), markup=False)
    counts = np.bincount(map_numbers(merged.contents.keyframes))
    sizes = ", ".join(number_of(int(n), "keyframe") for n in counts)
    verb = "is" if len(counts) == 1 else "are"
    told = f"{number_of(len(counts), 'map')} of {sizes} {verb} in {output}"
    console.print(told, markup=False)


def described(one: MapsMerged, merged: SavedMap) -> str:
    """Describe a merge of two maps."""
    scale = "" if sees_metres(merged.contents) else f", its lengths times {one.scale:.4g}"
    return (
        f"map {one.merged_map} is part of map {one.map_index} now{scale}: keyframe "
        f"{one.current_keyframe} shows the place of {one.matched_keyframe}, {one.n_matches} "
        f"matches, {one.n_fused} points are the same"
    )

# SPDX-License-Identifier: BSD-3-Clause
"""Maps of different runs, days and places made one map, as far as they show the same places."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from orbslam2py import _core as core
from orbslam2py._worker import Worker
from orbslam2py.errors import MapFileError
from orbslam2py.maps.edits.parts import put_together
from orbslam2py.maps.map_copies import restore_contents, take_contents
from orbslam2py.maps.saved_map import SavedMap
from orbslam2py.maps.setup_check import check_made_alike, check_vocabulary
from orbslam2py.slam.config import Config
from orbslam2py.slam.events import MapsMerged
from orbslam2py.slam.full_bundle_adjustment import FullBundleAdjustment
from orbslam2py.slam.loop_closing import LoopClosing
from orbslam2py.slam.options import SystemOptions
from orbslam2py.vocabulary.vocabulary import load_vocabulary, vocabulary_name


def merge_maps(
    files: Sequence[SavedMap],
    vocabulary: core.Vocabulary | str | Path | None = None,
    *,
    full_adjustment: bool = True,
    seed: int = 0,
) -> tuple[SavedMap, list[MapsMerged]]:
    """Make one map of several, as the system does with maps that meet while it runs.

    Every keyframe of the second map and of all after it is compared with all maps; loops are
    closed as well. What shows no common place stays a map of its own beside the others. The world
    and the scale of the older map, which is the one that is named first, stay.

    Parameters
    ----------
    files
        Maps, as from `load_map`; each may hold several already. At least two.
    vocabulary
        Visual words that they were made with; those shipped with the package if None.
    full_adjustment
        Refine maps that have become one as a whole.
    seed
        Of all random draws.

    Returns
    -------
    merged
        All maps, with the runs and images of all.
    merges
        Which became part of which.

    Raises
    ------
    MapFileError, SettingsError
        If they are of different cameras, sensors or visual words, or fewer than two.
    """
    if not isinstance(files, Sequence) or len(files) < 2:
        raise MapFileError("merging takes two maps or more, a list of what load_map returns")
    check_made_alike(files)
    first = files[0]
    words = vocabulary if isinstance(vocabulary, core.Vocabulary) else load_vocabulary(vocabulary)
    for saved in files:
        check_vocabulary(saved, words, vocabulary_name(vocabulary), may_differ=False)
    together = put_together(files)
    slam_map, index = core.Map(), core.KeyFrameIndex()
    restore_contents(together.contents, slam_map, words, words_fit=True)
    nobody: Worker[int] = Worker("local mapping", lambda _: None, threaded=False)
    adjustment = FullBundleAdjustment(
        slam_map,
        nobody,
        time_limit=None,
        monocular=not first.sensor.has_depth,
        threaded=False,
        on_done=lambda _: None,
    )
    closing = LoopClosing(
        slam_map,
        index,
        first.sensor,
        nobody,
        adjustment,
        SystemOptions(deterministic=True, full_adjustment=False, seed=seed),
        on_loop=lambda _: None,
        on_merge=lambda _: None,
        config=Config(),
    )
    _compare(slam_map, index, closing)
    if full_adjustment:
        for map_index in sorted({merge.map_index for merge in closing.merges}):
            if map_index in slam_map.maps:
                adjustment.run(map_index)
    return replace(together, contents=take_contents(slam_map)), closing.merges


def _compare(slam_map: core.Map, index: core.KeyFrameIndex, closing: LoopClosing) -> None:
    """Let every keyframe look for its place in the maps before its own."""
    for number in slam_map.maps:
        for keyframe in slam_map.keyframe_ids(number).tolist():
            if number == 0:
                core.index_keyframe(index, slam_map, keyframe)
            else:
                closing.process(keyframe)
        closing.end()
        closing.reset()

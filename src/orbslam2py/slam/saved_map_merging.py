# SPDX-License-Identifier: BSD-3-Clause
"""Merging of saved maps of different runs and days that show the same places."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from orbslam2py import _core as core
from orbslam2py._worker import Worker
from orbslam2py.errors import MapFileError
from orbslam2py.maps.edits.parts import put_together
from orbslam2py.maps.imu_states import states_of_part
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
    """Merge several maps, as a running system merges its maps.

    Every keyframe of the second and later maps is compared with all maps; loops are closed too. A
    map without a common place remains a separate map. A merged map keeps the world and the scale of
    the map that is named first.

    Parameters
    ----------
    files
        Maps, as from `load_map`; each may contain several. At least two.
    vocabulary
        Visual words of the maps; None: the vocabulary of the package.
    full_adjustment
        Whether to run full bundle adjustment on merged maps.
    seed
        Of all random draws.

    Returns
    -------
    merged
        All maps, with the runs and images of all.
    merges
        Which maps were merged into which.

    Raises
    ------
    MapFileError, SettingsError
        If they have different cameras, sensors or vocabularies, or if there are fewer than two.
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
    contents = take_contents(slam_map)
    states = states_of_part(together.contents.imu_states, contents.keyframes)
    return replace(together, contents=replace(contents, imu_states=states)), closing.merges


def _compare(slam_map: core.Map, index: core.KeyFrameIndex, closing: LoopClosing) -> None:
    """Search a place for every keyframe in the maps before its own."""
    for number in slam_map.maps:
        for keyframe in slam_map.keyframe_ids(number).tolist():
            if number == 0:
                core.index_keyframe(index, slam_map, keyframe)
            else:
                closing.process(keyframe)
        closing.end()
        closing.reset()

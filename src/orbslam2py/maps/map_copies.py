# SPDX-License-Identifier: BSD-3-Clause
"""Copies of a map of the core, complete or of its changes, and maps made of copies."""

from __future__ import annotations

import weakref
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from orbslam2py import _core as core
from orbslam2py._arrays import IntArray
from orbslam2py.maps.content_groups import (
    AlignedSightings,
    BoolArray,
    Cameras,
    Covisibility,
    ImuStates,
    Keyframes,
    Observations,
    Patches,
    Points,
    RemovedKeyframes,
)
from orbslam2py.maps.contents import MapContents, contents_of
from orbslam2py.maps.imu_states import check_states, put_states, take_states
from orbslam2py.maps.units import sees_metres

#: Not needed by the core: which of its maps were given metres, and since which epoch.
_metric_roots: weakref.WeakKeyDictionary[core.Map, tuple[int, tuple[int, ...]]] = (
    weakref.WeakKeyDictionary()
)


@dataclass(frozen=True, eq=False)
class ChangedContents:
    """Possible changes of a map since an earlier copy, to update a file."""

    contents: MapContents
    """All but known keypoints, the points on unchanged pages with their patches, the samples of
    unchanged states of the IMU, and the aligned sightings of unchanged keyframes."""
    keyframe_stamp: int
    """Number of the last change of a keyframe ..."""
    point_stamp: int
    """... and of a point."""
    changed_keyframes: BoolArray
    """(k,) whether pose, parent, weights or other fields have changed."""
    pages: IntArray
    """(m,) numbers of pages of `IDS_PER_PAGE` ids: points on other pages have not changed."""
    incomplete_pages: IntArray
    """(i,) pages among them with points whose keyframes local mapping has not processed yet."""
    imu_versions: IntArray
    """(m, 3) of the states of the IMU, as of `take_states` ..."""
    changed_states: BoolArray
    """... and (m,) which of them may have changed; the samples of the others are left out."""


def take_contents(
    slam_map: core.Map,
    inertial: core.InertialKeyframes | None = None,
    *,
    patches: bool = True,
) -> MapContents:
    """Copy a whole map at one moment; the system may be running.

    Keyframes that local mapping has not processed yet, and points that only they see, are left out.

    Parameters
    ----------
    slam_map
        The map.
    inertial
        States of the IMU at the keyframes; None without an IMU.
    patches
        Copy the patches of points, and the sightings that were aligned to them.
    """
    nothing = np.zeros(0, np.int64)
    return take_changes(slam_map, nothing, None, inertial, patches=patches).contents


def take_changes(
    slam_map: core.Map,
    known_keyframes: IntArray,
    before: ChangedContents | None,
    inertial: core.InertialKeyframes | None = None,
    *,
    patches: bool = True,
) -> ChangedContents:
    """Copy possible changes of a map since an earlier copy, without the counters of tracking.

    Parameters
    ----------
    slam_map
        The map.
    known_keyframes
        Ids (m,), ascending, of keyframes whose keypoints are left out, because they never change.
    before
        The earlier copy of the same map (`MapContents.map_index`); None if there is none.
    inertial, patches
        As of `take_contents`.
    """
    since: dict[str, Any] = {}
    if before is not None:
        since = {
            "keyframe_stamp": before.keyframe_stamp,
            "point_stamp": before.point_stamp,
            "incomplete_pages": before.incomplete_pages,
        }
    arrays = core.map_contents(slam_map, known_keyframes, with_patches=patches, **since)
    groups: dict[str, dict[str, Any]] = {}
    for name, array in arrays.items():
        group, _, field = name.rpartition(".")
        groups.setdefault(group, {})[field] = array
    contents = MapContents(
        **groups[""],
        cameras=Cameras(**groups["cameras"]),
        keyframes=Keyframes(**groups["keyframes"]),
        removed_keyframes=RemovedKeyframes(**groups["removed_keyframes"]),
        points=Points(**groups["points"]),
        observations=Observations(**groups["observations"]),
        covisibility=Covisibility(**groups["covisibility"]),
        patches=Patches(**groups["patches"]),
        aligned=AlignedSightings(**groups["aligned"]),
    )
    epoch, roots = _metric_roots.get(slam_map, (-1, ()))
    if epoch == contents.map_index:  # otherwise the map was cleared since, and ids started again
        contents = replace(contents, metric_roots=living_roots(roots, contents.keyframes))
    contents = _with_upright_roots(contents, slam_map)
    versions, changed = np.zeros((0, 3), np.int64), np.zeros(0, bool)
    if inertial is not None:
        known = versions if before is None else before.imu_versions
        states, versions, changed = take_states(inertial, contents.keyframes, known)
        if slam_map.epoch != contents.map_index:  # it was emptied meanwhile, and ids begin anew
            states, versions, changed = ImuStates.none(), versions[:0], changed[:0]
        contents = replace(contents, imu_states=states)
    return ChangedContents(
        contents, **groups["known"], imu_versions=versions, changed_states=changed
    )


def restore_contents(
    contents: MapContents,
    slam_map: core.Map | None = None,
    vocabulary: core.Vocabulary | None = None,
    index: core.KeyFrameIndex | None = None,
    *,
    words_fit: bool = False,
    inertial: core.InertialKeyframes | None = None,
) -> core.Map:
    """Make a map of its contents.

    Parameters
    ----------
    contents
        All data of the map.
    slam_map
        An empty map to fill; a new one by default.
    vocabulary
        Vocabulary for the words of the keyframes, for place recognition.
    index
        Gets the keyframes with their words.
    words_fit
        The words in the contents are of this vocabulary and need not be computed again.
    inertial
        Gets the states of the IMU.

    Raises
    ------
    MapFileError
        If the contents are inconsistent; the message says where. Nothing was changed then.
    """
    contents_of(contents)
    if slam_map is None:
        slam_map = core.Map()
    arrays = contents.as_dict()
    keyframes = contents.keyframes
    check_states(contents.imu_states, keyframes.ids, keyframes.timestamps)
    restorer = core.MapRestorer(arrays, len(keyframes.keypoints), vocabulary, words_fit)
    restorer.add(arrays, len(keyframes))
    restorer.finish(slam_map, index)
    if inertial is not None:
        put_states(contents.imu_states, inertial)
    remember_metric_roots(slam_map, contents.metric_roots)
    set_upright(slam_map, contents.upright_roots)
    return slam_map


def _with_upright_roots(contents: MapContents, slam_map: core.Map) -> MapContents:
    """Add which maps an IMU has turned upright; one camera's upright maps are in metres."""
    keyframes = contents.keyframes
    roots = keyframes.ids[keyframes.parent < 0].tolist()
    upright = tuple(root for root in roots if slam_map.is_upright(slam_map.map_of(root)))
    if not upright:
        return contents
    metric = contents.metric_roots
    if not sees_metres(contents):
        metric = tuple(sorted({*metric, *upright}))
    return replace(contents, metric_roots=metric, upright_roots=upright)


def set_upright(slam_map: core.Map, roots: tuple[int, ...]) -> None:
    """Note in a map of the core which of its maps are upright.

    Parameters
    ----------
    slam_map
        The map, just created.
    roots
        As in `MapContents.upright_roots`.
    """
    for root in roots:
        slam_map.set_upright(slam_map.map_of(root))


def remember_metric_roots(slam_map: core.Map, roots: tuple[int, ...]) -> None:
    """Store for a map of the core which of its maps are in metres, for copies of it.

    Parameters
    ----------
    slam_map
        The map, just created.
    roots
        As in `MapContents.metric_roots`.
    """
    if roots:
        _metric_roots[slam_map] = slam_map.epoch, roots


def living_roots(roots: tuple[int, ...], keyframes: Keyframes) -> tuple[int, ...]:
    """Keep only the roots: a merged map has the unit of the other one."""
    there = keyframes.ids[keyframes.parent < 0]
    return tuple(there[np.isin(there, np.array(roots, np.int64))].tolist())

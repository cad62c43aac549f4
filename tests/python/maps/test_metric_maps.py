# SPDX-License-Identifier: BSD-3-Clause
"""Maps of a single camera that were given metres: they know it, in files, edits and runs."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import orbslam2py as orb
from orbslam2py import Sensor
from orbslam2py.maps import (
    MapContents,
    SavedMap,
    crop_saved_map,
    export_g2o,
    export_points,
    keep_keyframes,
    load_map,
    map_differences,
    place_by_length,
    restore_contents,
    save_map,
    take_contents,
    transform_map,
)
from orbslam2py.maps.edits.parts import put_together, take_map
from orbslam2py.maps.map_file import MapFile
from orbslam2py.maps.units import sees_metres, unit_of
from orbslam2py.slam.saved_map_merging import merge_maps
from orbslam2py.trajectory import Similarity
from support import small_sequences
from support.cut_sequences import corridor, cut, settings_of, track
from support.made_up_map import made_up_map
from support.made_up_saved import made_up_saved
from support.saved_maps import edit, small_map

TWICE = Similarity(2.0, np.eye(3), np.zeros(3))
TURNED = Similarity(1.0, np.diag([1.0, -1.0, -1.0]), np.ones(3))


def metric(saved: SavedMap) -> SavedMap:
    """The same map, twice as large, in metres."""
    return replace(saved, contents=transform_map(saved.contents, TWICE, metric=True))


@pytest.fixture
def contents() -> MapContents:
    return metric(made_up_saved(made_up_map(6, loop=False))).contents


# ---- what it is called ---------------------------------------------------------------------------
def test_units_and_metres() -> None:
    mono, rgbd = made_up_map(4), made_up_map(4, depth=True)
    assert (unit_of(mono), unit_of(rgbd)) == ("units", "m")
    given = transform_map(mono, TWICE, metric=True)
    assert (unit_of(given), sees_metres(given)) == ("m", False)
    assert given.metric_roots == (0,)
    assert transform_map(rgbd, TURNED, metric=True).metric_roots == (), "it sees them anyway"


def test_another_size_is_in_another_unit(contents: MapContents) -> None:
    assert unit_of(transform_map(contents, TURNED)) == "m"
    assert unit_of(transform_map(contents, TWICE)) == "units"
    assert unit_of(transform_map(contents, TWICE, metric=True)) == "m"


def test_a_map_with_metres_may_be_given_better_ones(contents: MapContents) -> None:
    placement = place_by_length(contents, np.zeros(3), np.array([1.0, 0, 0]), 1.1)
    assert placement.similarity.scale == pytest.approx(1.1)


def test_exports_say_metres(contents: MapContents, tmp_path: Path) -> None:
    export_g2o(contents, tmp_path / "map.g2o")
    told = (tmp_path / "map.g2o").read_text()
    assert "lengths in metres" in told
    assert "own unit" not in told
    assert "scales: VERTEX_SIM3:QUAT" in told, "a camera that sees no metres drifts in scale"
    export_points(contents, tmp_path / "points.ply")
    assert b"units" not in (tmp_path / "points.ply").read_bytes().partition(b"end_header")[0]


# ---- files ---------------------------------------------------------------------------------------
def test_a_file_keeps_it(tmp_path: Path) -> None:
    saved = metric(made_up_saved())
    save_map(saved, tmp_path / "a.orbmap")
    read = load_map(tmp_path / "a.orbmap")
    assert read.contents.metric_roots == (0,)
    assert read.contents.first_difference(saved.contents) is None
    assert read.settings == saved.settings


def test_programs_that_know_nothing_of_it_read_the_file(tmp_path: Path) -> None:
    """No table has changed, and to a reader of settings the line is a comment."""
    for name, saved in (("a", made_up_saved()), ("b", metric(made_up_saved()))):
        save_map(saved, tmp_path / f"{name}.orbmap")
    found = []
    for name in ("a", "b"):
        with closing(sqlite3.connect(tmp_path / f"{name}.orbmap")) as connection:
            version = connection.execute("PRAGMA user_version").fetchone()
            tables = connection.execute("SELECT sql FROM sqlite_schema ORDER BY name").fetchall()
            ((yaml,),) = connection.execute("SELECT yaml FROM settings").fetchall()
        found.append((version, tables))
        settings = orb.Settings.from_yaml(yaml, Sensor.MONOCULAR)
        assert settings.camera == made_up_saved().settings.camera
    assert found[0] == found[1]


@pytest.mark.parametrize("text", ["0 7", "3", "x", "-1", "0 " * 9, "99999999999999999999"])
def test_what_is_no_root_is_not_believed(tmp_path: Path, text: str) -> None:
    path = tmp_path / "a.orbmap"
    save_map(metric(made_up_saved()), path)
    edit(path, f"UPDATE settings SET yaml = replace(yaml, 'roots: 0', 'roots: {text}')")
    assert load_map(path).contents.metric_roots == ((0,) if text.startswith("0") else ())


def test_comparing_tells_it() -> None:
    one = made_up_saved()
    other = replace(one, contents=replace(one.contents, metric_roots=(0,)))
    assert map_differences(one, other) == ["metres: map 0 only in the second"]
    assert map_differences(other, one) == ["metres: map 0 only in the first"]
    assert one.contents.first_difference(other.contents) == "metric_roots"
    assert one.contents.content_hash() != other.contents.content_hash()


# ---- edits ---------------------------------------------------------------------------------------
def test_a_part_keeps_it_also_with_another_root(contents: MapContents) -> None:
    for first in (0, 2):
        assert keep_keyframes(contents, np.arange(6) >= first).metric_roots == (0,)


def test_of_several_maps_each_has_its_own() -> None:
    plain = made_up_saved(made_up_map(6, seed=1))
    both = put_together([plain, metric(made_up_saved(made_up_map(6, seed=2)))])
    assert both.contents.metric_roots == (6,)
    assert unit_of(both.contents) == "units", "not all of it is in metres"
    assert [unit_of(both.contents, root) for root in (0, 6)] == ["units", "m"]
    assert [unit_of(take_map(both, number).contents) for number in (0, 1)] == ["units", "m"]
    cut_off = crop_saved_map(both, np.arange(12) >= 8)
    assert unit_of(cut_off.contents) == "m"
    cut_short = crop_saved_map(both, ~np.isin(np.arange(12), [6, 7]))
    assert cut_short.contents.metric_roots == (8,)


def test_refining_keeps_it(contents: MapContents) -> None:
    refined, _ = orb.optimize_map(contents)
    assert unit_of(refined) == "m"


def test_a_map_of_the_core_keeps_it_until_it_is_emptied(contents: MapContents) -> None:
    slam_map = restore_contents(contents)
    assert take_contents(slam_map).metric_roots == (0,)
    slam_map.clear()
    assert take_contents(slam_map).metric_roots == ()


# ---- runs ----------------------------------------------------------------------------------------
@pytest.mark.parametrize("from_file", [False, True])
@pytest.mark.parametrize("autosave", [False, True])
def test_a_run_that_extends_the_map_keeps_it(
    tmp_path: Path, from_file: bool, autosave: bool
) -> None:
    saved = metric(small_map(Sensor.MONOCULAR))
    save_map(saved, tmp_path / "a.orbmap")
    given: SavedMap | MapFile = MapFile(tmp_path / "a.orbmap") if from_file else saved
    with small_sequences.new_system(Sensor.MONOCULAR, deterministic=True, load_map=given) as slam:
        if autosave:
            slam.autosave(tmp_path / "b.orbmap", every=0.01)
        small_sequences.play(slam, 10, first=30)
        assert unit_of(slam.map_contents()) == "m"
        slam.save_map(tmp_path / "b.orbmap")
    assert load_map(tmp_path / "b.orbmap").contents.metric_roots == (0,)


def test_after_a_reset_the_new_map_has_its_own_unit(tmp_path: Path) -> None:
    saved = metric(small_map(Sensor.MONOCULAR))
    with small_sequences.new_system(Sensor.MONOCULAR, deterministic=True, load_map=saved) as slam:
        slam.reset()
        small_sequences.play(slam, 40)
        slam.save_map(tmp_path / "b.orbmap")
    assert unit_of(load_map(tmp_path / "b.orbmap").contents) == "units"


def test_merging_takes_the_unit_of_the_first() -> None:
    def mapped(first: int, last: int) -> SavedMap:
        sequence = cut(corridor("mono", 0), range(first, last))
        with orb.System(settings_of(sequence), "mono", deterministic=True) as slam:
            track(slam, sequence)
            return slam.saved_map()

    plain, other = mapped(0, 90), mapped(40, 130)
    for files, unit in (([metric(plain), other], "m"), ([plain, metric(other)], "units")):
        merged, merges = merge_maps(files, full_adjustment=False)
        assert len(merges) == 1
        assert unit_of(merged.contents) == unit

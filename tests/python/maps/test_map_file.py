# SPDX-License-Identifier: BSD-3-Clause
"""Map files: written whole or not at all, read whole or refused."""

from __future__ import annotations

import dataclasses
import os
import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from orbslam2py import MapFileError, Sensor
from orbslam2py import _core as core
from orbslam2py.maps import load_map, map_writer, save_map, take_contents
from orbslam2py.maps.map_rows import all_rows
from orbslam2py.maps.map_writer import MapWriter
from orbslam2py.maps.schema import APPLICATION_ID, TABLES
from support.saved_maps import edit, same_file_content, small_map, written


@pytest.mark.parametrize("sensor", [Sensor.RGBD, Sensor.STEREO])
def test_what_was_saved_is_loaded(tmp_path: Path, sensor: Sensor) -> None:
    saved = small_map(sensor)
    path = written(tmp_path, sensor)
    loaded = load_map(path, images=True)
    assert saved.contents.first_difference(loaded.contents) is None
    assert loaded.settings == saved.settings
    assert loaded.sensor is sensor
    assert loaded.vocabulary == saved.vocabulary
    assert loaded.images == saved.images
    assert [run.options for run in loaded.runs] == [dict(run.options) for run in saved.runs]
    before, after = saved.trajectory(), loaded.trajectory()
    assert np.array_equal(before.T_wc, after.T_wc)
    assert len(after) == 40
    assert list(tmp_path.iterdir()) == [path]


def test_a_second_file_of_a_loaded_map_holds_the_same(tmp_path: Path) -> None:
    first = written(tmp_path)
    second = tmp_path / "second.orbmap"
    save_map(load_map(first, images=True), second)
    assert same_file_content(first, second)


def test_it_is_a_database_with_strict_tables_and_foreign_keys(tmp_path: Path) -> None:
    with closing(sqlite3.connect(written(tmp_path))) as connection:
        assert connection.execute("PRAGMA application_id").fetchone() == (APPLICATION_ID,)
        assert connection.execute("PRAGMA user_version").fetchone() == (6,)
        strict = {row[1]: row[5] for row in connection.execute("PRAGMA table_list")}
        assert all(strict[name] for name in TABLES)
        assert connection.execute("PRAGMA foreign_key_check").fetchall() == []
        assert connection.execute("PRAGMA integrity_check").fetchone() == ("ok",)
        tree = connection.execute("SELECT count(*) FROM spanning_tree").fetchone()[0]
        assert tree == len(small_map().contents.keyframes) - 1


def test_the_file_is_hardly_larger_than_the_arrays(tmp_path: Path) -> None:
    contents = small_map().contents
    raw = sum(array.nbytes for _, array in contents.arrays())
    images = sum(map(len, small_map().images.values()))
    assert written(tmp_path).stat().st_size < 1.1 * raw + images + 200_000


def test_only_what_changed_is_written(tmp_path: Path) -> None:
    saved = small_map()
    with closing(MapWriter(tmp_path / "map.orbmap")) as writer:
        everything = writer.commit(all_rows(saved))
        assert everything > len(saved.contents.keyframes)
        assert writer.commit(all_rows(saved)) == 0
        positions = saved.contents.points.positions.copy()
        positions[0] += 1.0
        points = dataclasses.replace(saved.contents.points, positions=positions)
        contents = dataclasses.replace(saved.contents, points=points)
        assert writer.commit(all_rows(dataclasses.replace(saved, contents=contents))) == 1
    loaded = load_map(tmp_path / "map.orbmap")
    assert contents.first_difference(loaded.contents) is None
    assert [path.name for path in tmp_path.iterdir()] == ["map.orbmap"]


def test_what_the_map_lost_is_deleted(tmp_path: Path) -> None:
    small, large = small_map(frames=20), small_map()
    with closing(MapWriter(tmp_path / "map.orbmap")) as writer:
        writer.commit(all_rows(large))
        writer.commit(all_rows(small))
    loaded = load_map(tmp_path / "map.orbmap", images=True)
    assert small.contents.first_difference(loaded.contents) is None
    assert set(loaded.images) <= set(small.contents.keyframes.ids.tolist())


def test_another_program_can_read_while_it_grows(tmp_path: Path) -> None:
    path = tmp_path / "map.orbmap"
    with closing(MapWriter(path)) as writer:
        writer.commit(all_rows(small_map(frames=20)))
        assert small_map(frames=20).contents.first_difference(load_map(path).contents) is None
        writer.commit(all_rows(small_map()))
        assert small_map().contents.first_difference(load_map(path).contents) is None


def test_a_journal_that_a_killed_program_left_is_taken_back(tmp_path: Path) -> None:
    path = written(tmp_path)
    journal = path.with_name(f"{path.name}-journal")
    with closing(sqlite3.connect(path, isolation_level=None)) as connection:
        connection.execute("PRAGMA cache_spill = 1")
        connection.execute("PRAGMA cache_size = 1")
        connection.execute("BEGIN")
        connection.execute("UPDATE keypoints SET responses = zeroblob(length(responses))")
        half_done, log = path.read_bytes(), journal.read_bytes()
        connection.execute("ROLLBACK")
    path.write_bytes(half_done)
    journal.write_bytes(log)
    assert small_map().contents.first_difference(load_map(path).contents) is None
    assert list(tmp_path.iterdir()) == [path]


# ---- bad input --------------------------------------------------------------------------------
def _refused(path: Path, what: str, remedy: str = "") -> None:
    before = path.read_bytes() if path.is_file() else b""
    with pytest.raises(MapFileError, match=what) as caught:
        load_map(path)
    text = str(caught.value)
    assert path.name in text
    assert remedy in text
    assert "\n" not in text
    assert "Errno" not in text
    if path.is_file():
        assert path.read_bytes() == before


def test_what_is_no_map_file_is_refused(tmp_path: Path) -> None:
    _refused(tmp_path / "missing.orbmap", "there is no map file", "check the name")
    _refused(tmp_path, "is a folder", "give the map file")
    empty = tmp_path / "empty.orbmap"
    empty.touch()
    _refused(empty, "is empty", "save the map again")
    other = tmp_path / "other.orbmap"
    other.write_text("not a map" * 100)
    _refused(other, "is not a map file")
    database = tmp_path / "database.orbmap"
    with closing(sqlite3.connect(database)) as connection, connection:
        connection.execute("CREATE TABLE notes (text TEXT)")
    _refused(database, "another program")


def test_a_newer_version_is_refused(tmp_path: Path) -> None:
    path = edit(written(tmp_path), "PRAGMA user_version = 7")
    _refused(path, "version 7", "update orbslam2py")


@pytest.mark.parametrize("share", [0.01, 0.3, 0.7, 0.99])
def test_a_file_cut_short_is_refused(tmp_path: Path, share: float) -> None:
    path = written(tmp_path)
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    _refused(path, "cut short|not a map file", "copy of the file" if share > 0.1 else "")


def test_every_flipped_bit_in_the_data_is_noticed(tmp_path: Path) -> None:
    path = written(tmp_path)
    content = path.read_bytes()
    contents = small_map().contents
    rng = np.random.default_rng(1)
    refused = 0
    for _ in range(40):
        spoilt = bytearray(content)
        place = int(rng.integers(100, len(content)))
        spoilt[place] ^= 1 << int(rng.integers(8))
        path.write_bytes(spoilt)
        try:
            loaded = load_map(path)
        except MapFileError as error:
            refused += 1
            assert path.name in str(error)
            continue
        # An image, or space that nobody uses: the map is what it was.
        assert contents.first_difference(loaded.contents) is None
    assert refused > 20


@pytest.mark.parametrize(
    ("statement", "what"),
    [
        ("UPDATE keyframes SET parent = 999 WHERE id = 1", "parent"),
        ("UPDATE keyframes SET camera = 5", "camera"),
        ("UPDATE keyframes SET scale = -1 WHERE id = 0", "scale"),
        ("UPDATE keyframes SET pose = zeroblob(56) WHERE id = 1", "pose"),
        ("UPDATE keyframes SET pose = x'00' WHERE id = 1", "pose"),
        ("UPDATE keypoints SET count = 3 WHERE keyframe = 0", "wrong length"),
        ("UPDATE keypoints SET count = 1 << 60 WHERE keyframe = 0", "wrong length"),
        ("UPDATE keypoints SET depths = positions WHERE keyframe = 0", "wrong length"),
        ("UPDATE keypoints SET octaves = substr(descriptors, 1, count)", "keypoint"),
        ("DELETE FROM keypoints WHERE keyframe = 1", "belong together"),
        ("DELETE FROM keyframes WHERE id = 0", "keyframe"),
        ("DELETE FROM keyframes", "keyframe"),
        ("DELETE FROM cameras", "camera"),
        ("DELETE FROM settings", "settings"),
        ("UPDATE settings SET sensor = 'radar'", "sensor"),
        ("UPDATE settings SET yaml = 'Camera.fx: much'", "settings"),
        ("UPDATE map SET next_point = 1 << 50", "next point"),
        ("UPDATE map SET next_keyframe = 1", "keyframe"),
        ("UPDATE runs SET options = 'none'", "options"),
        ("UPDATE map_points SET positions = mean_directions, count = 0", "wrong length"),
        ("DELETE FROM observations", "reference"),
        ("DELETE FROM map_points", "point"),
        ("UPDATE frames SET poses = zeroblob(length(poses))", "trajectory"),
        ("UPDATE frames SET keyframes = ids", "trajectory"),
        ("INSERT INTO loop_edges VALUES (0, 777, 0)", "loop edge"),
        ("UPDATE cameras SET scale_factor = 1e300", "pyramid"),
        ("CREATE TABLE more (x)", "tables"),
        ("DROP TABLE images", "tables|images"),
    ],
)
@pytest.mark.filterwarnings("error")
def test_edited_numbers_are_refused(tmp_path: Path, statement: str, what: str) -> None:
    path = written(tmp_path)
    if statement.startswith("DROP"):
        with closing(sqlite3.connect(path)) as connection, connection:
            connection.execute(statement)
    else:
        edit(path, statement)
    _refused(path, what, "copy of the file")


def test_a_map_from_before_there_was_a_choice_has_the_places_of_the_original(
    tmp_path: Path,
) -> None:
    path = written(tmp_path)
    assert not load_map(path).settings.orb.original_coordinates
    line = "ORBextractor.originalCoordinates: 0"
    edit(path, f"UPDATE settings SET yaml = replace(yaml, '{line}', '')")
    assert load_map(path).settings.orb.original_coordinates


def test_lost_rows_are_noticed(tmp_path: Path) -> None:
    path = written(tmp_path)
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.execute("DELETE FROM covisibility WHERE keyframe = 0")
    _refused(path, "lost rows")


def test_a_locked_file_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(map_writer, "LOCK_PATIENCE", 0.1)
    path = written(tmp_path)
    with closing(sqlite3.connect(path, isolation_level=None)) as connection:
        connection.execute("BEGIN EXCLUSIVE")
        _refused(path, "locked by another program", "wait for it")
        with pytest.raises(MapFileError, match="another program is writing it"):
            save_map(small_map(), path)
    load_map(path)


def test_where_nothing_can_be_written(tmp_path: Path) -> None:
    with pytest.raises(MapFileError, match="is a folder"):
        save_map(small_map(), tmp_path)
    with pytest.raises(MapFileError, match="make the folder"):
        save_map(small_map(), tmp_path / "no" / "map.orbmap")
    assert list(tmp_path.iterdir()) == []


def test_an_empty_map_is_not_saved(tmp_path: Path) -> None:
    nothing = dataclasses.replace(small_map(), contents=take_contents(core.Map()))
    with pytest.raises(MapFileError, match="no keyframes"):
        save_map(nothing, tmp_path / "map.orbmap")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(os.geteuid() == 0, reason="the superuser may write everywhere")
def test_a_read_only_file_is_kept(tmp_path: Path) -> None:
    path = written(tmp_path)
    path.chmod(0o444)
    with pytest.raises(MapFileError, match="read-only"):
        save_map(small_map(), path)
    load_map(path)


@pytest.mark.parametrize("foreign", ["a film", "a database"])
def test_a_file_that_is_no_map_is_not_replaced(tmp_path: Path, foreign: str) -> None:
    path = tmp_path / "mine"
    if foreign == "a database":
        with closing(sqlite3.connect(path)) as connection:
            connection.execute("CREATE TABLE messages (id INTEGER)")
    else:
        path.write_bytes(b"not a map")
    before = path.read_bytes()
    with pytest.raises(MapFileError, match="no map file; choose another name, or remove it"):
        save_map(small_map(), path)
    assert path.read_bytes() == before
    assert [file.name for file in tmp_path.iterdir()] == ["mine"]


def test_an_empty_file_and_a_map_are_replaced(tmp_path: Path) -> None:
    path = tmp_path / "mine"
    path.touch()
    for _ in range(2):
        save_map(small_map(), path)
    load_map(path)


def test_a_private_map_stays_private(tmp_path: Path) -> None:
    path = tmp_path / f"{'m' * 240}.orbmap"  # as long as names may be, nearly
    save_map(small_map(), path)
    path.chmod(0o600)
    save_map(small_map(), path)
    assert path.stat().st_mode & 0o777 == 0o600

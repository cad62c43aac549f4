# SPDX-License-Identifier: BSD-3-Clause
"""Files that are kept up to date: whatever comes between, no map is lost and none replaces another.

What comes between is a reset, a reader, a Ctrl-C, an error that nobody has thought of.
"""

from __future__ import annotations

import functools
import logging
import shutil
import sqlite3
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import pytest

from orbslam2py import MapFileError, Sensor, System, WorkerError
from orbslam2py.maps import MapContents, load_map, map_autosave, map_writer, verify_map_file
from orbslam2py.maps.map_autosave import MapAutosave
from orbslam2py.maps.map_rows import all_rows
from orbslam2py.maps.map_writer import MapWriter
from support import small_sequences
from support.saved_maps import small_map
from support.worker_steps import eventually


def new_system(**options: object) -> System:
    return small_sequences.new_system(Sensor.RGBD, **{"deterministic": True, **options})


def assert_holds(path: Path, contents: MapContents) -> None:
    """The file is whole, and of these contents."""
    assert contents.first_difference(verify_map_file(path).contents) is None


def names_in(folder: Path) -> list[str]:
    return sorted(file.name for file in folder.iterdir())


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody waits two seconds for a reader that stays."""
    monkeypatch.setattr(map_writer, "LOCK_PATIENCE", 0.02)


@contextmanager
def reader(path: Path) -> Iterator[sqlite3.Connection]:
    """Another program that looks at the file as it is now, and takes its time."""
    with closing(sqlite3.connect(f"{path.as_uri()}?mode=ro", uri=True)) as connection:
        connection.execute("BEGIN")
        connection.execute("SELECT count(*) FROM keyframes").fetchone()
        yield connection


# ---- resets --------------------------------------------------------------------------------------
@pytest.mark.usefixtures("impatient")
def test_a_new_map_leaves_a_file_alone_that_somebody_reads(tmp_path: Path) -> None:
    path = tmp_path / "map.orbmap"
    with new_system() as slam:
        slam.autosave(path, every=1000)
        small_sequences.play(slam, 30)
        slam.save_map(path)
        old = slam.map_contents()
        with reader(path):
            slam.reset()
            small_sequences.play(slam, 6)
            for _ in range(3):
                slam.save_map(path)
        new = slam.map_contents()
    assert_holds(path, old)
    assert_holds(tmp_path / "map-1.orbmap", new)


def test_a_reset_in_the_moment_of_a_save(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is copied may be another map than there was when the save began."""
    path = tmp_path / "map.orbmap"
    with new_system() as slam:
        slam.autosave(path, every=1000)
        small_sequences.play(slam, 30)
        slam.save_map(path)
        old = slam.map_contents()
        take_changes = map_autosave.take_changes

        def reset_first(*arguments: Any, **options: Any) -> Any:
            monkeypatch.setattr(map_autosave, "take_changes", take_changes)
            slam.reset()
            small_sequences.play(slam, 6)
            return take_changes(*arguments, **options)

        monkeypatch.setattr(map_autosave, "take_changes", reset_first)
        slam.save_map(path)
        new = slam.map_contents()
    assert_holds(path, old)
    assert_holds(tmp_path / "map-1.orbmap", new)


def test_saving_to_the_file_of_the_new_map_goes_on_with_it(tmp_path: Path) -> None:
    path = tmp_path / "map.orbmap"
    with new_system() as slam:
        slam.autosave(path, every=1000)
        small_sequences.play(slam, 20)
        slam.save_map(path)
        slam.reset()
        small_sequences.play(slam, 6)
        slam.save_map(path)
        slam.save_map(tmp_path / "map-1.orbmap")
        small_sequences.play(slam, 24, first=6)
        new = slam.map_contents()
    assert_holds(tmp_path / "map-1.orbmap", new)
    assert names_in(tmp_path) == ["map-1.orbmap", "map.orbmap"]


# ---- the end -------------------------------------------------------------------------------------
@pytest.mark.usefixtures("impatient")
def test_a_reader_does_not_keep_a_system_from_ending(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "map.orbmap"
    slam = new_system()
    slam.autosave(path, every=1000)
    small_sequences.play(slam, 20)
    slam.save_map(path)
    small_sequences.play(slam, 20, first=20)
    with reader(path), caplog.at_level(logging.WARNING):
        slam.shutdown()
        assert_holds(path, slam.map_contents())
    assert_holds(path, slam.map_contents())
    (told,) = [record.getMessage() for record in caplog.records]
    assert f"another program has {path} open" in told
    assert "keep map.orbmap-wal beside it" in told
    with closing(MapWriter(path)) as writer:
        writer.commit(all_rows(small_map()))
    assert_holds(path, small_map().contents)
    assert names_in(tmp_path) == ["map.orbmap"]


@pytest.mark.usefixtures("impatient")
def test_beside_a_reader_that_rests_the_file_alone_holds_all(tmp_path: Path) -> None:
    path = tmp_path / "map.orbmap"
    with closing(MapWriter(path)) as writer:
        writer.commit(all_rows(small_map(frames=20)))
        with reader(path) as connection:
            connection.execute("COMMIT")
            writer.commit(all_rows(small_map()))
            writer.close()
            alone = shutil.copy(path, tmp_path / "alone.orbmap")
        assert_holds(alone, small_map().contents)
    assert_holds(path, small_map().contents)


class CtrlC:
    """A Ctrl-C that comes while SQLite does something: it is heard when that is done, and once."""

    def __init__(self) -> None:
        self.after = ""
        self.came = 0

    def hear(self, statement: str) -> None:
        if self.after and statement.startswith(self.after):
            self.after = ""
            self.came += 1
            raise KeyboardInterrupt


@pytest.fixture
def ctrl_c(monkeypatch: pytest.MonkeyPatch) -> CtrlC:
    """Set `CtrlC.after` to the beginning of a statement."""
    ctrl_c = CtrlC()

    class Connection(sqlite3.Connection):
        def execute(self, sql: str, *parameters: Any) -> sqlite3.Cursor:
            done = super().execute(sql, *parameters)
            ctrl_c.hear(sql)
            return done

    connect = functools.partial(sqlite3.connect, factory=Connection)
    monkeypatch.setattr(sqlite3, "connect", connect)
    return ctrl_c


@pytest.mark.parametrize("begun", [True, False], ids=["later save", "first save"])
@pytest.mark.parametrize(
    "statement",
    [
        "BEGIN IMMEDIATE",
        "INSERT INTO keyframes",
        "COMMIT",
        "PRAGMA journal_mode = WAL",
        "PRAGMA synchronous = NORMAL",
        "PRAGMA journal_mode = DELETE",
    ],
)
def test_after_a_ctrl_c_in_the_last_save_shutdown_saves(
    tmp_path: Path, ctrl_c: CtrlC, statement: str, begun: bool
) -> None:
    path = tmp_path / "map.orbmap"
    slam = new_system()
    slam.autosave(path, every=1000)
    small_sequences.play(slam, 15)
    if begun:
        slam.save_map(path)
        small_sequences.play(slam, 25, first=15)
    ctrl_c.after = statement
    if begun and statement in ("PRAGMA journal_mode = WAL", "PRAGMA synchronous = NORMAL"):
        slam.shutdown()  # only a first save has these
    else:
        with pytest.raises(KeyboardInterrupt):
            slam.shutdown()
        assert ctrl_c.came == 1
        slam.shutdown()
    assert_holds(path, slam.map_contents())
    assert names_in(tmp_path) == ["map.orbmap"]
    assert "autosave" not in {thread.name for thread in threading.enumerate()}


def test_after_a_ctrl_c_before_the_last_save_shutdown_saves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Here it comes while the last save waits for the one that is under way."""
    path = tmp_path / "map.orbmap"
    slam = new_system()
    slam.autosave(path, every=1000)
    small_sequences.play(slam, 15)
    join = threading.Thread.join

    def interrupted(thread: threading.Thread, timeout: float | None = None) -> None:
        if thread.name == "autosave":
            monkeypatch.setattr(threading.Thread, "join", join)
            raise KeyboardInterrupt
        join(thread, timeout)

    monkeypatch.setattr(threading.Thread, "join", interrupted)
    with pytest.raises(KeyboardInterrupt):
        slam.shutdown()
    slam.shutdown()
    assert_holds(path, slam.map_contents())


def test_what_was_committed_when_a_ctrl_c_came_is_known(tmp_path: Path, ctrl_c: CtrlC) -> None:
    """Rows that nobody knew of would stay in the file when the map has lost them."""
    path = tmp_path / "map.orbmap"
    small, large = small_map(frames=20), small_map()
    with closing(MapWriter(path)) as writer:
        writer.commit(all_rows(small))
        ctrl_c.after = "COMMIT"
        with pytest.raises(KeyboardInterrupt):
            writer.commit(all_rows(large))
        assert_holds(path, large.contents)
        writer.commit(all_rows(small))
        assert_holds(path, small.contents)


# ---- errors --------------------------------------------------------------------------------------
@pytest.mark.parametrize("error", [MemoryError(), KeyError(7), RuntimeError("nobody knows why")])
def test_an_error_that_nobody_has_thought_of_is_told_and_saving_goes_on(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    error: Exception,
) -> None:
    path = tmp_path / "map.orbmap"
    update = MapAutosave.update
    failing = threading.Event()
    failing.set()

    def fails(*arguments: Any, **options: Any) -> Any:
        if failing.is_set():
            raise error
        return update(*arguments, **options)

    monkeypatch.setattr(MapAutosave, "update", fails)
    with new_system() as slam, caplog.at_level(logging.WARNING):
        small_sequences.play(slam, 10)
        slam.autosave(path, every=0.01)
        eventually(lambda: len(caplog.records) >= 2)
        assert not path.exists()
        failing.clear()
        eventually(path.exists)
    told = {record.getMessage() for record in caplog.records}
    (text,) = told
    assert text.startswith("autosave failed and will be tried again: ")
    assert type(error).__name__ in text
    assert str(error) in text


def test_a_last_save_that_fails_is_told_though_a_worker_failed_as_well(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def unsaved(_: MapAutosave) -> None:
        raise MapFileError("the disk is full")

    slam = new_system()
    small_sequences.play(slam, 10)
    slam.autosave(tmp_path / "map.orbmap", every=1000.0)
    stopped = WorkerError("local mapping stopped: out of order")
    with monkeypatch.context() as patch:
        patch.setattr(slam.pipeline.back_end, "finish", lambda **_: [stopped])
        patch.setattr(MapAutosave, "stop_autosave", unsaved)
        with caplog.at_level(logging.ERROR), pytest.raises(WorkerError, match="out of order"):
            slam.shutdown()
    (record,) = caplog.records
    assert record.getMessage() == "shutdown failed otherwise as well: the disk is full"
    assert record.exc_info is not None, "with what led there"
    slam.shutdown()


def test_after_a_first_save_that_failed_late_the_next_one_is_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is in the file can no longer be added to: all of it is written once more."""
    path = tmp_path / "map.orbmap"
    connect = map_writer.connect

    def refuses_once(file: Path, mode: str) -> sqlite3.Connection:
        if file == path and path.exists():
            monkeypatch.setattr(map_writer, "connect", connect)
            raise sqlite3.OperationalError("unable to open database file")
        return connect(file, mode)

    with new_system() as slam:
        slam.autosave(path, every=1000)
        small_sequences.play(slam, 15)
        monkeypatch.setattr(map_writer, "connect", refuses_once)
        with pytest.raises(MapFileError, match="not writable"):
            slam.save_map(path)
        small_sequences.play(slam, 15, first=15)
        slam.save_map(path)
        assert_holds(path, slam.map_contents())


# ---- images of keyframes -------------------------------------------------------------------------
def kept_images(slam: System) -> set[int]:
    return set(slam.pipeline.keeper._images)


def test_images_of_keyframes_that_went_are_dropped_with_the_next_save(tmp_path: Path) -> None:
    path = tmp_path / "map.orbmap"
    with new_system(keyframe_images=True) as slam:
        slam.autosave(path, every=1000)
        for number, save in enumerate((slam.saved_map, lambda: slam.save_map(path)), start=1):
            small_sequences.play(slam, 30, first=30 * (number - 1))
            before = set(slam.map_contents().keyframes.ids.tolist())
            assert kept_images(slam) == before
            assert slam.pipeline.back_end.map.erase_keyframe(number)
            save()
            assert kept_images(slam) == before - {number}
        left = kept_images(slam)
    assert set(load_map(path, images=True).images) == left


def test_images_of_keyframes_that_went_are_dropped_without_a_save(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(map_autosave, "_FEW_IMAGES", 10)
    with new_system(keyframe_images=True) as slam:
        small_sequences.play(slam, 20)
        alive = kept_images(slam)
        assert alive == set(slam.map_contents().keyframes.ids.tolist())
        for gone in range(100, 200):
            slam.pipeline.keeper.keep_image(gone, b"of a keyframe that was culled at once")
        assert kept_images(slam) >= alive
        assert len(kept_images(slam)) <= 10


def test_images_of_keyframes_that_wait_for_mapping_are_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "map.orbmap"
    with new_system(keyframe_images=True) as slam:
        slam.autosave(path, every=1000)
        small_sequences.play(slam, 20)
        mapping = slam.pipeline.back_end.mapping
        with monkeypatch.context() as patch:
            patch.setattr(mapping, "start", lambda: None)
            small_sequences.play(slam, 20, first=20)
            slam.save_map(path)
            n = slam.n_keyframes
        mapping.start()
        assert slam.n_keyframes > n
    saved = load_map(path, images=True)
    assert set(saved.images) == set(saved.contents.keyframes.ids.tolist())


class LateImages(dict[int, bytes]):
    """Images of a map that was given up; that of the next one comes when they are looked at."""

    def __init__(self, slam: System) -> None:
        keeper = slam.pipeline.keeper
        super().__init__(keeper._images)
        self._next = functools.partial(keeper.keep_image, 0, b"of the next map")

    def items(self) -> Any:
        found = super().items()
        self._next()
        return found


def test_images_of_an_earlier_map_are_of_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A save may come when the new map has a keyframe, of which no image has been kept yet."""
    path = tmp_path / "map.orbmap"
    with new_system(keyframe_images=True) as slam:
        slam.autosave(path, every=1000)
        small_sequences.play(slam, 20)
        slam.save_map(path)
        with monkeypatch.context() as patch:
            patch.setattr(slam.pipeline.keeper, "keep_image", lambda *_: None)
            slam.reset()
            small_sequences.play(slam, 2)
        assert slam.saved_map().images == {}
        slam.pipeline.keeper._images = LateImages(slam)
        slam.save_map(path)
        old = load_map(path, images=True).images
        new = load_map(tmp_path / "map-1.orbmap", images=True).images
    assert len(old) > 1
    assert new in ({}, {0: b"of the next map"})


# ---- a system that nobody holds any more ---------------------------------------------------------
def test_a_system_that_is_dropped_in_the_thread_that_saves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What drops things that refer to each other runs in any thread; none waits for its own end."""
    path = tmp_path / "m.orbmap"
    small_sequences.play(system := new_system(), 5)
    taken, dropped = map_autosave.take_changes, threading.Event()

    def take_and_drop(*arguments: Any, **options: Any) -> Any:
        if threading.current_thread().name == "autosave" and not dropped.is_set():
            dropped.set()
            system._finalizer()
        return taken(*arguments, **options)

    monkeypatch.setattr(map_autosave, "take_changes", take_and_drop)
    system.autosave(path, every=0.01)
    assert dropped.wait(10)
    eventually(lambda: not {"autosave", "abandon"} & {t.name for t in threading.enumerate()})
    assert_holds(path, system.map_contents())

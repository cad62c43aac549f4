# SPDX-License-Identifier: BSD-3-Clause
"""Sequences from elsewhere and from archives, in a cache that stays bounded."""

from __future__ import annotations

import functools
import http.server
import io
import os
import shutil
import tarfile
import threading
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import orbslam2py as orb
from orbslam2py.batches import make_jobs
from orbslam2py.batches.cache import Cache, cache_size_of
from orbslam2py.batches.remote import here, is_remote, name_of
from support.batches import make_sequences, reproducible
from support.small_disk import small_disk


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two sequences, and one of them packed in several ways."""
    folder = make_sequences(tmp_path_factory.mktemp("data"))
    shutil.make_archive(str(folder / "packed"), "zip", folder, "one")
    shutil.make_archive(str(folder / "loose"), "zip", folder / "one")
    shutil.make_archive(str(folder / "one"), "gztar", folder, "one")
    return folder


class _Quiet(http.server.SimpleHTTPRequestHandler):
    asked: list[str] = []  # noqa: RUF012

    def log_message(self, format: str, *arguments: Any) -> None:  # noqa: A002
        self.asked.append(str(arguments[0]))


@pytest.fixture
def server(data: Path) -> Iterator[str]:
    """The data on a web server of this computer."""
    pytest.importorskip("aiohttp", reason="orbslam2py[remote] brings it")
    _Quiet.asked = []
    handler = functools.partial(_Quiet, directory=str(data))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as served:
        thread = threading.Thread(target=served.serve_forever)
        thread.start()
        yield f"http://127.0.0.1:{served.server_port}"
        served.shutdown()
        thread.join()


def run(path: str, folder: Path, **more: Any) -> orb.batches.BatchResult:
    document = {"sequences": [{"path": path, "name": "x"}]}
    document["options"] = {"deterministic": True, "max_frames": 4}
    return orb.batch(document, folder, workers=0, cache=folder.parent / "cache", **more)


def without_place(folder: Path) -> bytes:
    """The table without where the sequence came from."""
    lines = reproducible(folder).split(b",")
    return b",".join(part for part in lines if not part.startswith((b"path=", b"fingerprint=")))


@pytest.fixture(scope="module")
def plain(data: Path, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    folder = tmp_path_factory.mktemp("plain") / "out"
    assert run(str(data / "one"), folder).n_failed == 0
    return without_place(folder)


@pytest.mark.parametrize("name", ["packed.zip", "loose.zip", "one.tar.gz"])
def test_archives(data: Path, plain: bytes, tmp_path: Path, name: str) -> None:
    done = run(str(data / name), tmp_path / "out")
    assert done.n_failed == 0, done.rows
    assert without_place(tmp_path / "out") == plain


@pytest.mark.watchdog(60)
@pytest.mark.parametrize("place", ["/one/", "/packed.zip", "/one.tar.gz"])
def test_web(server: str, plain: bytes, tmp_path: Path, place: str) -> None:
    done = run(server + place, tmp_path / "out")
    assert done.n_failed == 0, done.rows
    assert without_place(tmp_path / "out") == plain
    n_asked = len(_Quiet.asked)
    again = run(server + place, tmp_path / "again")
    assert again.n_failed == 0
    assert len(_Quiet.asked) == n_asked, "it was in the cache"


def test_a_folder_in_an_archive(data: Path, plain: bytes, tmp_path: Path) -> None:
    pytest.importorskip("fsspec", reason="orbslam2py[remote] brings it")
    done = run(f"zip://one::file://{data}/packed.zip", tmp_path / "out")
    assert done.n_failed == 0, done.rows
    assert without_place(tmp_path / "out") == plain


def test_the_longest_unused_makes_room(tmp_path: Path) -> None:
    cache = Cache(tmp_path / "cache", 1000)

    def have(name: str, size: int) -> Path:
        def fetch(folder: Path, reserve: Any) -> None:
            reserve(size)
            (folder / "file").write_bytes(bytes(size))

        with cache.holding(name, fetch) as found:
            return found

    one, two = have("one", 400), have("two", 400)
    os.utime(one, (1, 1))
    os.utime(two, (2, 2))
    assert have("one", 400) == one  # used again
    three = have("three", 500)
    assert [path.is_dir() for path in (one, two, three)] == [True, False, True]
    with pytest.raises(orb.DatasetError, match=r"big takes 1.2 KB, more than the cache of 1 KB"):
        have("big", 1200)
    assert not list((tmp_path / "cache").glob("*.part"))
    with (
        cache.holding("one", lambda *_: None),
        cache.holding("three", lambda *_: None),
        pytest.raises(orb.DatasetError, match=r"no room for four .* give more with --cache-size"),
    ):
        have("four", 300)
    assert have("four", 300).is_dir()


def test_one_fetch_for_all_who_want_it(tmp_path: Path) -> None:
    cache, fetched = Cache(tmp_path / "cache", 1000), []
    begun = threading.Event()

    def fetch(folder: Path, reserve: Any) -> None:
        fetched.append(folder)
        begun.wait(10)
        (folder / "file").write_bytes(b"x")

    def want() -> None:
        with cache.holding("same", fetch) as found:
            assert (found / "file").is_file()

    threads = [threading.Thread(target=want) for _ in range(3)]
    for thread in threads:
        thread.start()
    begun.set()
    for thread in threads:
        thread.join()
    assert len(fetched) == 1


def test_nothing_is_written_outside(tmp_path: Path) -> None:
    with tarfile.open(tmp_path / "bad.tar", "w") as tar:
        member = tarfile.TarInfo("../../out.txt")
        member.size = 1
        tar.addfile(member, io.BytesIO(b"x"))
    cache = Cache(tmp_path / "a/b/cache", 1000)
    with (
        pytest.raises(orb.DatasetError, match="leads out of it"),
        here(str(tmp_path / "bad.tar"), cache),
    ):
        pass
    assert not list(tmp_path.rglob("out.txt"))


@pytest.mark.watchdog(60)
def test_missing_objects(server: str, tmp_path: Path) -> None:
    for place in ("/none.zip", "/none/"):
        row = run(server + place, tmp_path / place.strip("/")).rows[0]
        assert row["reason"] == f"{server}{place} does not exist; correct the path of the sequence"
    gone = "http://127.0.0.1:9/one.zip"
    row = run(gone, tmp_path / "gone").rows[0]
    assert row["reason"] == f"{gone} cannot be reached; check the address and the network"


def test_broken_archives(data: Path, tmp_path: Path) -> None:
    for name in ("packed.zip", "one.tar.gz"):
        whole = (data / name).read_bytes()
        (tmp_path / name).write_bytes(whole[: len(whole) // 2])
        row = run(str(tmp_path / name), tmp_path / f"{name}.out").rows[0]
        assert "is no whole archive; fetch or pack it again" in row["reason"]


def test_an_archive_is_not_read_up_to_what_is_spoilt_in_it(tmp_path: Path) -> None:
    path = tmp_path / "spoilt.tar"
    with tarfile.open(path, "w") as tar:
        for name in ("1.txt", "2.txt", "3.txt"):
            member = tarfile.TarInfo(name)
            member.size = 1
            tar.addfile(member, io.BytesIO(b"x"))
    spoilt = bytearray(path.read_bytes())
    spoilt[2 * 2 * tarfile.BLOCKSIZE] ^= 1  # the header of the last: each has one, and a block
    path.write_bytes(spoilt)
    cache = Cache(tmp_path / "cache", 10_000)
    with pytest.raises(orb.DatasetError, match="is no whole archive"), here(str(path), cache):
        pass


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("nfs9://host/one", "there is no protocol nfs9://; give one that fsspec knows"),
        ("oci://bucket/one", "oci:// needs a package that is not installed"),
    ],
)
def test_protocols(path: str, message: str) -> None:
    pytest.importorskip("fsspec", reason="orbslam2py[remote] brings it")
    with pytest.raises((orb.DatasetError, orb.SettingsError), match=message):
        make_jobs({"sequences": [path]})


def test_full_disk(data: Path, tmp_path: Path) -> None:
    with small_disk(tmp_path / "disk", "300k") as disk:
        cache = Cache(disk / "cache", cache_size_of("1GB"))
        message = r"cannot write to the cache .*/cache: No space left on device; make room, or give"
        with pytest.raises(orb.DatasetError, match=message), here(str(data / "one.tar.gz"), cache):
            pass
        assert not list((disk / "cache").glob("*.part"))


def test_names(tmp_path: Path) -> None:
    assert name_of("s3://bucket/all/rgbd_dataset_freiburg1_desk.tgz") == (
        "rgbd_dataset_freiburg1_desk"
    )
    assert name_of("https://host/MH_01_easy.zip?version=2") == "MH_01_easy"
    assert name_of("zip://inner/06::https://host/all.zip") == "06"
    assert name_of("gs://bucket/desk/") == "desk"
    assert is_remote("s3://a/b")
    assert not is_remote(str(tmp_path))
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as packed:
        packed.writestr("__MACOSX/x", "")
        packed.writestr("MH_01/mav0/cam0/data.csv", "x")
    with here(str(tmp_path / "a.zip"), Cache(tmp_path / "cache", 1000)) as found:
        assert found.name == "MH_01"

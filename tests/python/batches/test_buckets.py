# SPDX-License-Identifier: BSD-3-Clause
"""Sequences in buckets, and results in buckets: over the protocols of real stores."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import orbslam2py as orb
from support.batches import jobs_of, make_sequences, reproducible
from support.buckets import gs_store, s3_store

fsspec = pytest.importorskip("fsspec", reason="orbslam2py[remote] brings it")
pytestmark = pytest.mark.watchdog(120)


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two sequences, and one of them packed."""
    folder = tmp_path_factory.mktemp("made") / "data"
    folder.mkdir()
    make_sequences(folder)
    shutil.make_archive(str(folder.parent / "packed"), "gztar", folder, "one")
    return folder


@pytest.fixture(scope="module")
def plain(data: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What comes out where everything is on this computer."""
    folder = tmp_path_factory.mktemp("plain") / "out"
    assert orb.batch(short_jobs(data), folder, workers=0).n_failed == 0
    return folder


@pytest.fixture(scope="module", params=["s3", "gs"])
def bucket(request: pytest.FixtureRequest, data: Path) -> Iterator[str]:
    """A bucket with the sequences."""
    with s3_store() if request.param == "s3" else gs_store() as address:
        files, root = fsspec.core.url_to_fs(address)
        for path in sorted(data.parent.rglob("*")):
            if path.is_file():
                name = path.relative_to(data.parent).as_posix()
                files.put_file(str(path), f"{root}/{name}")
        yield address


def short_jobs(data: Path) -> dict[str, Any]:
    return jobs_of(data, seeds=1, options={"deterministic": True, "max_frames": 3})


def size_of(folder: Path) -> int:
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())


def test_sequences(bucket: str, data: Path, plain: Path, tmp_path: Path) -> None:
    """Read through a cache that has room for one and a half of them."""
    limit = int(1.5 * size_of(data / "one"))
    document = short_jobs(data)
    document["sequences"] = [f"{bucket}/data/one", f"{bucket}/data/two/"]
    cache, seen = tmp_path / "cache", []
    done = orb.batch(
        document,
        tmp_path / "out",
        workers=0,
        cache=cache,
        cache_size=f"{limit}B",
        progress=lambda *_: seen.append(size_of(cache)),
    )
    assert (len(done.rows), done.n_failed) == (2, 0), done.rows
    assert max(seen) <= 1.01 * limit  # with its notes
    for row in done.rows:
        for name in ("trajectory.txt", "points.ply"):
            file = f"runs/{row['run']}/{name}"
            assert (tmp_path / "out" / file).read_bytes() == (plain / file).read_bytes()


def test_an_archive(bucket: str, plain: Path, tmp_path: Path) -> None:
    document = short_jobs(tmp_path)
    document["sequences"] = [{"path": f"{bucket}/packed.tar.gz", "name": "one"}]
    done = orb.batch(document, tmp_path / "out", workers=0, cache=tmp_path / "cache")
    (row,) = done.rows
    assert row["state"] == "done", row["reason"]
    file = f"runs/{row['run']}/trajectory.txt"
    assert (tmp_path / "out" / file).read_bytes() == (plain / file).read_bytes()


def test_results(bucket: str, data: Path, plain: Path, tmp_path: Path) -> None:
    """The same files as in a folder; gone on with where a run is missing."""
    place, document = f"{bucket}/results/night", short_jobs(data)
    done = orb.batch(document, place, workers=0)
    assert (done.n_failed, done.folder) == (0, place)
    assert f"{place}/results.csv" in done.files
    fetched = fetch(place, tmp_path / "fetched")
    assert reproducible(fetched) == reproducible(plain)
    for row in done.rows:
        here, there = (folder / "runs" / row["run"] for folder in (fetched, plain))
        assert {path.name for path in here.iterdir()} == {path.name for path in there.iterdir()}
        for name in ("trajectory.txt", "points.ply", "keyframes.txt"):
            assert (here / name).read_bytes() == (there / name).read_bytes()
    with pytest.raises(
        orb.DatasetError,
        match=r"night holds a batch already; continue with "
        r"--resume",
    ):
        orb.batch(document, place, workers=0)
    files, root = fsspec.core.url_to_fs(place)
    lost = done.rows[1]["run"]
    files.rm_file(f"{root}/runs/{lost}/row.json")
    ran: list[str] = []
    again = orb.batch(
        document, place, workers=0, resume=True, progress=lambda row, *_: ran.append(row["run"])
    )
    assert ran == [lost]
    assert again.n_left == 0
    assert reproducible(fetch(place, tmp_path / "again")) == reproducible(plain)


def fetch(place: str, folder: Path) -> Path:
    files, root = fsspec.core.url_to_fs(place)
    files.invalidate_cache()
    for name in files.find(root):
        target = folder / name.removeprefix(root).lstrip("/")
        target.parent.mkdir(parents=True, exist_ok=True)
        files.get_file(name, str(target))
    return folder


def test_places_that_cannot_take_results(bucket: str, data: Path) -> None:
    document = short_jobs(data)
    with pytest.raises(orb.DatasetError, match="data is not empty and holds no batch; give anoth"):
        orb.batch(document, f"{bucket}/data", workers=0)
    nowhere = f"{bucket}-of-nobody/night"
    with pytest.raises(orb.DatasetError, match=f"{nowhere} cannot be used: .*; check the address"):
        orb.batch(document, nowhere, workers=0)


def test_a_sequence_that_is_not_there(bucket: str, tmp_path: Path) -> None:
    path = f"{bucket}/data/none"
    done = orb.batch({"sequences": [path]}, tmp_path / "out", workers=0, cache=tmp_path / "cache")
    assert done.rows[0]["reason"] == f"{path} does not exist; correct the path of the sequence"

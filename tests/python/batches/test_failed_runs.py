# SPDX-License-Identifier: BSD-3-Clause
"""Whatever goes wrong with a run is the reason in its row; the batch and its table go on."""

from __future__ import annotations

import itertools
import logging
import shutil
import tarfile
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import orbslam2py as orb
from orbslam2py.batches import work
from orbslam2py.batches.cache import Cache
from orbslam2py.batches.remote import here
from support.batches import jobs_of, make_sequences, table


@pytest.fixture(scope="module")
def sequences(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_sequences(tmp_path_factory.mktemp("sequences"))


def failing(error: BaseException, name: str) -> Callable[..., Any]:
    """`open_source` that fails for one sequence."""
    real = work.open_source

    def open_source(path: Path, *rest: Any, **more: Any) -> Any:
        if Path(path).name == name:
            raise error
        return real(path, *rest, **more)

    return open_source


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (zlib.error("Error -3 while decompressing data"), "error: Error -3 while decompressing"),
        (KeyError("width"), "KeyError: 'width'"),
        (NotImplementedError(), "NotImplementedError"),
        (ValueError("two\nlines"), "ValueError: two lines"),
    ],
)
def test_what_nobody_foresaw_is_a_reason(
    sequences: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    error: Exception,
    reason: str,
) -> None:
    monkeypatch.setattr(work, "open_source", failing(error, "one"))
    with caplog.at_level(logging.ERROR):
        done = orb.batch(jobs_of(sequences, seeds=1), tmp_path / "out", workers=0)
    assert [row["state"] for row in done.rows] == ["failed", "done"]
    assert done.rows[0]["reason"].startswith(reason)
    assert [row["reason"] for row in table(tmp_path / "out")][1] == ""
    (record,) = caplog.records
    assert record.getMessage() == f"unexpected error in the run {done.rows[0]['run']}"
    assert record.exc_info is not None
    assert record.exc_info[1] is error


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (orb.DatasetError("a.bag is cut off"), "a.bag is cut off"),
        (OSError(5, "Input/output error", "a.png"), "a.png: Input/output error"),
        (MemoryError("Unable to allocate 9 GiB"), "Unable to allocate 9 GiB"),
    ],
)
def test_what_was_foreseen_needs_no_traceback(
    sequences: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    error: Exception,
    reason: str,
) -> None:
    monkeypatch.setattr(work, "open_source", failing(error, "one"))
    done = orb.batch(jobs_of(sequences, seeds=1), tmp_path / "out", workers=0)
    assert [row["reason"] for row in done.rows] == [reason, None]
    assert not [record for record in caplog.records if record.levelno >= logging.ERROR]


def test_ctrl_c_goes_on_to_the_caller(
    sequences: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(work, "open_source", failing(KeyboardInterrupt(), "one"))
    with pytest.raises(KeyboardInterrupt):
        orb.batch(jobs_of(sequences, seeds=1), tmp_path / "out", workers=0)


def test_what_ends_a_run_on_the_way_is_named_with_its_kind(
    sequences: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = work.open_source

    def open_source(path: Path, *rest: Any, **more: Any) -> Any:
        sequence: Any = real(path, *rest, **more)

        def load(index: int) -> Any:
            raise KeyError("width")

        sequence.load = load
        return sequence

    monkeypatch.setattr(work, "open_source", open_source)
    done = orb.batch(jobs_of(sequences, seeds=1), tmp_path / "out", workers=0)
    assert [row["reason"] for row in done.rows] == ["KeyError: 'width'"] * 2


# ---- archives ------------------------------------------------------------------------------------
NOT_WHOLE = "is no whole archive; fetch or pack it again"
METHODS = {
    "deflated": zipfile.ZIP_DEFLATED,
    "bzip2": zipfile.ZIP_BZIP2,
    "lzma": zipfile.ZIP_LZMA,
}


def text_of_numbers() -> str:
    return "".join(f"{number * number % 7919}.png\n" for number in range(20_000))


def damage(path: Path, begin: int, end: int) -> None:
    """Turn over the bits of some bytes."""
    data = bytearray(path.read_bytes())
    data[begin:end] = (byte ^ 0xFF for byte in data[begin:end])
    path.write_bytes(data)


def reason_of(path: Path, cache: Path) -> str:
    """What is said of an archive that cannot be unpacked; nothing is left of it."""
    with pytest.raises(orb.DatasetError) as raised, here(str(path), Cache(cache, 10**9)):
        pass
    assert not [left for left in cache.iterdir() if left.suffix != ".lock"]
    return str(raised.value)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("where", [(0.1, 0.2), (0.5, 0.501), (0.02, 0.03)])
def test_damaged_zip_files(tmp_path: Path, method: str, where: tuple[float, float]) -> None:
    path = tmp_path / "bad.zip"
    with zipfile.ZipFile(path, "w", METHODS[method]) as packed:
        packed.writestr("bad/rgb.txt", text_of_numbers())
    size = path.stat().st_size
    damage(path, *(int(part * size) for part in where))
    assert reason_of(path, tmp_path / "cache") == f"{path} {NOT_WHOLE}"


@pytest.mark.parametrize(
    ("ending", "where"),
    [
        ("tar", (0.0, 0.01)),  # it can tell of its heads only
        *itertools.product(
            ("tar.gz", "tar.bz2", "tar.xz"), ((0.0, 0.01), (0.2, 0.3), (0.5, 0.501))
        ),
    ],
)
def test_damaged_tar_files(tmp_path: Path, ending: str, where: tuple[float, float]) -> None:
    (tmp_path / "rgb.txt").write_text(text_of_numbers())
    path = tmp_path / f"bad.{ending}"
    kind: Any = "w:" + ending.removeprefix("tar").removeprefix(".")
    with tarfile.open(path, kind) as packed:
        packed.add(tmp_path / "rgb.txt", "bad/rgb.txt")
    size = path.stat().st_size
    damage(path, *(int(part * size) for part in where))
    assert reason_of(path, tmp_path / "cache") == f"{path} {NOT_WHOLE}"


def test_encrypted_zip_files(tmp_path: Path) -> None:
    path = tmp_path / "secret.zip"
    with zipfile.ZipFile(path, "w") as packed:
        packed.writestr("secret/rgb.txt", "1 a.png\n")
    data = path.read_bytes()
    for head, offset in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):  # the flag, at both its places
        at = data.index(head) + offset
        data = data[:at] + b"\x01" + data[at + 1 :]
    path.write_bytes(data)
    told = f"{path} is encrypted; unpack it, and give the folder"
    assert reason_of(path, tmp_path / "cache") == told


def test_zip_files_of_an_unknown_method(tmp_path: Path) -> None:
    path = tmp_path / "new.zip"
    with zipfile.ZipFile(path, "w") as packed:
        packed.writestr("new/rgb.txt", "1 a.png\n")
    data = path.read_bytes()
    for head, offset in ((b"PK\x03\x04", 8), (b"PK\x01\x02", 10)):
        at = data.index(head) + offset
        data = data[:at] + b"\x63" + data[at + 1 :]
    path.write_bytes(data)
    told = f"{path} is packed in a way that is not known here; unpack it, and give the folder"
    assert reason_of(path, tmp_path / "cache") == told


@pytest.mark.parametrize("names", [["a" * 300], ["a/b", "a/b/c"], ["../out.txt"]])
def test_names_that_no_folder_can_hold(tmp_path: Path, names: list[str]) -> None:
    path = tmp_path / "odd.zip"
    with zipfile.ZipFile(path, "w") as packed:
        for name in names:
            packed.writestr(name, "x")
    told = reason_of(path, tmp_path / "cache")
    assert told.startswith(f"{path} ")
    assert told.endswith("pack it again")


def test_a_batch_goes_on_after_a_damaged_archive(sequences: Path, tmp_path: Path) -> None:
    bad = Path(shutil.make_archive(str(tmp_path / "bad"), "zip", sequences, "one"))
    damage(bad, 2000, 2100)
    document: dict[str, Any] = {
        "sequences": [str(bad), str(sequences / "two")],
        "options": {"max_frames": 3},
    }
    done = orb.batch(document, tmp_path / "out", workers=0, cache=tmp_path / "cache")
    assert [row["reason"] for row in done.rows] == [f"{bad} {NOT_WHOLE}", None]
    assert len(table(tmp_path / "out")) == 2

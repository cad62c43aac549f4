# SPDX-License-Identifier: BSD-3-Clause
"""Sequences that are not folders of this computer: archives, and all that fsspec opens."""

from __future__ import annotations

import contextlib
import errno
import gzip
import importlib
import io
import re
import shutil
import tarfile
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path, PurePosixPath
from typing import IO, Any

from orbslam2py._files import reason_of
from orbslam2py.batches.cache import Cache
from orbslam2py.errors import DatasetError, OrbSlamError, SettingsError

_ADDRESS = re.compile(r"([A-Za-z][A-Za-z0-9+]*)(?:://|::)")
_ARCHIVES = (".zip", ".tar", ".tar.gz", ".tgz", ".tar.bz2", ".tbz2", ".tar.xz", ".txz")
#: What some archives hold beside the folder that is meant.
_NOT_MEANT = ("__MACOSX",)
#: Bit of the flags of a file in a zip file.
_ENCRYPTED = 0x1
#: Errors of the file system for names that are too long, or for a file in the place of a folder.
_ERRORS_OF_NAMES = (errno.ENAMETOOLONG, errno.EEXIST, errno.ENOTDIR, errno.EISDIR)


def is_remote(path: str) -> bool:
    """Return whether a path is an address such as ``s3://bucket/desk``."""
    return _ADDRESS.match(path) is not None


def is_archive(path: str) -> bool:
    """Return whether a path is that of a zip or tar file, by its name."""
    return path.lower().endswith(_ARCHIVES)


def name_of(path: str) -> str:
    """Return the name of the sequence at an address or in an archive."""
    last = PurePosixPath(path.partition("::")[0].partition("?")[0].rstrip("/")).name
    ending = next((end for end in _ARCHIVES if last.lower().endswith(end)), "")
    return (last.removesuffix(last[-len(ending) :]) if ending else last).partition(".")[0]


def require_protocols(address: str) -> None:
    """Check that fsspec is installed and knows the protocols of an address.

    Raises
    ------
    SettingsError
        If fsspec, or a package that it needs for the protocol, is not installed.
    DatasetError
        If there is no such protocol.
    """
    fsspec = _fsspec()
    for part in address.split("::"):
        protocol = part.partition("://")[0]
        if protocol not in fsspec.available_protocols():
            raise DatasetError(
                f"{address}: there is no protocol {protocol}://; give one that fsspec knows, such "
                "as s3://, gs:// or https://"
            )
        try:
            fsspec.get_filesystem_class(protocol)
        except ImportError as error:
            raise SettingsError(
                f"{protocol}:// needs a package that is not installed: {error}"
            ) from error


@contextlib.contextmanager
def here(path: str, cache: Cache) -> Iterator[Path]:
    """Make a sequence available on this computer: in the cache, if it is remote or in an archive.

    Parameters
    ----------
    path
        A folder, a file, an archive, or an address for fsspec; of a folder in an archive
        ``zip://FOLDER::ADDRESS``.
    cache
        Its destination.

    Yields
    ------
    Path
        Its path, which is valid until the end of the ``with``.

    Raises
    ------
    DatasetError
        If there is nothing at the address, if it cannot be read, or if it is too large.
    SettingsError
        If fsspec is needed but not installed.
    """
    if is_remote(path):
        require_protocols(path)
        with cache.holding(path, lambda folder, reserve: _download(path, folder, reserve)) as found:
            yield _inside(found)
    elif is_archive(path) and Path(path).is_file():
        about = Path(path).stat()
        address = f"{path} {about.st_size} {about.st_mtime_ns}"  # a changed one is another

        def fetch(folder: Path, reserve: Callable[[int], None]) -> None:
            _extract(Path(path), folder / name_of(path), reserve)

        with cache.holding(address, fetch) as found:
            yield _inside(found)
    else:
        yield Path(path)


def _download(address: str, folder: Path, reserve: Callable[[int], None]) -> None:
    fsspec = _fsspec()
    last = PurePosixPath(address.partition("::")[0].partition("?")[0].rstrip("/")).name
    target = folder / (last or "sequence")
    try:
        files, path = fsspec.core.url_to_fs(address)
        if _is_file(address, last, files, path):
            reserve(int(files.info(path).get("size") or 0))
            files.get_file(path, str(target))
        else:
            _download_folder(files, path, target, reserve)
    except FileNotFoundError as error:
        # What reads the web calls every failure so, and names the true one as its cause.
        if isinstance(error.__cause__, OSError):
            raise DatasetError(
                f"{address} cannot be reached; check the address and the network"
            ) from error
        raise DatasetError(f"{address} does not exist; correct the path of the sequence") from error
    except OrbSlamError:
        raise
    except Exception as error:
        # File systems raise errors of their own; a full disk of the cache is reported elsewhere.
        if isinstance(error, OSError) and error.errno:
            raise
        words = " ".join(str(error).split()) or type(error).__name__
        raise DatasetError(f"{address} cannot be read: {words}; try again later") from error
    if is_archive(last):
        packed = target.rename(folder / ".archive")
        _extract(packed, folder / name_of(address), reserve, packed.stat().st_size, address)
        packed.unlink()


def _is_file(address: str, last: str, files: Any, path: str) -> bool:
    if is_archive(last):
        return True
    if address.startswith("http"):  # only reading all of it would show that, which may take long
        return "." in last and not address.endswith("/")
    return bool(files.isfile(path))


def _download_folder(files: Any, path: str, target: Path, reserve: Callable[[int], None]) -> None:
    found = files.find(path, detail=True)
    if not found:
        raise FileNotFoundError(path)
    known = sum(int(one.get("size") or 0) for one in found.values())
    reserve(known)
    got = 0
    for name in found:
        inner = PurePosixPath(name).relative_to(PurePosixPath(path))
        if ".." in inner.parts:
            continue  # a link of a page to what lies above
        (target / inner).parent.mkdir(parents=True, exist_ok=True)
        files.get_file(name, str(target / inner))
        got += (target / inner).stat().st_size
        if got > known:  # web servers do not give sizes in advance
            reserve(got)


def _extract(
    archive: Path,
    folder: Path,
    reserve: Callable[[int], None],
    taken: int = 0,
    name: str | None = None,
) -> None:
    """Unpack an archive; nothing is written outside the folder."""
    named = name or str(archive)
    try:
        if zipfile.is_zipfile(archive):
            _extract_zip(archive, folder, reserve, taken, named)
        else:
            _extract_tar(archive, folder, reserve, taken, named)
    except (OrbSlamError, MemoryError):
        raise
    except NotImplementedError as error:
        raise DatasetError(
            f"{named} is packed in a way that is not known here; unpack it, and give the folder"
        ) from error
    except Exception as error:
        # Each way of packing has errors of its own for bytes that are none of its; what has a
        # number came from the disk, but for names that no disk takes.
        if isinstance(error, OSError) and error.errno:
            if error.errno not in _ERRORS_OF_NAMES:
                raise
            raise DatasetError(
                f"{named} holds names that do not fit beside each other in a folder: "
                f"{reason_of(error)}; pack it again"
            ) from error
        raise DatasetError(f"{named} is no whole archive; fetch or pack it again") from error


def _extract_zip(
    archive: Path, folder: Path, reserve: Callable[[int], None], taken: int, named: str
) -> None:
    with zipfile.ZipFile(archive) as packed:
        members = [one for one in packed.infolist() if not one.is_dir()]
        if any(one.flag_bits & _ENCRYPTED for one in members):
            raise DatasetError(f"{named} is encrypted; unpack it, and give the folder")
        reserve(taken + sum(one.file_size for one in members))
        for one in members:
            _write(packed.open(one), folder, one.filename, named)


def _extract_tar(
    archive: Path, folder: Path, reserve: Callable[[int], None], taken: int, named: str
) -> None:
    with tarfile.open(archive) as tar:
        members = [one for one in tar.getmembers() if one.isfile()]
        _check_end(tar)
        reserve(taken + sum(one.size for one in members))
        for member in members:
            stream = tar.extractfile(member)
            assert stream is not None
            _write(stream, folder, member.name, named)
        assert tar.fileobj is not None
        _read_to_the_end(tar.fileobj)


def _check_end(tar: tarfile.TarFile) -> None:
    """Refuse a damaged header, at which the list of members would end without an error."""
    if isinstance(tar.fileobj, io.BufferedReader):  # what is packed more tightly has a sum of all
        tar.fileobj.seek(tar.offset)
        if any(tar.fileobj.read(tarfile.BLOCKSIZE)):
            raise tarfile.ReadError(f"no header at byte {tar.offset}")


def _read_to_the_end(stream: Any) -> None:
    """Check the unpacked archive: the checksum of all bytes is at its end."""
    try:
        while stream.read(1 << 20):
            pass
    except gzip.BadGzipFile as error:
        if "Not a gzipped file" not in str(error):  # anything behind the end is ignored
            raise


def _write(stream: IO[bytes], folder: Path, name: str, archive: str) -> None:
    inner = PurePosixPath(name)
    if inner.is_absolute() or ".." in inner.parts:
        raise DatasetError(f"{archive} holds '{name}', which leads out of it; pack it again")
    path = folder / inner
    path.parent.mkdir(parents=True, exist_ok=True)
    with stream, path.open("wb") as target:
        shutil.copyfileobj(stream, target, 1 << 20)


def _inside(folder: Path) -> Path:
    """Go down while a folder contains only one folder."""
    while True:
        inner = [path for path in folder.iterdir() if path.name not in _NOT_MEANT]
        if len(inner) != 1 or inner[0].name == "mav0":
            return folder
        folder = inner[0]
        if not folder.is_dir():
            return folder


def _fsspec() -> Any:
    try:
        return importlib.import_module("fsspec")
    except ImportError as error:
        raise SettingsError(
            "sequences from elsewhere are read through fsspec, which is not installed; install it: "
            "pip install 'orbslam2py[remote]'"
        ) from error

# SPDX-License-Identifier: BSD-3-Clause
"""A disk that is too small for a sequence: which folder, why and what to do; nothing is left."""

from __future__ import annotations

import errno
from pathlib import Path

import pytest

from orbslam2py.datasets import Layout
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from support.small_disk import small_disk

pytestmark = pytest.mark.watchdog(60)

BAGS = (Layout.ROSBAG1, Layout.ROSBAG2, Layout.MCAP)


@pytest.mark.parametrize("layout", [Layout.KITTI, Layout.EUROC, *BAGS])
def test_a_full_disk(tmp_path: Path, layout: Layout) -> None:
    if layout in BAGS:
        pytest.importorskip("rosbags")
    made = SyntheticSequence(SyntheticOptions(sensor="mono", frames=30, size=(160, 120)))
    with small_disk(tmp_path / "disk", "120k") as disk:
        folder = disk / "lap"
        with pytest.raises(OSError, match="No space left") as refused:
            made.write(folder, layout)
        assert list(disk.iterdir()) == []
    assert refused.value.errno == errno.ENOSPC
    assert refused.value.strerror == (
        f"cannot write to {folder}: No space left on device; make room, or give another folder"
    )


def test_another_failure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The file beside it, in which all is written first, is nobody's name."""

    def denied(path: Path, *_: object) -> int:
        raise PermissionError(errno.EACCES, "Permission denied", str(path))

    monkeypatch.setattr(Path, "write_bytes", denied)
    made = SyntheticSequence(SyntheticOptions(sensor="mono", frames=2, size=(160, 120)))
    with pytest.raises(PermissionError) as refused:
        made.write(tmp_path / "lap")
    folder = tmp_path / "lap"
    assert refused.value.strerror == (
        f"cannot write to {folder}: Permission denied; give another folder"
    )
    assert refused.value.filename == str(folder)
    assert list(tmp_path.iterdir()) == []

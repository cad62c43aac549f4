# SPDX-License-Identifier: BSD-3-Clause
"""Images that cannot be used: the frame is skipped, and said so."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from support.command_line import CommandLine, Results
from support.spoilt_runs import N, expect_skipped, nth, run

pytestmark = pytest.mark.watchdog(40)


def spoil_empty(path: Path) -> None:
    path.write_bytes(b"")


def spoil_truncated(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-200])


def spoil_text(path: Path) -> None:
    path.write_text("this is no picture\n" * 50)


def spoil_size(path: Path) -> None:
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    cv2.imwrite(str(path), image[:200, :300])


def spoil_folder(path: Path) -> None:
    path.unlink()
    path.mkdir()


def spoil_channels(path: Path) -> None:
    cv2.imwrite(str(path), np.zeros((240, 320, 3), np.uint8))


def spoil_16_bits(path: Path) -> None:
    cv2.imwrite(str(path), np.zeros((240, 320), np.uint16))


EITHER: list[tuple[Callable[[Path], None], str]] = [
    (Path.unlink, "missing"),
    (spoil_empty, "no readable image"),
    (spoil_truncated, "truncated"),
    (spoil_text, "no readable image"),
    (spoil_size, "size"),
    (spoil_folder, "cannot read image"),
]

CASES = [
    *((part, spoil, message) for spoil, message in EITHER for part in ("rgb", "depth")),
    ("rgb", spoil_16_bits, "8 bits"),
    ("depth", spoil_channels, "channels"),
]


@pytest.mark.parametrize(("part", "spoil", "message"), CASES)
def test_one_bad_image(
    command: CommandLine, rgbd: Path, part: str, spoil: Callable[[Path], None], message: str
) -> None:
    """The original ends at once, or crashes if it is a depth image (OD-12)."""
    spoil(nth(rgbd / part))
    expect_skipped(run(command, rgbd), "r", message)


@pytest.mark.parametrize("part", ["image_0", "image_1"])
@pytest.mark.parametrize(
    ("spoil", "message"), [(spoil_truncated, "truncated"), (spoil_size, "size")]
)
def test_one_bad_image_of_a_pair(
    command: CommandLine, stereo: Path, part: str, spoil: Callable[[Path], None], message: str
) -> None:
    spoil(nth(stereo / part))
    expect_skipped(run(command, stereo, "stereo"), "r", message)


def test_sizes_are_told_as_everywhere_and_with_the_file(command: CommandLine, rgbd: Path) -> None:
    """Width before height, and no word about the calls of Python."""
    spoil_size(nth(rgbd / "rgb", 3))
    spoil_size(nth(rgbd / "depth", 5))
    done = run(command, rgbd)
    colour, beside = nth(rgbd / "rgb", 3), nth(rgbd / "rgb", 5)
    assert done.err.splitlines() == [
        "Warning: frame 3 skipped: image has size 300x200, the first image had 320x240; give "
        f"images of one size (it is {colour})",
        "Warning: frame 5 skipped: depth has size 300x200, the image 320x240: width and height "
        "have another ratio (1.500 and 1.333), so they do not show the same view; register depth "
        f"to the image (it is {beside})",
    ]
    frames = Results(Path("r")).frames
    assert frames[5]["reason"].startswith("depth has size"), "equal ones are counted together"


def test_first_image_bad(command: CommandLine, rgbd: Path) -> None:
    spoil_truncated(nth(rgbd / "rgb", 0))
    expect_skipped(run(command, rgbd), "r", "truncated", index=0)


def test_all_images_bad(command: CommandLine, rgbd: Path) -> None:
    for path in (rgbd / "depth").iterdir():
        spoil_truncated(path)
    done = run(command, rgbd)
    assert done.code == 3
    assert "Nothing could be tracked: image " in done.err
    assert Results(Path("r")).report["skipped_frames"] == N


@pytest.mark.parametrize("value", [0, 65535])
def test_depth_without_information_in_the_middle(
    command: CommandLine, rgbd: Path, value: int
) -> None:
    cv2.imwrite(str(nth(rgbd / "depth")), np.full((240, 320), value, np.uint16))
    done = run(command, rgbd)
    assert (done.code, done.err) == (0, "")
    assert Results(Path("r")).report["tracked"] >= N - 1

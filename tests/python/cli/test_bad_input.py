# SPDX-License-Identifier: BSD-3-Clause
"""Bad input and failing disks: a clear error, or a skipped frame; nothing computed is lost."""

from __future__ import annotations

import errno
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

import orbslam2py
from orbslam2py import _core, _files
from orbslam2py.settings.sensor import Sensor
from orbslam2py.synthetic.sequence import SyntheticOptions, SyntheticSequence
from orbslam2py.trajectory.trajectory import read_tum
from support.command_line import CommandLine, Outcome, Results

pytestmark = pytest.mark.watchdog(40)

N = 14
BAD = 6
"""The frame that is spoilt."""
FILES = ("trajectory.txt", "trajectory_online.txt", "keyframes.txt", "trajectory_kitti.txt")
FILES += ("frames.csv", "points.ply", "trajectory.png", "report.json", "settings.yaml")


@pytest.fixture(scope="module")
def originals(tmp_path_factory: pytest.TempPathFactory) -> dict[Sensor, Path]:
    folder = tmp_path_factory.mktemp("sequences")
    made = {}
    for sensor in (Sensor.RGBD, Sensor.STEREO):
        options = SyntheticOptions(world="corridor", sensor=sensor, frames=N, size=(320, 240))
        made[sensor] = SyntheticSequence(options).write(folder / str(sensor))
    return made


@pytest.fixture
def command(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> CommandLine:
    return CommandLine(monkeypatch, capsys, tmp_path)


@pytest.fixture
def rgbd(originals: dict[Sensor, Path], tmp_path: Path) -> Path:
    return Path(shutil.copytree(originals[Sensor.RGBD], tmp_path / "lap"))


@pytest.fixture
def stereo(originals: dict[Sensor, Path], tmp_path: Path) -> Path:
    return Path(shutil.copytree(originals[Sensor.STEREO], tmp_path / "street"))


def nth(folder: Path, index: int = BAD) -> Path:
    return sorted(folder.iterdir())[index]


def expect_skipped(done: Outcome, folder: str, message: str, index: int = BAD) -> None:
    """One frame is left out with a warning; all others have a pose."""
    assert done.code == 0, done.err
    assert done.err.count("Warning: frame") == 1, done.err
    assert f"Warning: frame {index} skipped: " in done.err
    assert message in done.err
    results = Results(Path(folder))
    assert results.report["skipped_frames"] == 1
    assert results.report["tracked"] == results.report["frames"] - 1
    row = results.frames[index]
    assert row["state"] == "SKIPPED"
    assert message in row["reason"]
    assert row["tx"] == row["inliers"] == row["map"] == ""
    assert len(read_tum(Path(folder, "trajectory.txt"))) == results.report["frames"] - 1


def expect_refused(done: Outcome, *messages: str) -> None:
    """Exit code 2, a message, no results."""
    assert done.code == 2, done.err
    assert done.err.startswith("Error: ")
    assert done.err.count("\n") <= 12
    for message in messages:
        assert message in done.err
    assert "Traceback" not in done.err
    assert not Path("r").exists()


def run(command: CommandLine, folder: Path, sensor: str = "rgbd", *more: object) -> Outcome:
    return command("run", folder, "--sensor", sensor, "--output", "r", *more)


# ---- images --------------------------------------------------------------------------------------
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


def test_first_image_bad(command: CommandLine, rgbd: Path) -> None:
    spoil_truncated(nth(rgbd / "rgb", 0))
    expect_skipped(run(command, rgbd), "r", "truncated", index=0)


def test_all_images_bad(command: CommandLine, rgbd: Path) -> None:
    shutil.rmtree(rgbd / "depth")
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


# ---- lists ---------------------------------------------------------------------------------------
def associations(folder: Path) -> list[list[str]]:
    """Read the pairs and see that only this list is used."""
    path = folder / "associations.txt"
    lines = [line.split() for line in path.read_text().splitlines() if not line.startswith("#")]
    assert len(lines) == N
    return lines


def associate(folder: Path, pairs: list[list[str]]) -> None:
    (folder / "associations.txt").write_text("".join(" ".join(pair) + "\n" for pair in pairs))


@pytest.mark.parametrize("steps", [0, -2])
def test_time_stamp_that_repeats_or_goes_back(command: CommandLine, rgbd: Path, steps: int) -> None:
    pairs = associations(rgbd)
    pairs[BAD][0] = pairs[BAD - 1 + steps][0]
    associate(rgbd, pairs)
    done = run(command, rgbd)
    listed = f"time stamp {pairs[BAD][0]} is not after the one before it"
    assert listed in done.err
    expect_skipped(done, "r", "time stamps must grow")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "lists none"),
        ("# nothing\n", "lists none"),
        ("0.0 rgb/0.png\n", "associations.txt:1"),
        ("zero rgb/0.png 0.0 depth/0.png\n", "associations.txt:1"),
        ("nan rgb/0.png 0.0 depth/0.png\n", "associations.txt:1"),
    ],
)
def test_malformed_list(command: CommandLine, rgbd: Path, text: str, message: str) -> None:
    (rgbd / "associations.txt").write_text(text)
    expect_refused(run(command, rgbd), message)


def test_missing_lists(command: CommandLine, rgbd: Path) -> None:
    for path in rgbd.glob("*.txt"):
        path.unlink()
    done = run(command, rgbd)
    assert done.code == 2
    assert str(rgbd) in done.err
    assert not Path("r").exists()


def test_missing_times_of_kitti(command: CommandLine, stereo: Path) -> None:
    (stereo / "times.txt").unlink()
    done = run(command, stereo, "stereo")
    assert done.code == 2
    assert str(stereo) in done.err


def test_colour_image_without_partner(command: CommandLine, rgbd: Path) -> None:
    (rgbd / "associations.txt").unlink()
    path = rgbd / "depth.txt"
    lines = path.read_text().splitlines()
    del lines[-4]
    path.write_text("\n".join(lines) + "\n")
    done = run(command, rgbd)
    assert done.code == 0
    assert "1 colour images have no depth image, left out" in done.err
    report = Results(Path("r")).report
    assert report["frames"] == report["tracked"] == N - 1


def test_associated_image_that_does_not_exist(command: CommandLine, rgbd: Path) -> None:
    pairs = associations(rgbd)
    pairs[BAD][3] = "depth/elsewhere.png"
    associate(rgbd, pairs)
    expect_skipped(run(command, rgbd), "r", "depth/elsewhere.png is listed but missing")


# ---- settings and vocabulary ---------------------------------------------------------------------
@pytest.mark.parametrize(
    ("old", "new", "messages"),
    [
        ("Camera.fx: ", "# ", ["Camera.fx"]),
        ("Camera.fx: ", "Camera.fxx: ", ["Camera.fxx", "Camera.fx"]),
        ("Camera.fx: ", "Camera.fx: 1.0\nCamera.fx: ", ["Camera.fx"]),
        ("Camera.fx: ", "Camera.fx: -", ["Camera.fx"]),
        ("Camera.bf: ", "Camera.bf: x", ["Camera.bf"]),
        ("ORBextractor.nFeatures: ", "ORBextractor.nFeatures: -", ["ORBextractor.nFeatures"]),
        ("ORBextractor.scaleFactor: ", "ORBextractor.scaleFactor: 0 #", ["scaleFactor"]),
        ("DepthMapFactor: ", "DepthMapFactor: -", ["DepthMapFactor"]),
        ("%YAML:1.0", "\x00\x01\x02", ["mine.yaml"]),
    ],
)
def test_settings(
    command: CommandLine, rgbd: Path, old: str, new: str, messages: list[str]
) -> None:
    good = (rgbd / "settings.yaml").read_text()
    assert old in good
    Path("mine.yaml").write_text(good.replace(old, new))
    expect_refused(run(command, rgbd, "rgbd", "--settings", "mine.yaml"), "mine.yaml", *messages)
    # The same where it is found by itself.
    shutil.copy("mine.yaml", rgbd / "settings.yaml")
    expect_refused(run(command, rgbd), "settings.yaml", *messages[: 1 if old[0] != "%" else 0])


def vocabulary_file() -> Path:
    (path,) = (Path(orbslam2py.__file__).parent / "data").glob("*.bvoc")
    return path


BAD_VOCABULARIES: dict[str, Callable[[bytes], bytes]] = {
    "empty": lambda _: b"",
    "truncated": lambda good: good[: len(good) // 2],
    "one byte short": lambda good: good[:-1],
    "random": lambda _: np.random.default_rng(0).integers(0, 256, 5000, np.uint8).tobytes(),
    "text": lambda _: b"ten 5 0 0\n1 0 0 0\n",
    "picture": lambda _: b"\x89PNG\r\n\x1a\n" + bytes(500),
    "flipped": lambda good: good[:2000] + bytes([good[2000] ^ 255]) + good[2001:],
}


@pytest.mark.parametrize("kind", BAD_VOCABULARIES)
def test_vocabulary(command: CommandLine, rgbd: Path, kind: str) -> None:
    Path("mine.bvoc").write_bytes(BAD_VOCABULARIES[kind](vocabulary_file().read_bytes()))
    expect_refused(run(command, rgbd, "rgbd", "--vocabulary", "mine.bvoc"), "mine.bvoc")


# ---- places that cannot be written ---------------------------------------------------------------
def test_output_is_a_file(command: CommandLine, rgbd: Path) -> None:
    Path("results").write_text("mine")
    for place in ("results", "results/below"):
        done = command("run", rgbd, "--sensor", "rgbd", "--output", place)
        assert done.code == 2
        assert place in done.err
        assert "--output" in done.err
    assert Path("results").read_text() == "mine"


def test_output_cannot_be_made(command: CommandLine, rgbd: Path) -> None:
    done = command("run", rgbd, "--sensor", "rgbd", "--output", "/proc/results")
    assert done.code == 2
    assert "cannot write to /proc/results" in done.err


def test_no_permission_for_the_output(
    command: CommandLine, rgbd: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    original = Path.write_bytes

    def denied(path: Path, data: bytes) -> int:
        if path.parent.name == "r":
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
        return original(path, data)

    monkeypatch.setattr(Path, "write_bytes", denied)
    done = run(command, rgbd)
    assert done.code == 2
    assert "cannot write to r: Permission denied" in done.err


@pytest.fixture
def rescue(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """Folder that stands for the one of temporary files."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


def fill_disk(monkeypatch: pytest.MonkeyPatch, full: Callable[[Path], bool]) -> None:
    """Let the disk be full when certain files are finished."""
    original = os.fsync

    def fsync(descriptor: int) -> None:
        if full(Path(f"/proc/self/fd/{descriptor}").readlink()):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        original(descriptor)

    monkeypatch.setattr(_files.os, "fsync", fsync)


def test_disk_full(
    command: CommandLine, rgbd: Path, rescue: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fill_disk(monkeypatch, lambda path: path.parent.name == "r")
    done = run(command, rgbd)
    assert done.code == 1
    assert "Traceback" not in done.err
    (kept,) = rescue.iterdir()
    assert {path.name for path in kept.iterdir()} == set(FILES)
    assert list(Path("r").iterdir()) == [], "no halves"
    for name in FILES:
        assert f"cannot write r/{name}: No space left on device" in done.err
        assert f"kept in {kept / name}" in done.err
    assert len(read_tum(kept / "trajectory.txt")) == N
    assert Results(kept).report["tracked"] == N


def test_disk_full_for_one_file(
    command: CommandLine, rgbd: Path, rescue: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fill_disk(monkeypatch, lambda path: path.name.startswith(".trajectory.txt"))
    done = run(command, rgbd)
    assert done.code == 1
    assert "cannot write r/trajectory.txt" in done.err
    assert "neither in the temporary folder" in done.err
    assert {path.name for path in Path("r").iterdir()} == set(FILES) - {"trajectory.txt"}


def test_real_full_disk(command: CommandLine, rgbd: Path, rescue: Path, tmp_path: Path) -> None:
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=16k", "tmpfs", str(disk)]
    try:
        subprocess.run(mount, check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("file systems cannot be mounted here")
    try:
        done = command("run", rgbd, "--sensor", "rgbd", "--output", disk)
        written = {path.name for path in disk.iterdir()}
    finally:
        subprocess.run(["umount", str(disk)], check=True)
    assert done.code == 1
    assert "No space left on device" in done.err
    kept = {path.name for path in next(rescue.iterdir()).iterdir()}
    assert written | kept == set(FILES)
    assert "trajectory.png" in kept


def test_a_picture_that_cannot_be_drawn(
    command: CommandLine, rgbd: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def draw(*_: object, **__: object) -> None:
        raise ValueError("no font")

    monkeypatch.setattr("orbslam2py.runs.outputs.draw_trajectory", draw)
    done = run(command, rgbd)
    assert done.code == 1
    assert "cannot make trajectory.png: no font" in done.err
    assert {path.name for path in Path("r").iterdir()} == set(FILES) - {"trajectory.png"}


# ---- failures inside -----------------------------------------------------------------------------
class After:
    """Raises at the n-th call."""

    def __init__(self, original: Callable[..., object], n: int) -> None:
        self._original = original
        self._left = n

    def __call__(self, *arguments: object, **named: object) -> object:
        self._left -= 1
        if self._left < 0:
            raise RuntimeError("out of order")
        return self._original(*arguments, **named)


@pytest.mark.parametrize("deterministic", [True, False])
@pytest.mark.parametrize(
    ("verb", "n", "message"),
    [
        ("process_new_keyframe", 1, "local mapping stopped: out of order"),
        ("cull_keyframes", 1, "local mapping stopped: out of order"),
        ("match_local_map", 5, "out of order"),
        ("to_grey", 6, "out of order"),
    ],
)
def test_failure_inside(
    command: CommandLine,
    rgbd: Path,
    monkeypatch: pytest.MonkeyPatch,
    verb: str,
    n: int,
    message: str,
    deterministic: bool,
) -> None:
    monkeypatch.setattr(_core, verb, After(getattr(_core, verb), n))
    options = ("--deterministic",) if deterministic else ()
    done = run(command, rgbd, "rgbd", *options)
    assert done.code == 1
    assert f"Error: {message} (what was done until then is saved)" in done.err
    assert {path.name for path in Path("r").iterdir()} == set(FILES)
    rows = Results(Path("r")).frames
    assert len(read_tum(Path("r/trajectory.txt"))) >= len(rows) >= 1
    if verb in {"match_local_map", "to_grey"}:
        assert len(rows) == 6


def test_failure_while_reading(
    command: CommandLine, rgbd: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from orbslam2py.datasets import tum  # noqa: PLC0415

    monkeypatch.setattr(tum, "read_depth", After(tum.read_depth, 6))
    done = run(command, rgbd)
    assert done.code == 1
    assert "Error: out of order (what was done until then is saved)" in done.err
    assert len(read_tum(Path("r/trajectory.txt"))) == 6

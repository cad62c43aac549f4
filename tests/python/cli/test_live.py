# SPDX-License-Identifier: BSD-3-Clause
"""Live sources from the command line: devices, a run, its recording, wrong sources."""

from __future__ import annotations

import importlib
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orbslam2py import Sensor, Settings
from orbslam2py.errors import DatasetError
from orbslam2py.live import KINDS, capture, registry
from orbslam2py.trajectory import read_tum
from support import made_kind
from support import small_sequences as small
from support.command_line import CommandLine

#: Frames of a run.
N = 16

pytestmark = pytest.mark.watchdog(100)


def without(monkeypatch: pytest.MonkeyPatch, package: str, extra: str) -> None:
    """Let a package be missing."""
    for name in [*sys.modules]:
        if name.startswith(f"orbslam2py.live.{extra}"):
            monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, package, None)


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> None:
    kinds = (*KINDS, made_kind.KIND)
    monkeypatch.setattr(registry, "KINDS", kinds)
    monkeypatch.setattr("orbslam2py.cli.devices.KINDS", kinds)


@pytest.mark.usefixtures("made")
def test_run_and_repeat_it(command: CommandLine) -> None:
    pytest.importorskip("mcap", reason="pip install orbslam2py[bags]")
    done = command(
        *("run", "made:", "--imu", "--record-input", "in.mcap", "--output", "live"),
        *("--max-frames", N, "--no-report"),
    )
    assert done.code == 0, done.err
    assert "What came in is in in.mcap" in done.out
    assert "from exposure to pose" in done.out
    report = json.loads(Path("live/report.json").read_text())
    assert report["layout"] == "made"
    assert report["tracked"] >= N - 1
    assert report["input"]["frames"] >= N
    assert report["input"]["imu_samples"] >= 4 * (N - 2)
    total = report["milliseconds"]["latency.total"]
    assert total["count"] == N
    assert total["median"] >= report["milliseconds"]["latency.track"]["median"]
    assert report["milliseconds"]["latency.transport"]["median"] == pytest.approx(2, abs=2)
    settings = Settings.load("live/settings.yaml", "stereo")
    assert settings == small.sequence(Sensor.STEREO).settings
    again = command("run", "in.mcap", "--deterministic", "--output", "again", "--max-frames", N)
    assert again.code == 0, again.err
    live, repeated = (read_tum(f"{name}/trajectory.txt") for name in ("live", "again"))
    _, i, j = np.intersect1d(live.timestamps, repeated.timestamps, return_indices=True)
    assert len(i) >= N - 4  # a frame may have been dropped
    apart = np.linalg.norm(live.T_wc[i, :3, 3] - repeated.T_wc[j, :3, 3], axis=1)
    assert apart.max() < 0.02


def test_a_missing_library_of_the_system_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    text = "libusb-1.0.so.0: cannot open shared object file: No such file or directory"

    def import_module(name: str) -> Any:
        raise ImportError(text)

    monkeypatch.setattr(importlib, "import_module", import_module)
    with pytest.raises(DatasetError) as caught:
        KINDS[0].find()
    assert text in str(caught.value)
    assert "apt install libusb-1.0-0" in str(caught.value)
    assert "pip install" not in str(caught.value)


@pytest.mark.usefixtures("made")
def test_devices(command: CommandLine, monkeypatch: pytest.MonkeyPatch) -> None:
    for package, extra in (("pyrealsense2", "realsense"), ("depthai", "oak")):
        without(monkeypatch, package, extra)
    done = command("devices")
    assert done.code == 0
    assert "made:7  Camera that is none\n    left 320 x 240, 8 fps\n" in done.out
    missing = "realsense: needs the package pyrealsense2, which is not installed; install it: pip"
    assert f'Not looked for: {missing} install "orbslam2py[realsense]"' in done.out
    told = json.loads(command("devices", "--json").out)
    assert told["devices"][-1] == {
        "source": "made:7",
        "description": "Camera that is none",
        "modes": ["left 320 x 240, 8 fps"],
    }
    assert any(missing in text for text in told["not_looked_for"])


def test_no_device_is_no_error(command: CommandLine, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("orbslam2py.cli.devices.KINDS", KINDS[2:])
    monkeypatch.setattr(capture, "existing_cameras", list)
    done = command("devices")
    assert (done.code, done.out.splitlines()[0]) == (
        0,
        "No camera is plugged in that can be found.",
    )


# ---- wrong sources -------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("source", "package", "extra"),
    [("realsense:", "pyrealsense2", "realsense"), ("oak:", "depthai", "oak")],
)
def test_a_missing_extra(
    command: CommandLine,
    monkeypatch: pytest.MonkeyPatch,
    source: str,
    package: str,
    extra: str,
) -> None:
    without(monkeypatch, package, extra)
    done = command("run", source, "--sensor", "stereo")
    assert done.code == 2
    assert done.err.startswith(f"Error: {source} needs the package {package}, which is not inst")
    assert f'pip install "orbslam2py[{extra}]"' in done.err
    assert not Path("runs").exists()


@pytest.mark.parametrize(
    ("allowed", "message"),
    [
        (True, "it may be in use by another program: 'fuser /dev/video0' names it; close it"),
        (False, "you may not use /dev/video0; add yourself to its group with 'sudo usermod -aG"),
    ],
)
def test_a_webcam_in_use_or_not_allowed(
    command: CommandLine, monkeypatch: pytest.MonkeyPatch, allowed: bool, message: str
) -> None:
    monkeypatch.setattr(capture, "existing_cameras", lambda: [0])
    monkeypatch.setattr(capture.Path, "exists", lambda path: path == Path("/dev/video0"))
    monkeypatch.setattr(capture.os, "access", lambda *_: allowed)
    done = command("run", "v4l:0", "--sensor", "mono", "--settings", "tum1")
    assert done.code == 2
    assert f"v4l:0 cannot be opened; {message}" in done.err
    assert ("udev rule" in done.err) is not allowed
    monkeypatch.undo()
    assert not Path("runs").exists()


@pytest.mark.usefixtures("made")
def test_recordings_that_cannot_be_written(command: CommandLine) -> None:
    Path("kept.mcap").write_bytes(b"mine")
    for name, message in {
        "kept.mcap": "kept.mcap exists; use --force to replace it",
        "no/in.mcap": "no/in.mcap",
        "in.bag": "--record-input in.bag: the recording is an MCAP file; give a name that ends",
    }.items():
        done = command("run", "made:", "--record-input", name, "--max-frames", 2)
        assert done.code == 2
        assert message in done.err
    assert Path("kept.mcap").read_bytes() == b"mine"
    assert not Path("runs").exists()


def test_a_password_stays_out_of_messages(command: CommandLine) -> None:
    address = "rtsp://me:secret@127.0.0.1:1/stream"
    done = command("run", address, "--sensor", "mono", "--settings", "tum1")
    assert done.code == 2
    assert "rtsp://127.0.0.1:1/stream cannot be opened" in done.err
    assert "secret" not in done.err + done.out

# SPDX-License-Identifier: BSD-3-Clause
"""Runs that fail half-way, and sequences of a user's own that give something wrong."""

from __future__ import annotations

import errno
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import orbslam2py as orb
from orbslam2py.runs import FinishedRun, FrameRow, RunOptions
from orbslam2py.runs.outputs import prepare_output_folder
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence

pytestmark = [pytest.mark.watchdog(60), pytest.mark.page]

N, FAILS_AT = 6, 3


class Own(SyntheticSequence):
    """Does something else when the fourth frame is loaded, and for all time stamps."""

    def __init__(
        self, load: Callable[[], Any] | None = None, text: Callable[[int], Any] | None = None
    ) -> None:
        super().__init__(
            SyntheticOptions(world="corridor", sensor="rgbd", frames=N, size=(320, 240))
        )
        self._load, self._text = load, text

    def load(self, index: int, /) -> Any:
        return self._load() if self._load and index == FAILS_AT else super().load(index)

    def timestamp_text(self, index: int, /) -> Any:
        return self._text(index) if self._text else super().timestamp_text(index)


def raised(error: Exception) -> Callable[[], Any]:
    def load() -> Any:
        raise error

    return load


def require_told(done: FinishedRun, text: str) -> None:
    """The run ended at the fourth frame, and its files say why."""
    assert done.folder is not None
    report = json.loads((done.folder / "report.json").read_text())
    assert (report["frames"], report["seen_frames"], report["interrupted"]) == (N, FAILS_AT, False)
    assert text in report["error"]
    page = (done.folder / "report.html").read_text()
    assert f"The run failed after {FAILS_AT} of {N} frames" in page


def test_the_files_say_what_ended_a_run(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    done = orb.run_sequence(Own(raised(KeyError("oops"))), output=tmp_path / "o")
    require_told(done, "KeyError: 'oops'")
    assert sum("unexpected error" in message for message in caplog.messages) == 1


def test_a_run_without_failures_has_no_error() -> None:
    assert orb.run_sequence(Own()).report["error"] is None


@pytest.mark.parametrize(
    ("given", "told"),
    [
        (None, "load(3) gave None for images; give orbslam2py.datasets.Images("),
        ((1, 2), "load(3) gave a tuple for images"),
        (SyntheticSequence, "load(3) gave a type for images"),
    ],
)
@pytest.mark.parametrize("realtime", [False, True])
def test_what_is_no_images_ends_the_run_and_is_told(
    given: Any, told: str, realtime: bool, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    options = RunOptions(orb.Sensor.RGBD, realtime=realtime)
    done = orb.run_sequence(Own(lambda: given), options, output=tmp_path / "o")
    assert isinstance(done.result.error, orb.DatasetError)
    require_told(done, told)
    assert f"the run failed: {done.result.error}" in caplog.messages


def test_the_command_tells_what_ended_its_run_itself(caplog: pytest.LogCaptureFixture) -> None:
    done = orb.run_sequence(Own(lambda: None), command="orbslam2py run own")
    assert done.report["error"] is not None
    assert not any("failed" in message for message in caplog.messages)


def test_a_system_names_what_is_no_images() -> None:
    class Frame:
        timestamp, images = 0.0, None

    own = Own(lambda: None)
    for source, told in ((own, r"frame gave None"), ([Frame()], "a frame gave None for images")):
        with orb.System(own.settings, "rgbd") as slam, pytest.raises(orb.DatasetError, match=told):
            slam.run(source)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "text",
    [
        *(7, None, "noon", "nan", "inf", "-inf", "", "1e999", "0x10", "1.5.2", "1,5", "1e", "."),
        *(
            "1.0\n",
            "\n1.0",
            " 1.5 ",
            "1.5\t",
            "1_000.5",
            "\uff11.5",
            "\u0663",
            "1.5\x00",
            "1.5\u2028",
        ),
    ],
)
def test_time_stamps_that_are_no_text_are_told_before_anything_is_written(
    text: Any, tmp_path: Path
) -> None:
    told = r"timestamp_text\(0\) gave .* for a time stamp; give the time in seconds as text"
    with pytest.raises(orb.DatasetError, match=told):
        orb.run_sequence(Own(text=lambda index: text), output=tmp_path / "o")
    assert not (tmp_path / "o").exists()


@pytest.mark.parametrize("form", ["{}", "{}.", "+{}.25", "-0.{}", ".{}", "{}e-3", "{}.50E+2"])
def test_time_stamps_go_into_files_as_they_are(form: str, tmp_path: Path) -> None:
    own = Own(text=lambda index: form.format(index + 10))
    done = orb.run_sequence(own, RunOptions(orb.Sensor.RGBD, max_frames=3), output=tmp_path / "o")
    lines = (tmp_path / "o/trajectory.txt").read_text().splitlines()
    assert done.result.error is None
    assert [line.split()[0] for line in lines] == [form.format(index + 10) for index in range(3)]


def test_a_later_time_stamp_that_is_no_text_ends_the_run(tmp_path: Path) -> None:
    own = Own(text=lambda index: index if index == FAILS_AT else f"{index}.0")
    require_told(orb.run_sequence(own, output=tmp_path / "o"), "timestamp_text(3) gave 3")


def test_settings_of_a_sequence_that_are_a_name_are_refused(tmp_path: Path) -> None:
    own = Own()
    own.settings = "tum1"  # type: ignore[assignment]
    with pytest.raises(orb.SettingsError, match="settings of the sequence are 'tum1'; give it"):
        orb.run_sequence(own, output=tmp_path / "o")
    assert not (tmp_path / "o").exists()


def test_a_folder_that_is_not_empty_is_told_with_what_python_calls_it(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(orb.DatasetError, match="force=True"):
        orb.run_sequence(Own(), output=tmp_path)


# ---- two runs in one folder ----------------------------------------------------------------------
def test_a_folder_takes_one_run_at_a_time(tmp_path: Path) -> None:
    sequence = Own()
    told: list[str] = []
    few = RunOptions(orb.Sensor.RGBD, max_frames=3)

    def begin_another(row: FrameRow, _: orb.System) -> None:
        if row.index == 1:
            for force in (False, True):
                with pytest.raises(orb.DatasetError) as raised:
                    orb.run_sequence(sequence, few, output=tmp_path, force=force)
                told.append(str(raised.value))

    done = orb.run_sequence(sequence, output=tmp_path, progress=begin_another)
    assert done.result.error is None
    assert len(told) == 2
    assert all("another run is writing into" in text for text in told)
    assert len((tmp_path / "frames.csv").read_text().splitlines()) == N + 1
    orb.run_sequence(sequence, few, output=tmp_path, force=True)


def test_a_probe_that_a_full_disk_cuts_off_is_not_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(path: Path, _: bytes) -> int:
        path.touch()
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(orb.DatasetError, match="cannot write to"):
        prepare_output_folder(tmp_path / "r", force=False)
    assert list((tmp_path / "r").iterdir()) == []

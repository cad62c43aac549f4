# SPDX-License-Identifier: BSD-3-Clause
"""The reference pages list exactly what there is: keys, columns, reasons, names, exit codes."""

from __future__ import annotations

import csv
import dataclasses
import importlib
import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import orbslam2py
from orbslam2py.cli.exit_codes import ExitCode
from orbslam2py.live import LiveStream
from orbslam2py.runs.remedies import what_helps
from orbslam2py.runs.result import DROPPED
from orbslam2py.settings import BUILTIN_NAMES, keys
from orbslam2py.settings.sensor import WITHOUT_RIG
from orbslam2py.settings.settings import CameraSettings, DepthSettings, OrbSettings, ViewerSettings
from orbslam2py.slam.events import LoopClosed, MapsMerged
from orbslam2py.slam.full_bundle_adjustment import FullAdjustmentRecord
from orbslam2py.slam.records import Reason, TrackingState
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from support.documents import ROOT, cells_of, code_in, headings_of, prose_of, read, table_below
from support.faulty_camera import FaultyCamera

REFERENCE = ROOT / "docs/reference"
ROOMS = (
    *("settings", "trajectory", "evaluation", "vocabulary", "maps"),
    *("datasets", "synthetic", "calibration", "runs", "batches"),
    *("viewer", "recordings", "pictures", "live"),
)


# ---- settings.md ---------------------------------------------------------------------------------
GROUPS = {
    "Camera": ("camera", CameraSettings),
    "Depth": ("depth", DepthSettings),
    "Features": ("orb", OrbSettings),
    "Viewer": ("viewer", ViewerSettings),
}


@pytest.mark.parametrize("heading", GROUPS)
def test_settings_page_lists_the_keys(heading: str) -> None:
    group, kind = GROUPS[heading]
    rows = table_below(read(REFERENCE / "settings.md"), heading)
    known = [key for key in keys.KEYS if key.group == group]
    assert [code_in(row[0])[0] for row in rows] == [key.name for key in known]
    defaults = {field.name: field.default for field in dataclasses.fields(kind)}
    for row, key in zip(rows, known, strict=True):
        sensors = "" if not key.required else ", ".join(sorted(map(str, key.sensors), reverse=True))
        everywhere = key.required and len(key.sensors) == len(WITHOUT_RIG)
        assert row[3] == ("all" if everywhere else sensors), row
        default = defaults[key.field]
        if key.required:
            assert row[2] == "", row
        elif default is None:
            assert row[2] == "unknown", row
        else:
            assert float(row[2]) == float(default), row
        assert row[4].endswith("."), row


def test_settings_page_lists_the_rectification() -> None:
    page = read(REFERENCE / "settings.md")
    rows = table_below(page, "Rectification of a raw stereo pair")
    assert {code_in(row[0])[0] for row in rows} == {
        *keys.RECTIFICATION_KEYS,
        *keys.RECTIFICATION_MODEL_KEYS,
    }
    named = {name for row in table_below(page, "Built-in settings") for name in code_in(row[0])}
    assert named == set(BUILTIN_NAMES)


# ---- reasons.md ----------------------------------------------------------------------------------
def test_reasons_page_lists_every_reason() -> None:
    page = read(REFERENCE / "reasons.md")
    rows = table_below(page, "Before there is a map") + table_below(page, "While there is a map")
    listed = {code_in(row[1])[0]: row[0] for row in rows}
    assert listed == {r.name: r.value for r in Reason if r is not Reason.NONE}
    assert all(all(row) for row in rows), "a reason without meaning or help"
    told = {code_in(row[1])[0]: row[3].replace("`", "") for row in rows}
    assert told == {r.name: what_helps(r) for r in Reason if r is not Reason.NONE}
    (dropped,) = [
        row for row in table_below(page, "Frames that were not tracked") if row[1] == DROPPED
    ]
    assert dropped[3].replace("`", "") == what_helps(DROPPED)


# ---- files.md ------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of a single camera with ground truth."""
    folder = tmp_path_factory.mktemp("run")
    options = SyntheticOptions(world="corridor", sensor="mono", frames=30, size=(320, 240))
    SyntheticSequence(options).write(folder / "walk")
    command = [sys.executable, "-m", "orbslam2py", "run", str(folder / "walk"), "--sensor", "mono"]
    subprocess.run([*command, "--output", str(folder / "out"), "--quiet"], check=True)
    return folder / "out"


def first_column(heading: str) -> list[str]:
    rows = table_below(read(REFERENCE / "files.md"), heading)
    return [name for row in rows for name in code_in(row[0])]


def tables_below(heading: str) -> list[str]:
    """First column of all tables between a heading and the next."""
    page = read(REFERENCE / "files.md")
    section = re.split(rf"^#+ {re.escape(heading)}$", page, flags=re.MULTILINE)[1]
    section = re.split(r"^#", section, flags=re.MULTILINE)[0]
    rows = [cells_of(line) for line in section.splitlines() if line.startswith("| `")]
    return [name for row in rows for name in code_in(row[0])]


def test_files_page_lists_the_files(run: Path) -> None:
    page = first_column("Files of a run")
    with_several = ("trajectory_map", "maps.png", "imu_states.csv", "imu.yaml")
    always = {name for name in page if not name.startswith(with_several)}
    assert {path.name for path in run.iterdir()} == always


def test_files_page_lists_the_columns(run: Path) -> None:
    with (run / "frames.csv").open(newline="") as stream:
        header = next(csv.reader(stream))
    assert first_column("frames.csv") == header
    n_columns = len(first_column("trajectory.txt"))
    for name in ("trajectory.txt", "trajectory_online.txt", "keyframes.txt"):
        assert len((run / name).read_text().splitlines()[-1].split()) == n_columns
    lines = (run / "trajectory_kitti.txt").read_text().splitlines()
    assert len(lines) == 30
    assert len(lines[-1].split()) == 12
    header_of_points = (run / "points.ply").read_bytes().split(b"end_header")[0].decode()
    assert re.findall(r"property float (\w+)", header_of_points) == ["x", "y", "z"]


def test_files_page_lists_the_keys_of_the_report(run: Path) -> None:
    report: dict[str, Any] = json.loads((run / "report.json").read_text())
    listed = tables_below("report.json")
    # A single camera with an IMU has two more.
    assert [key for key in listed if not key.startswith("ate_scaled_")] == list(report)
    assert list(next(iter(report["milliseconds"].values()))) == ["median", "mean", "p99", "count"]


def test_files_page_lists_the_keys_of_entries() -> None:
    report = importlib.import_module("orbslam2py.runs.report")
    numbers = {"n_keyframes": 1, "n_points": 1, "n_observations": 1, "milliseconds": {}}
    losses = importlib.import_module("orbslam2py.runs.losses")
    assert tables_below("An entry of losses") == list(losses.loss_entry(_filled(losses.Loss, {})))
    loop = _filled(LoopClosed, {"milliseconds": {}})
    adjustment = _filled(FullAdjustmentRecord, numbers)
    assert tables_below("An entry of loops") == list(report.loop_entry(loop))
    merge = _filled(MapsMerged, {"milliseconds": {}})
    assert tables_below("An entry of merges") == list(report.merge_entry(merge))
    listed = tables_below("An entry of full_adjustments")
    assert listed == list(report.adjustment_entry(adjustment))


def test_files_page_lists_the_keys_of_the_input() -> None:
    source = LiveStream(FaultyCamera(), settings="euroc")
    assert tables_below("The entry input") == list(source.counts())


def _filled(kind: type, values: dict[str, Any]) -> Any:
    return kind(**{field.name: 0 for field in dataclasses.fields(kind)} | values)


def test_files_page_lists_the_exit_codes() -> None:
    rows = table_below(read(REFERENCE / "files.md"), "Exit codes")
    assert [int(row[0]) for row in rows] == sorted(int(code) for code in ExitCode)


def test_states_of_frames_are_named() -> None:
    row = next(
        r for r in table_below(read(REFERENCE / "files.md"), "frames.csv") if "state" in r[0]
    )
    told = set(code_in(row[2]))
    unseen = {TrackingState.NO_IMAGES_YET.name}
    assert told == {s.name for s in TrackingState} - unseen | {"SKIPPED", "DROPPED"}


# ---- python/*.md ---------------------------------------------------------------------------------
def documented(page: str) -> set[str]:
    return set(re.findall(r"^::: ([\w.]+)$", prose_of(read(REFERENCE / f"python/{page}.md")), re.M))


def test_every_name_of_the_front_door_is_documented() -> None:
    everywhere = {
        name.rpartition(".")[2] for page in ("system", *ROOMS) for name in documented(page)
    }
    assert set(orbslam2py.__all__) - {"__version__"} <= everywhere


@pytest.mark.parametrize("room", ROOMS)
def test_every_name_of_a_room_is_documented(room: str) -> None:
    public = importlib.import_module(f"orbslam2py.{room}").__all__
    assert documented(room) == {f"orbslam2py.{room}.{name}" for name in public}


# ---- command.md ----------------------------------------------------------------------------------
def test_every_command_has_a_section_with_an_example(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(ROOT / "scripts")
    reference = importlib.import_module("command_reference")
    text = reference.reference()
    assert "<!-- all commands -->" in read(REFERENCE / "command.md")
    titles = [command.name for command in reference.commands()]
    assert list(headings_of(text)) == titles
    assert {"run", "demo", "evaluate", "vocabulary train"} <= set(titles)
    for command in reference.commands():
        _, example = command.text_and_example()
        assert example, command.name
        assert all(line.startswith("orbslam2py ") for line in example)
    for option in ("--sensor", "--no-loop-closing", "--output`, `-o", "--format"):
        assert f"`{option}`" in text


# ---- architecture.md -----------------------------------------------------------------------------
def test_picture_of_the_rooms_is_the_contract() -> None:
    settings = read(ROOT / "pyproject.toml")
    contract = re.search(r"^layers = \[(.*?)\]", settings, re.MULTILINE | re.DOTALL)
    assert contract is not None
    layers = [re.findall(r"\w+", layer) for layer in re.findall(r'"([^"]+)"', contract[1])]
    page = read(ROOT / "docs/architecture.md")
    picture = page.split("```text\n")[1].split("\n```")[0].splitlines()
    for floor, line in zip(layers, picture, strict=False):
        assert line.split()[: len(floor)] == floor
    assert "_core" in picture[len(layers)]
    rooms = {row[0] for row in table_below(page, "Floors")}
    packages = {path.parent.name for path in (ROOT / "src/orbslam2py").glob("*/__init__.py")}
    assert rooms == {f"`{name}/`" for name in packages} | {"ground"}

# SPDX-License-Identifier: BSD-3-Clause
"""Settings that jobs name: files that are not there or wrong are told before anything is run."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import pytest

import orbslam2py as orb
from orbslam2py.batches import make_jobs, read_jobs
from orbslam2py.settings import builtin_settings


@pytest.fixture
def places(tmp_path: Path) -> Path:
    (tmp_path / "seq").mkdir()
    (tmp_path / "folder.yaml").mkdir()
    for name, builtin, sensor in (
        ("mono.yaml", "tum1", orb.Sensor.MONOCULAR),
        ("rgbd.yaml", "tum1", orb.Sensor.RGBD),
        ("stereo.yaml", "kitti03", orb.Sensor.STEREO),
    ):
        builtin_settings(builtin, sensor).save(tmp_path / name)
    text = (tmp_path / "mono.yaml").read_text(encoding="utf-8")
    (tmp_path / "typo.yaml").write_text(text.replace("Camera.fx", "Camera.f"), encoding="utf-8")
    (tmp_path / "few.yaml").write_text(text.replace("nFeatures: 1000", "nFeatures: 150"))
    (tmp_path / "empty.yaml").touch()
    (tmp_path / "image.yaml").write_bytes(b"\x89PNG\0\0")
    return tmp_path


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"settings": ["nofile.yaml"]}, "settings file .*/nofile.yaml does not exist; correct"),
        ({"settings": ["mono.yaml", "no/file"]}, "settings file .*/no/file does not exist"),
        ({"settings": ["/no/where.yaml"]}, "settings file /no/where.yaml does not exist"),
        ({"settings": ["nofile"]}, "settings 'nofile' are no file in .* none of the built-in"),
        ({"settings": ["typo.yaml"]}, r"typo.yaml:\d+: unknown key Camera.f; did you mean"),
        ({"settings": ["empty.yaml"]}, "empty.yaml holds no settings"),
        ({"settings": ["image.yaml"]}, "image.yaml is no text file"),
        ({"settings": ["folder.yaml"]}, "cannot open settings file .*/folder.yaml"),
        ({"settings": ["mono.yaml"], "sensors": ["rgbd"]}, "mono.yaml.* rgbd needs it"),
        ({"settings": ["tum1"], "sensors": ["stereo"]}, "'tum1' are for rgbd and mono, not for"),
    ],
)
def test_settings_with_which_no_run_could_begin(
    places: Path, more: dict[str, Any], message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(places)
    with pytest.raises(orb.SettingsError, match=f"(?s){message}"):
        orb.batch({"sequences": ["seq"], **more}, "out", workers=0)
    sequence = {"path": "seq", "settings": more["settings"][-1]}
    rest = {"sensors": more["sensors"]} if "sensors" in more else {}
    with pytest.raises(orb.SettingsError, match=f"(?s){message}"):
        make_jobs({"sequences": [sequence], **rest}, places)
    assert not Path("out").exists()


@pytest.mark.parametrize("names", [["mono.yaml", "stereo.yaml", "rgbd.yaml"], ["tum1", "KITTI07"]])
def test_settings_that_serve_any_sensor_are_let_through(places: Path, names: list[str]) -> None:
    """Everything is combined with everything: what does not go together is a row that says so."""
    document = {"sequences": ["seq"], "settings": names}
    assert len(make_jobs(document, places)) == len(names)
    assert len(make_jobs({**document, "sensors": ["mono", "stereo"]}, places)) == 2 * len(names)


def test_what_is_doubtful_is_left_to_the_runs(
    places: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING):
        make_jobs({"sequences": ["seq"], "settings": ["few.yaml"]}, places)
    assert not caplog.messages


def test_files_that_only_workers_of_a_scheduler_see(
    places: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those that this computer sees are looked at all the same."""
    path = places / "jobs.yaml"
    path.write_text("sequences: [seq]\nsettings: [/shared/camera.yaml, rgbd.yaml]\n")
    jobs, _ = read_jobs(path, elsewhere=True)
    assert [job.settings for job in jobs] == ["/shared/camera.yaml", str(places / "rgbd.yaml")]
    path.write_text("sequences: [seq]\nsettings: [typo.yaml]\n")
    with pytest.raises(orb.SettingsError, match=r"unknown key Camera\.f"):
        read_jobs(path, elsewhere=True)
    monkeypatch.setattr("orbslam2py.batches.engine._PATIENCE", 0.5)
    with pytest.raises(orb.DatasetError, match=r"tcp://127\.0\.0\.1:9 cannot be reached"):
        orb.batch(
            *({"sequences": [str(places / "seq")], "settings": ["/shared/c.yaml"]}, places / "out"),
            scheduler="tcp://127.0.0.1:9",
        )

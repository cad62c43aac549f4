# SPDX-License-Identifier: BSD-3-Clause
"""``orbslam2py batch``: what it prints, and inputs that it refuses."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from orbslam2py.cli.batches.watched_runs import lines_of, watched_runs
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from support.command_line import CommandLine


@pytest.fixture(scope="module")
def sequences(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sequences")
    options = SyntheticOptions(world="corridor", sensor="rgbd", frames=6, size=(320, 240))
    for name in ("one", "two"):
        SyntheticSequence(options).write(folder / name)
    return folder


def jobs_of(sequences: Path) -> dict[str, Any]:
    options = {"deterministic": True, "max_frames": 4}
    return {"sequences": [str(sequences / "*")], "options": options, "seeds": 2}


def test_command(command: CommandLine, sequences: Path, tmp_path: Path) -> None:
    Path("jobs.yaml").write_text(json.dumps(jobs_of(sequences)))
    done = command("batch", "jobs.yaml", "--output", "out", "--workers", "0")
    assert done.code == 0, done.err
    assert "4 runs, 0 failed" in done.out
    assert Path("out/results.csv").is_file()
    again = command("batch", "jobs.yaml", "--output", "out")
    assert again.code == 2
    assert "--resume" in again.err
    resumed = command("batch", "jobs.yaml", "--output", "out", "--resume")
    assert resumed.code == 0, resumed.err


def test_what_the_screen_shows() -> None:
    """A bar of all runs, and below it what each worker makes; of many workers the first."""
    console = Console(force_terminal=True, width=60, record=True, file=io.StringIO())
    with watched_runs(console, console) as (progress, watch, _):
        watch({"tcp://b": "two-seed0", "tcp://a": "one-seed3"})
        progress({"run": "x", "state": "done"}, 3, 8)
    shown = console.export_text()
    assert "3/8" in shown
    assert "1  one-seed3" in shown
    assert "2  two-seed0" in shown
    many = lines_of({f"w{number:03d}": f"run{number}" for number in range(40)}).splitlines()
    assert len(many) == 17
    assert many[-1].strip() == "and 24 more"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("none.yaml", "--output", "out"), "cannot open job file none.yaml"),
        (("jobs.yaml",), "there is no folder for the results; give --output"),
        (
            ("jobs.yaml", "--output", "out", "--cache-size", "much"),
            "the size of the cache is 'much'; give one such as 20GB",
        ),
        (("typo.yaml", "--output", "out"), "unknown key 'sequence'; did you mean sequences?"),
        (("nothing.yaml", "--output", "out"), "none_*; correct the pattern"),
        (("twice.yaml", "--output", "out"), "two runs would have the folder one-seed0"),
        (("far.yaml", "--output", "out"), "there is no protocol nfs9://; give one"),
        (("jobs.yaml", "--output", "jobs.yaml"), "jobs.yaml is a file; give the name of a folder"),
        (("jobs.yaml", "--output", "full"), "full is not empty and holds no batch"),
        (
            ("jobs.yaml", "--output", "out", "--scheduler", "tcp://127.0.0.1:9"),
            "the scheduler tcp://127.0.0.1:9 cannot be reached; start one with 'dask scheduler'",
        ),
        *(
            (
                ("jobs.yaml", "--output", "out", "--memory-limit", size),
                f"the memory of a worker (--memory-limit) is '{size}'; give one such as 4GB, at "
                "least 500 MB",
            )
            for size in ("abc", "-1GB", "1kB")
        ),
        (
            ("jobs.yaml", "--output", "out", "--memory-limit", "4GB", "--workers", "0"),
            "--memory-limit 4GB has no meaning with --workers 0",
        ),
        (
            ("none.yaml", "--output", "out", "--memory-limit", "4GB", "--scheduler", "tcp://a:1"),
            "--memory-limit 4GB has no meaning with --scheduler tcp://a:1",
        ),
        (
            ("jobs.yaml", "--output", "out", "--scheduler", "foo"),
            "the scheduler (--scheduler) is 'foo'; give an address such as tcp://10.0.0.1:8786",
        ),
        (
            ("sweep.yaml", "--output", "out"),
            "sweep.yaml: sweep: ThDepth is -5; allowed: greater than 0",
        ),
        (("again.yaml", "--output", "out"), "again.yaml:2: 'sequences' is given twice (first on"),
        (
            ("camera.yaml", "--output", "out", "--workers", "0"),
            "camera.yaml: settings file /no/where.yaml does not exist; correct the path",
        ),
    ],
)
def test_bad_input(
    command: CommandLine,
    sequences: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: tuple[str, ...],
    message: str,
) -> None:
    monkeypatch.setattr("orbslam2py.batches.engine._PATIENCE", 0.5)
    Path("jobs.yaml").write_text(json.dumps(jobs_of(sequences)))
    one = str(sequences / "one")
    for name, document in (
        ("typo", {"sequence": [one]}),
        ("nothing", {"sequences": ["none_*"]}),
        ("twice", {"sequences": [one, one]}),
        ("far", {"sequences": ["nfs9://host/one"]}),
        ("sweep", {"sequences": [one], "sweep": {"ThDepth": [40, -5]}}),
        ("camera", {"sequences": [one], "settings": ["/no/where.yaml"]}),
    ):
        Path(f"{name}.yaml").write_text(json.dumps(document))
    Path("again.yaml").write_text(f"sequences: [{one}]\nsequences: [{one}]\n")
    Path("full").mkdir()
    Path("full/notes.txt").write_text("mine\n")
    done = command("batch", *arguments)
    assert done.code == 2
    assert message in " ".join(done.err.split())
    assert not Path("out").exists()
    for noise in ("Traceback", "Errno", "Error(", "SettingsError"):
        assert noise not in done.err

# SPDX-License-Identifier: BSD-3-Clause
"""The text of job files: keys given twice, parts that are shared, and what is no YAML."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import orbslam2py as orb
from orbslam2py.batches import read_jobs


@pytest.fixture
def places(tmp_path: Path) -> Path:
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
    return tmp_path


def refusal(folder: Path, text: str) -> str:
    path = folder / "jobs.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(orb.SettingsError) as caught:
        read_jobs(path)
    return str(caught.value)


@pytest.mark.parametrize(
    ("text", "line", "key", "first"),
    [
        ("sequences: [a]\nsequences: [b]\noptions: {max_frames: 3}\n", 2, "sequences", 1),
        ("sequences: [a]\noptions: {stride: 1}\n\noptions: {max_frames: 3}\n", 4, "options", 2),
        ("sequences: [a]\noptions:\n  stride: 1\n  'stride': 2\n", 4, "stride", 3),
        ("sequences:\n  - path: a\n    name: x\n    path: b\n", 4, "path", 2),
        ("sequences: [a]\nsweep: {ThDepth: [30], ThDepth: [40]}\n", 2, "ThDepth", 2),
        ("sequences: [a]\nsweep: {random: 2, ThDepth: {from: 1, to: 3, to: 4}}\n", 2, "to", 2),
    ],
)
def test_a_key_given_twice(places: Path, text: str, line: int, key: str, first: int) -> None:
    """Otherwise the last one would count, and the first be lost without a word."""
    assert refusal(places, text) == (
        f"{places / 'jobs.yaml'}:{line}: '{key}' is given twice (first on line {first}); keep one"
    )


def test_parts_that_are_shared(places: Path) -> None:
    """A key beside a merged one of its name is no second one; it wins, as YAML says."""
    path = places / "jobs.yaml"
    path.write_text(
        "sequences:\n"
        "  - &first {path: a, name: x, sensor: mono}\n"
        "  - &second {<<: *first, name: y}\n"
        "  - {<<: *second, sensor: rgbd}\n"
        "  - {<<: [*first, *second], path: b, name: z}\n"
    )
    jobs, _ = read_jobs(path)
    assert [(Path(job.path).name, job.name, job.sensor) for job in jobs] == [
        *(("a", "x", "mono"), ("a", "y", "mono"), ("a", "y", "rgbd"), ("b", "z", "mono")),
    ]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("sequences: [a\n", r"jobs.yaml:2 is no YAML: .*; correct it"),
        ("sequences: [a]\n? [1]\n: 2\n", r"jobs.yaml:2 is no YAML: found unhashable key"),
        (
            "sequences: [a, 2024-13-45]\n",
            r"jobs.yaml is no YAML: month must be in 1..12; put text that looks like a date "
            r"into quotes",
        ),
        ("sequences: \0\n", "jobs.yaml is no text in YAML; give a job file"),
    ],
)
def test_what_is_no_yaml(places: Path, text: str, message: str) -> None:
    assert re.search(message, refusal(places, text))

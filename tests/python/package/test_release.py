# SPDX-License-Identifier: BSD-3-Clause
"""What a release says of itself is said once, and in the same words."""

from __future__ import annotations

import re

import yaml

from support.data import CHECKOUT


def text(name: str) -> str:
    return (CHECKOUT / name).read_text(encoding="utf-8")


def test_the_version_stands_in_one_place() -> None:
    (version,) = re.findall(r'^version = "(.*)"$', text("pyproject.toml"), re.M)
    assert re.fullmatch(r"\d+\.\d+\.\d+", version)
    assert "VERSION" not in next(
        line for line in text("CMakeLists.txt").splitlines() if line.startswith("project(")
    )
    assert "version" not in yaml.safe_load(text("CITATION.cff"))


def test_the_citation_can_be_read() -> None:
    citation = yaml.safe_load(text("CITATION.cff"))
    assert {"cff-version", "message", "title", "authors"} <= set(citation)
    assert citation["license"] == "BSD-3-Clause"
    assert all({"title", "authors", "year"} <= set(paper) for paper in citation["references"])


def test_the_notes_name_what_a_wheel_is_linked_with() -> None:
    notes = text("third_party_notes/README.md").partition("### In a wheel")[2]
    rows = [row for row in notes.partition("\n## ")[0].splitlines() if row.startswith("| ")][1:]
    blocks = text("scripts/wheel/libraries.toml").split("\nname = ")[1:]
    assert len(rows) == len(blocks) + 1  # pybind11 is a package of Python, not in the list
    for block in blocks:
        name = block.splitlines()[0].split('"')[1]
        (licence,) = re.findall(r'^licence = "(.*)"$', block, re.M)
        assert any(row.startswith(f"| {name}") and licence in row for row in rows), name


def test_the_source_distribution_leaves_no_room_out() -> None:
    """Folders of results at the top are left out by their place, not by a name that rooms have."""
    (line,) = re.findall(r"^sdist\.exclude = (\[.*\])$", text("pyproject.toml"), re.M)
    rooms = {path.name for path in (CHECKOUT / "src/orbslam2py").rglob("*") if path.is_dir()}
    for pattern in yaml.safe_load(line):
        assert pattern.startswith("/") or pattern == "*.so", pattern
        assert pattern not in rooms

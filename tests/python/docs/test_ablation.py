# SPDX-License-Identifier: BSD-3-Clause
"""The page about the ablation lists the mechanisms of the benchmark and what switches each off."""

from __future__ import annotations

import re

import pytest
from benchmarks.ablation.mechanisms import MECHANISMS, Changes

from orbslam2py.slam.config import Config, read_change
from support.documents import ROOT, cells_of, read

PAGE = ROOT / "docs/benchmarks/ablation.md"
HEADER = ["mechanism", "switched off by"]


def listed() -> dict[str, Changes]:
    """Mechanisms of the page, each with its changes, in the order of the page."""
    found: dict[str, Changes] = {}
    inside = False
    for line in read(PAGE).splitlines():
        cells = cells_of(line) if line.startswith("|") else []
        if cells == HEADER:
            inside = True
        elif not cells:
            inside = False
        elif inside and not set(cells[0]) <= set("-: "):
            found[cells[0]] = dict(map(read_change, re.findall(r"`([^`]+)`", cells[1])))
    return found


def test_the_page_lists_every_mechanism_in_the_order_of_the_code() -> None:
    assert list(listed()) == list(MECHANISMS)


@pytest.mark.parametrize("name", MECHANISMS)
def test_the_page_says_what_switches_a_mechanism_off(name: str) -> None:
    assert listed().get(name) == MECHANISMS[name]


@pytest.mark.parametrize("name", MECHANISMS)
def test_each_mechanism_can_be_switched_off(name: str) -> None:
    changed = Config().with_changes(MECHANISMS[name]).changes()
    assert changed == MECHANISMS[name]  # each value differs from the default


def test_the_examples_of_the_page_name_mechanisms() -> None:
    names = re.findall(r'"([^"]+)"', " ".join(re.findall(r"--off (.+)", read(PAGE))))
    assert names
    assert set(names) <= set(MECHANISMS)

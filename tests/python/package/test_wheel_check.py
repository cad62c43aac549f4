# SPDX-License-Identifier: BSD-3-Clause
"""The check of finished wheels finds what must not be given away."""

from __future__ import annotations

import json
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import pytest

from support.data import CHECKOUT

CHECK = CHECKOUT / "scripts/wheel/check_wheel.py"
INFO = "orbslam2py-1.dist-info"
ENTRY = """
extern "C" void *PyInit_core() { return 0; }
extern "C" __attribute__((visibility("VISIBILITY"))) int inner() { return 1; }
"""
PART = {
    "name": "Solver",
    "version": "2",
    "licence": "BSD-3-Clause AND MPL-2.0",
    "archives": [],
    "texts": ["solver.txt"],
}


@pytest.fixture(scope="module")
def module(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with two libraries: hidden.so shows its entry point, default.so more."""
    folder = tmp_path_factory.mktemp("module")
    for visibility in ("hidden", "default"):
        source = folder / f"{visibility}.cpp"
        source.write_text(ENTRY.replace("VISIBILITY", visibility))
        command = ["c++", "-shared", "-fPIC", "-Wl,--no-as-needed", source]
        subprocess.run([*command, "-o", source.with_suffix(".so")], check=True)
    traces = (folder / "hidden.so").read_bytes() + b"cholmod_analyze\0"
    (folder / "traces.so").write_bytes(traces)
    return folder


def wheel(folder: Path, library: Path, part: dict[str, Any], **left_out: bool) -> Path:
    """Make a wheel of a library with a manifest of one part."""
    path = folder / "orbslam2py-1-cp311-cp311-manylinux_2_31_x86_64.whl"
    with zipfile.ZipFile(path, "w") as out:
        out.write(library, "orbslam2py/_core.so")
        out.writestr(f"{INFO}/METADATA", "Name: orbslam2py\n")
        for name in ("LICENSE", "third_party_notes/README.md", "third_party_notes/pybind11.md"):
            out.writestr(f"{INFO}/licenses/{name}", "text")
        if not left_out.get("manifest"):
            out.writestr(f"{INFO}/licenses/linked/manifest.json", json.dumps([part]))
        if not left_out.get("text"):
            out.writestr(f"{INFO}/licenses/linked/solver.txt", "text")
    return path


def check(path: Path) -> tuple[int, str]:
    """Give the exit code and what was printed."""
    done = subprocess.run(
        [sys.executable, CHECK, path], capture_output=True, text=True, check=False
    )
    assert done.stderr == ""
    return done.returncode, done.stdout


def test_a_clean_one_passes_and_is_listed(module: Path, tmp_path: Path) -> None:
    code, told = check(wheel(tmp_path, module / "hidden.so", PART))
    assert code == 0
    assert "Solver 2: BSD-3-Clause AND MPL-2.0" in told


@pytest.mark.parametrize("licence", ["GPL-2.0-or-later", "BSD-3-Clause AND LGPL-2.1", "", "Mine"])
def test_other_licences_fail(module: Path, tmp_path: Path, licence: str) -> None:
    code, told = check(wheel(tmp_path, module / "hidden.so", PART | {"licence": licence}))
    assert code == 1
    assert "not permissive or not known" in told


def test_a_missing_text_or_manifest_fails(module: Path, tmp_path: Path) -> None:
    code, told = check(wheel(tmp_path, module / "hidden.so", PART, text=True))
    assert code == 1
    assert "the licence text solver.txt of Solver is missing" in told
    code, told = check(wheel(tmp_path, module / "hidden.so", PART | {"texts": []}))
    assert code == 1
    assert "Solver has no licence text" in told
    code, told = check(wheel(tmp_path, module / "hidden.so", PART, manifest=True))
    assert code == 1
    assert "no manifest" in told


def test_traces_of_a_library_under_the_gpl_fail(module: Path, tmp_path: Path) -> None:
    code, told = check(wheel(tmp_path, module / "traces.so", PART))
    assert code == 1
    assert "orbslam2py/_core.so holds traces of cholmod_" in told


def test_visible_symbols_fail(module: Path, tmp_path: Path) -> None:
    code, told = check(wheel(tmp_path, module / "default.so", PART))
    assert code == 1
    assert "shows 1 symbols, inner first" in told


def test_an_unrepaired_or_large_one_fails(module: Path, tmp_path: Path) -> None:
    made = wheel(tmp_path, module / "hidden.so", PART)
    plain = made.rename(tmp_path / "orbslam2py-1-cp311-cp311-linux_x86_64.whl")
    with zipfile.ZipFile(plain, "a") as out:
        out.writestr("orbslam2py/data/large.bin", bytes(26_000_000))
    code, told = check(plain)
    assert code == 1
    assert "not tagged for a manylinux" in told
    assert "26.0 MB, more than 25" in told

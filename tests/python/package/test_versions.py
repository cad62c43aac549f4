# SPDX-License-Identifier: BSD-3-Clause
"""What measures how long the package takes to build, and its kernels beside another version."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from benchmarks.versions import building
from benchmarks.versions.kernels import kernel_tables

from orbslam2py import _core as core
from support.data import CHECKOUT


def test_the_package_is_configured_as_pip_does() -> None:
    words, targets = building.configuration("package", CHECKOUT)
    assert targets == ["orbslam2py_python"]
    assert {"-DORBSLAM2PY_PYTHON=ON", "-DORBSLAM2PY_UNITY=ON", "-DCMAKE_BUILD_TYPE=Release"} <= set(
        words
    )


@pytest.mark.skipif(shutil.which("ninja") is None, reason="ninja is not installed")
def test_a_build_is_measured_by_its_processor_time(tmp_path: Path) -> None:
    source = tmp_path / "source"
    source.mkdir()
    shutil.copy(CHECKOUT / "pyproject.toml", source)
    (source / "work.py").write_text("sum(range(10_000_000))\nprint('a line that is not shown')\n")
    (source / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.22)\nproject(made_up NONE)\n"
        "add_custom_command(OUTPUT done COMMAND ${Python_EXECUTABLE} "
        "${CMAKE_SOURCE_DIR}/work.py COMMAND ${CMAKE_COMMAND} -E touch done)\n"
        "add_custom_target(orbslam2py_python DEPENDS done)\n"
        "add_custom_target(more ALL COMMAND ${CMAKE_COMMAND} -E false)\n"
    )
    built = building.build("package", source, tmp_path / "build", 1)
    # The loop took something, and the target that fails was not built.
    assert 0.0005 < built.minutes < 1
    assert built.slowest[0][1].endswith("done")


def test_kernels_of_two_versions_are_measured_in_turns(tmp_path: Path) -> None:
    this = CHECKOUT, Path(core.__file__).parent
    extraction, stereo = kernel_tables({"old": this, "new": this}, tmp_path, 1)
    units = core.vector_units()
    assert list(extraction.columns[1].cells) == units * 2
    assert list(stereo.columns[0].cells) == ["old", "old", "new", "new"]
    assert list(stereo.columns[1].cells) == [units[-1], units[0]] * 2
    for table in (extraction, stereo):
        for column in table.columns[2:]:
            assert all(float(cell.split()[0]) > 0 for cell in map(str, column.cells))
            assert any(str(cell).endswith("(1.00)") for cell in column.cells)

# SPDX-License-Identifier: BSD-3-Clause
"""What measures how long the package takes to build."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from benchmarks import build_time

from support.data import CHECKOUT


def test_the_package_is_configured_as_pip_does() -> None:
    words, targets = build_time.configuration("package", CHECKOUT)
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
    built = build_time.build("package", source, tmp_path / "build", 1)
    # The loop took something, and the target that fails was not built.
    assert 0.0005 < built.minutes < 1
    assert built.slowest[0][1].endswith("done")

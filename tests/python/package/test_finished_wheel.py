# SPDX-License-Identifier: BSD-3-Clause
"""Wheels that `make wheel` has left in ``dist``: what is inside, and that it works alone."""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import pytest

from support.data import CHECKOUT

WHEELS = sorted((CHECKOUT / "dist").glob("orbslam2py-*manylinux*.whl"))
TAG = f"cp{sys.version_info.major}{sys.version_info.minor}"
OURS = [path for path in WHEELS if f"-{TAG}-" in path.name]

USE = """
import numpy as np
from orbslam2py import _core
from orbslam2py.vocabulary import _textio
assert _core.__file__.startswith(FOLDER) and _textio.__file__.startswith(FOLDER)
image = np.random.default_rng(0).integers(0, 256, (240, 320), dtype=np.uint8)
found = _core.OrbExtractor(_core.OrbOptions(n_features=300)).extract(image)
print(len(found.keypoints), found.descriptors.shape[1])
"""


def test_wheels_may_be_given_away() -> None:
    if not WHEELS:
        pytest.skip("dist has no wheel: make wheel builds one")
    check = CHECKOUT / "scripts/wheel/check_wheel.py"
    done = subprocess.run(
        [sys.executable, check, *WHEELS], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count("OpenCV 4") == len(WHEELS)
    assert done.stdout.count("Ceres Solver 2") == len(WHEELS)


def test_nothing_of_the_package_is_left_out() -> None:
    if not WHEELS:
        pytest.skip("dist has no wheel: make wheel builds one")
    source = CHECKOUT / "src"
    kinds = {".py", ".pyi", ".bvoc", ".typed", ".html", ".js", ".css", ".json", ".yaml"}
    wanted = {p.relative_to(source).as_posix() for p in source.rglob("*") if p.suffix in kinds}
    wanted |= {"orbslam2py/py.typed"}
    for path in WHEELS:
        with zipfile.ZipFile(path) as wheel:
            missing = wanted - set(wheel.namelist())
        assert not missing, f"{path.name}: {sorted(missing)[:5]}"


def test_the_one_for_this_python_works_unpacked_anywhere(tmp_path: Path) -> None:
    if not OURS:
        pytest.skip(f"dist has no wheel for {TAG}: make wheel builds one")
    folder = tmp_path / "Päckchen für 日本"
    with zipfile.ZipFile(max(OURS, key=lambda path: path.stat().st_mtime)) as wheel:
        wheel.extractall(folder)
    paths = os.pathsep.join([str(folder), sysconfig.get_path("purelib")])
    # -S: an installation for development is found before all paths otherwise.
    done = subprocess.run(
        [sys.executable, "-S", "-c", f"FOLDER = {str(folder)!r}\n{USE}"],
        env=os.environ | {"PYTHONPATH": paths},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    n, length = map(int, done.stdout.split())
    assert n >= 200
    assert length == 32

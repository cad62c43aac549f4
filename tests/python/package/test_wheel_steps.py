# SPDX-License-Identifier: BSD-3-Clause
"""Steps of building and trying wheels that need neither a compiler nor another machine."""

from __future__ import annotations

import os
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import pytest

from support.data import CHECKOUT


def script(name: str) -> ModuleType:
    """Load a script of scripts/wheel."""
    spec = spec_from_file_location(name, CHECKOUT / "scripts/wheel" / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_only_what_has_changed_is_compiled_again(tmp_path: Path) -> None:
    old, new = tmp_path / "source", tmp_path / "unpacked"
    for folder, changed in ((old, "1"), (new, "2")):
        (folder / "cpp").mkdir(parents=True)
        (folder / "same.cpp").write_text("same")
        (folder / "cpp/changed.cpp").write_text(changed)
    (old / "gone.cpp").write_text("gone")
    (new / "cpp/added.cpp").write_text("added")
    for folder in (old, new):  # an archive of a release has one time for all
        for path in folder.rglob("*.cpp"):
            os.utime(path, (1e9, 1e9))
    script("build_wheel").take_changes(new, old)
    texts = {p.relative_to(old).as_posix(): p.read_text() for p in old.rglob("*") if p.is_file()}
    assert texts == {"same.cpp": "same", "cpp/changed.cpp": "2", "cpp/added.cpp": "added"}
    assert (old / "same.cpp").stat().st_mtime == 1e9
    assert (old / "cpp/changed.cpp").stat().st_mtime > 1e9


@pytest.mark.parametrize("python", ["3.11", "3.13"])
def test_the_oldest_of_every_dependency_is_tried(python: str) -> None:
    environments = script("environments")
    constraints = environments.environments(python)
    assert constraints["newest"] == []
    names = {line.partition("==")[0] for line in constraints["oldest"]}
    pyproject = environments.tomllib.loads((CHECKOUT / "pyproject.toml").read_text())
    assert names == {line.partition(">=")[0] for line in pyproject["project"]["dependencies"]}
    if python == "3.11":
        # The bounds themselves, but where no wheel is that old.
        excused = set(environments.OLDEST_WHEELS[python])
        bounds = dict(line.split(">=") for line in pyproject["project"]["dependencies"])
        tried = dict(line.split("==") for line in constraints["oldest"])
        assert excused == {"pillow"}
        for name in set(bounds) - excused:
            assert tried[name].removesuffix(".*") == bounds[name]
        assert constraints["numpy-1.26"] == ["numpy==1.26.4"]


def test_every_tree_has_its_oldest_versions(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(CHECKOUT / "scripts/wheel")
    monkeypatch.delitem(sys.modules, "environments", raising=False)
    trees = script("test_wheel").SUITES
    assert set(trees.values()) == set(script("environments").OLDEST_WHEELS)

# SPDX-License-Identifier: BSD-3-Clause
"""A compiled part that cannot be loaded is a sentence, on the command line and in Python."""

from __future__ import annotations

import importlib
import os
import shutil
import subprocess
import sys
import sysconfig
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path

import pytest

import orbslam2py
from orbslam2py import _extension

PACKAGE = Path(orbslam2py.__file__).parent
FLAGS = "processor\t: 0\nmodel name\t: Old\nflags\t\t: fpu pni ssse3 sse4_1 cx16 lahf_lm\n\n"


@pytest.fixture(scope="module")
def copied(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder, with a space and letters beyond ASCII, with the package's Python files."""
    folder = tmp_path_factory.mktemp("Päckchen für 日本")
    ignore = shutil.ignore_patterns("*.so", "__pycache__", "*.bvoc")
    shutil.copytree(PACKAGE, folder / "orbslam2py", ignore=ignore)
    return folder


def run_in(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run Python with the package of a folder, whatever else is installed for development."""
    # Such an installation is found before all paths, by a file that -S passes over.
    paths = os.pathsep.join([str(folder), sysconfig.get_path("purelib")])
    return subprocess.run(
        [sys.executable, "-S", *arguments],
        env=os.environ | {"PYTHONPATH": paths, "PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
        check=False,
    )


def test_a_missing_one_names_python_machine_and_remedy(copied: Path) -> None:
    other = copied / "orbslam2py" / "_core.cpython-37m-riscv64-linux-gnu.so"
    other.touch()
    done = run_in(copied, "-m", "orbslam2py", "demo")
    other.unlink()
    assert done.returncode == 1
    first, second = done.stderr.strip().splitlines()
    assert f"missing for cpython {sys.version_info.major}.{sys.version_info.minor}" in first
    assert f"there is {other.name}" in first
    assert second.startswith("Install a wheel for this Python and machine, or build from source")


def test_a_broken_one_says_what_the_loader_says(copied: Path) -> None:
    broken = copied / "orbslam2py" / f"_core{EXTENSION_SUFFIXES[0]}"
    broken.write_bytes(b"no ELF")
    done = run_in(copied, "-c", "import orbslam2py; orbslam2py.System")
    broken.unlink()
    assert done.returncode == 1
    assert "ImportError: The compiled part of orbslam2py cannot be loaded: " in done.stderr
    assert broken.name in done.stderr


def test_an_old_processor_is_named_before_it_meets_an_unknown_instruction(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert _extension.missing_instructions(FLAGS) == ["SSE4.2", "POPCNT"]
    assert _extension.missing_instructions("") == []
    monkeypatch.setattr(_extension, "_first_processor", lambda: FLAGS)
    monkeypatch.setattr(_extension.platform, "machine", lambda: "x86_64")
    with pytest.raises(ImportError, match=r"lacks SSE4\.2, POPCNT.*\n.*2009"):
        _extension.load()


def test_other_import_errors_are_not_taken_for_it(copied: Path) -> None:
    done = run_in(copied, "-c", "import orbslam2py; orbslam2py.nothing")
    assert "AttributeError" in done.stderr
    assert "compiled part" not in done.stderr


@pytest.mark.parametrize(
    ("cause", "raised"), [(KeyboardInterrupt(), KeyboardInterrupt), (OSError(), ImportError)]
)
def test_an_interrupt_while_it_is_loaded_is_an_interrupt(
    monkeypatch: pytest.MonkeyPatch, cause: BaseException, raised: type[BaseException]
) -> None:
    def interrupted(name: str) -> None:
        raise ImportError("initialization failed") from cause

    monkeypatch.setattr(importlib, "import_module", interrupted)
    with pytest.raises(raised):
        _extension.load()

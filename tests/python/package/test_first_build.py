# SPDX-License-Identifier: BSD-3-Clause
"""How the steps of `make demo` show how far they are, and the virtual environment they make."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import venv
from pathlib import Path
from types import ModuleType

import pytest

from support.build_scripts import load_scripts
from support.data import CHECKOUT


@pytest.fixture
def scripts(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> ModuleType:
    monkeypatch.setattr(sys, "argv", ["script"])
    return load_scripts(monkeypatch, tmp_path)


# ---- progress ------------------------------------------------------------------------------------


def test_positions_are_read_from_the_output(scripts: ModuleType) -> None:
    steps = scripts.steps
    assert steps.ninja_position("  [12/96] Building CXX object frame.cpp.o") == "[12/96]"
    assert steps.ninja_position("ninja: no work to do.") is None
    assert steps.pip_position("  Downloading numpy-2.4.6-cp311-x86_64.whl (16 MB)") == "numpy"
    assert steps.pip_position("Collecting opencv-python-headless>=4.6") == "opencv-python-headless"
    assert steps.pip_position("Installing collected packages: numpy") == "installing"
    assert steps.apt_position("dlstatus:1:23.5:Retrieving file 1 of 9") == "downloading 23 %"
    assert steps.apt_position("pmstatus:libc6:amd64:41.2:Unpacking") == "installing 41 %"
    assert steps.apt_position("Get:1 http://deb.debian.org bookworm/main") is None


def test_a_step_says_how_far_it_is(
    scripts: ModuleType,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    steps = scripts.steps
    monkeypatch.setattr(steps, "QUIET_SECONDS", 0.2)
    monkeypatch.setattr(steps, "LOOK_SECONDS", 0.05)
    command = ["sh", "-c", "echo '[1/2] a'; sleep 0.5; echo '[2/2] b'; sleep 0.5"]
    other = ["sh", "-c", "echo 'Collecting numpy'; sleep 0.4"]
    steps.run(
        "Compiling",
        steps.Step(command, tmp_path / "a.log", steps.ninja_position),
        steps.Step(other, tmp_path / "b.log", steps.pip_position),
    )
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "Compiling ..."
    assert lines[1].startswith("Compiling: [1/2]; numpy, ")
    assert any(line.startswith("Compiling: [2/2], ") for line in lines)
    assert lines[-1] == "Compiling: done in 1 s"
    assert (tmp_path / "a.log").read_text() == "[1/2] a\n[2/2] b\n"


def test_a_failure_shows_errors_and_the_end_of_the_log(scripts: ModuleType, tmp_path: Path) -> None:
    steps = scripts.steps
    script = "echo 'FAILED: frame.o'; echo 'c++: fatal error: Killed signal terminated program'; "
    script += "for i in $(seq 60); do echo line $i; done; exit 3"
    log = tmp_path / "a.log"
    step = steps.Step(["sh", "-c", script], log, steps.ninja_position)
    with pytest.raises(steps.FailedError) as caught:
        steps.run("Compiling", step)
    said = str(caught.value)
    assert said.startswith("Compiling failed.")
    assert "FAILED: frame.o" in said
    assert "  line 60" in said
    assert "line 30" not in said
    assert str(log) in said
    assert "make demo JOBS=1" in said


def test_fewer_sources_at_once_where_memory_is_short(
    scripts: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    build = scripts.build_package
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(8)))
    for free, jobs in (("1000000", 1), ("4000000", 3), ("90000000", 9)):
        text = f"MemTotal: 99999999 kB\nMemAvailable: {free} kB\n"
        monkeypatch.setattr(Path, "read_text", lambda _, text=text: text)
        assert build.jobs() == jobs


# ---- the virtual environment ---------------------------------------------------------------------


def make_venv(scripts: ModuleType, folder: Path, *options: str) -> int:
    sys.argv[1:] = [str(folder), *options]
    try:
        scripts.steps.main(scripts.make_venv.start)
    except SystemExit as end:
        return int(end.code or 0)
    return 0


@pytest.fixture
def environment(tmp_path: Path) -> Path:
    """A virtual environment with a pip that does nothing, which is quicker than the real one."""
    folder = tmp_path / "checkout/.venv"
    venv.create(folder, symlinks=True)
    version = f"python{sys.version_info[0]}.{sys.version_info[1]}"
    (folder / "lib" / version / "site-packages/pip.py").touch()
    (folder / "bin/pip").write_text(f"#!{folder}/bin/python3\n")
    return folder


@pytest.fixture
def remade(scripts: ModuleType, monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """Folders in which an environment would have been made."""
    folders: list[Path] = []
    monkeypatch.setattr(scripts.make_venv, "make", folders.append)
    return folders


def test_an_environment_that_works_is_left_alone(
    scripts: ModuleType, environment: Path, remade: list[Path]
) -> None:
    assert make_venv(scripts, environment) == 0
    assert remade == []


def test_an_environment_of_another_python_is_made_anew(
    scripts: ModuleType,
    environment: Path,
    remade: list[Path],
    capsys: pytest.CaptureFixture[str],
) -> None:
    settings = environment / "pyvenv.cfg"
    settings.write_text(re.sub(r"version = .*", "version = 3.2.1", settings.read_text()))
    assert make_venv(scripts, environment) == 0
    assert remade == [environment]
    said = capsys.readouterr().out
    assert "was made for Python 3.2" in said
    assert "installed again" in said


def test_a_python_that_is_named_is_taken(
    scripts: ModuleType,
    environment: Path,
    remade: list[Path],
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert make_venv(scripts, environment, "--this-python") == 0
    assert remade == []
    monkeypatch.setattr(sys, "version_info", (3, 77, 0))
    assert make_venv(scripts, environment) == 0
    assert remade == []
    assert make_venv(scripts, environment, "--this-python") == 0
    assert remade == [environment]
    assert "you named Python 3.77" in capsys.readouterr().out


def test_an_environment_of_a_moved_checkout_is_made_anew(
    scripts: ModuleType,
    environment: Path,
    remade: list[Path],
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
) -> None:
    (tmp_path / "checkout").rename(tmp_path / "moved")
    assert make_venv(scripts, tmp_path / "moved/.venv") == 0
    assert remade == [tmp_path / "moved/.venv"]
    assert f"was made at another place, {environment}" in capsys.readouterr().out


@pytest.mark.parametrize("broken", ["bin/python", "bin/pip"])
def test_an_environment_with_something_missing_is_made_anew(
    scripts: ModuleType, environment: Path, remade: list[Path], broken: str
) -> None:
    (environment / broken).unlink()
    assert make_venv(scripts, environment) == 0
    assert remade == [environment]


def test_a_folder_that_is_no_environment_is_left_alone(
    scripts: ModuleType,
    remade: list[Path],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    folder = tmp_path / ".venv"
    folder.mkdir()
    (folder / "notes.txt").write_text("mine")
    assert make_venv(scripts, folder) == 1
    assert remade == []
    assert "Move it away" in capsys.readouterr().err
    assert (folder / "notes.txt").read_text() == "mine"


def test_an_old_python_is_refused(
    scripts: ModuleType,
    remade: list[Path],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(sys, "version_info", (3, 9, 2))
    assert make_venv(scripts, tmp_path / ".venv") == 1
    said = capsys.readouterr().err
    assert "needs Python 3.10 or later" in said
    assert "make demo PYTHON=" in said
    assert remade == []


def test_a_python_without_venv_is_named(
    scripts: ModuleType,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    python = tmp_path / "python"
    python.write_text(
        "#!/bin/sh\nmkdir -p $4/bin\n"
        "echo 'The virtual environment was not created successfully because ensurepip is not "
        "available.'\nexit 1\n"
    )
    python.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(python))
    folder = tmp_path / "new/.venv"
    assert make_venv(scripts, folder) == 1
    assert "python3-venv" in capsys.readouterr().err
    assert not folder.exists()


def test_a_python_that_does_not_exist_is_named() -> None:
    answer = subprocess.run(
        ["make", "python", "PYTHON=python3.77"],
        cwd=CHECKOUT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert answer.returncode == 2
    assert "There is no python3.77" in answer.stderr
    assert "PYTHON=python3.11" in answer.stderr

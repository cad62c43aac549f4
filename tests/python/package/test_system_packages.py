# SPDX-License-Identifier: BSD-3-Clause
"""Which packages each target of the Makefile installs, and how Debian's are installed."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

from support.build_scripts import load_scripts
from support.data import CHECKOUT

MAKEFILE = (CHECKOUT / "Makefile").read_text()


@pytest.fixture
def scripts(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> ModuleType:
    monkeypatch.setattr(sys, "argv", ["script"])
    return load_scripts(monkeypatch, tmp_path)


class FakeDebian:
    """A dpkg-query and an apt-get of our own, alone on the path with the shell's tools."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.folder = folder
        folder.mkdir()
        for name in ("env", "cat", "sh", "touch", "grep", "sleep", "rm"):
            found = shutil.which(name)
            assert found is not None
            (folder / name).symlink_to(found)
        self.add("dpkg-query", f"cat {folder}/installed 2>/dev/null; exit 1")
        self.apt_get("true")
        monkeypatch.setenv("PATH", str(folder))
        monkeypatch.delenv("SYSTEM_PACKAGES", raising=False)

    def add(self, name: str, script: str) -> None:
        path = self.folder / name
        path.unlink(missing_ok=True)
        path.write_text(f"#!/bin/sh\n{script}\n")
        path.chmod(0o755)

    def apt_get(self, script: str) -> None:
        """The script of an apt-get that writes down how it was called."""
        self.add("apt-get", f'echo "$*" >>{self.folder}/calls\n{script}')

    def installed(self, *packages: str) -> None:
        lines = [f"{package} installed\n" for package in packages]
        (self.folder / "installed").write_text("".join(lines))

    def calls(self) -> list[list[str]]:
        calls = self.folder / "calls"
        return [line.split() for line in calls.read_text().splitlines()] if calls.exists() else []


@pytest.fixture
def debian(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> FakeDebian:
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    return FakeDebian(tmp_path / "bin", monkeypatch)


def install(scripts: ModuleType, *sections: str) -> int:
    """Call the installer as the Makefile does; gives the exit code."""
    sys.argv[1:] = sections
    try:
        scripts.steps.main(scripts.install_system_packages.start)
    except SystemExit as end:
        return int(end.code or 0)
    return 0


def sections(scripts: ModuleType) -> dict[str, list[str]]:
    script = scripts.install_system_packages
    return dict(script.sections(script.LIST.read_text()))


# ---- the lists -----------------------------------------------------------------------------------


def test_every_section_is_used_by_a_target_and_every_target_finds_its_sections(
    scripts: ModuleType,
) -> None:
    named = {
        section
        for group in re.findall(r"packages-([\w+-]+)", MAKEFILE)
        for section in group.split("+")
    }
    assert named == set(sections(scripts))


def test_the_demo_installs_no_package_for_developers(scripts: ModuleType) -> None:
    known = sections(scripts)
    for name in ("cpp-tests", "lint", "tidy", "docs", "browser"):
        assert known[name]
        assert not set(known[name]) & set(known["package"])
    assert "libopencv-dev" not in known["package"]  # all of OpenCV: 340 packages for two modules
    # What is done for `make demo`, target by target.
    dry = subprocess.run(
        ["make", "-n", "-B", "demo"], cwd=CHECKOUT, capture_output=True, text=True, check=True
    )
    installed = re.findall(r"install_system_packages\.sh (.*)", dry.stdout)
    assert set(installed) == {"package"}
    purposes = re.findall(r"install_requirements\.py (.*)", dry.stdout)
    assert purposes == ["build"]


def test_the_tests_install_all_they_need_at_once_and_first() -> None:
    dry = subprocess.run(
        ["make", "-n", "-B", "test"], cwd=CHECKOUT, capture_output=True, text=True, check=True
    )
    installed = re.findall(r"install_system_packages\.sh (.*)", dry.stdout)
    assert set(installed[0].split()) == {section for call in installed for section in call.split()}
    sections = {"package", "cpp-tests", "lint", "docs", "browser", "cameras"}
    assert set(installed[0].split()) == sections
    assert "install_requirements.py developer" in dry.stdout


def test_the_demo_installs_what_it_imports_and_the_viewer(scripts: ModuleType) -> None:
    pyproject = scripts.install_requirements.tomllib.loads(
        (CHECKOUT / "pyproject.toml").read_text()
    )
    demo = set(scripts.install_requirements.requirements("demo"))
    extras = pyproject["project"]["optional-dependencies"]
    assert demo == {*pyproject["project"]["dependencies"], *extras["viewer"]}
    developer = set(scripts.install_requirements.requirements("developer"))
    assert developer > demo | set(scripts.install_requirements.requirements("build"))
    large = set(scripts.install_requirements.LARGE_EXTRAS)
    usual = [packages for name, packages in extras.items() if name not in large]
    assert developer > {package for packages in usual for package in packages}
    assert large == {"oak"} and not developer & set(extras["oak"])


# ---- packages of the system ----------------------------------------------------------------------


def test_only_what_is_missing_is_installed(scripts: ModuleType, debian: FakeDebian) -> None:
    package = sections(scripts)["package"]
    debian.installed(*package[2:])
    assert install(scripts, "package") == 0
    update, call = debian.calls()
    assert update[-1] == "update"
    assert call[call.index("--no-install-recommends") + 1 :] == package[:2]


def test_nothing_is_called_when_nothing_is_missing(
    scripts: ModuleType, debian: FakeDebian, capsys: pytest.CaptureFixture[str]
) -> None:
    known = sections(scripts)
    debian.installed(*known["package"], *known["lint"])
    assert install(scripts, "package", "lint") == 0
    assert debian.calls() == []
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize(
    ("message", "holder"),
    [
        (
            "E: Could not get lock /var/lib/apt/lists/lock. It is held by process 77 (apt-get)",
            "process 77 (apt-get)",
        ),
        (
            "E: Could not get lock /var/lib/dpkg/lock-frontend. It is held by process 9 "
            "(unattended-upgr)\nE: Unable to acquire the dpkg frontend lock",
            "process 9 (unattended-upgr)",
        ),
        (
            "E: Could not get lock /var/cache/apt/archives/lock - open (11: Resource temporarily "
            "unavailable)\nE: Unable to lock the download directory",
            "another program",
        ),
    ],
)
def test_it_waits_while_another_program_holds_a_lock(
    scripts: ModuleType,
    debian: FakeDebian,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    message: str,
    holder: str,
) -> None:
    monkeypatch.setattr(scripts.install_system_packages, "TRY_AGAIN", 0.01)
    # Locked for two tries.
    debian.apt_get(
        f"t={debian.folder}/tries; echo x >>$t\n"
        f'[ "$(grep -c x $t)" -gt 2 ] || {{ echo "{message}" >&2; exit 100; }}'
    )
    assert install(scripts, "lint") == 0
    assert [call[-1] for call in debian.calls()] == ["update"] * 3 + ["clang-format"]
    said = capsys.readouterr().out
    assert said.count(f"waits for {holder}, which uses the package manager") == 1


def test_waiting_ends(
    scripts: ModuleType,
    debian: FakeDebian,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(scripts.install_system_packages, "TRY_AGAIN", 0.01)
    monkeypatch.setattr(scripts.install_system_packages, "PATIENCE", 0.05)
    debian.apt_get(
        "echo 'E: Could not get lock /var/lib/dpkg/lock. It is held by process 5 (aptitude)'\n"
        "exit 100"
    )
    assert install(scripts, "lint") == 1
    said = capsys.readouterr().err
    assert "process 5 (aptitude)" in said
    assert "apt-get install clang-format" in said


def test_without_network_it_names_the_package_and_what_to_do(
    scripts: ModuleType, debian: FakeDebian, capsys: pytest.CaptureFixture[str]
) -> None:
    debian.apt_get(
        "case $* in *update) echo 'W: Some index files failed to download.'; exit 0;; esac\n"
        "echo 'pmstatus:dpkg-exec:0.0:Running dpkg'\n"
        "echo 'E: Failed to fetch http://deb.debian.org/clang-format_1.deb  "
        "Temporary failure resolving deb.debian.org'; exit 100"
    )
    assert install(scripts, "lint") == 1
    said = capsys.readouterr().err
    assert "E: Failed to fetch http://deb.debian.org/clang-format_1.deb" in said
    assert "Check the network" in said
    assert "pmstatus" not in said
    assert "apt-get install clang-format" in said
    assert "apt-get-install.log" in said


def test_a_broken_source_of_the_system_does_not_end_it(
    scripts: ModuleType, debian: FakeDebian, capsys: pytest.CaptureFixture[str]
) -> None:
    debian.apt_get("case $* in *update) echo 'E: The repository x is not signed.'; exit 100;; esac")
    assert install(scripts, "lint") == 0
    assert "failed; see" in capsys.readouterr().out


def test_a_package_that_no_source_has(
    scripts: ModuleType, debian: FakeDebian, capsys: pytest.CaptureFixture[str]
) -> None:
    debian.apt_get(
        "case $* in *update) echo 'E: The repository x is not signed.'; exit 100;; esac\n"
        "echo 'E: Unable to locate package clang-format'; exit 100"
    )
    assert install(scripts, "lint") == 1
    said = capsys.readouterr().err
    assert "E: Unable to locate package clang-format" in said
    assert "/etc/apt/sources.list" in said
    assert "The repository x is not signed" in said


def test_a_full_disk_is_named(
    scripts: ModuleType, debian: FakeDebian, capsys: pytest.CaptureFixture[str]
) -> None:
    debian.apt_get('echo "E: You don\'t have enough free space in /var/cache."; exit 100')
    assert install(scripts, "lint") == 1
    assert "The disk is full." in capsys.readouterr().err


def test_without_root_and_without_sudo(
    scripts: ModuleType,
    debian: FakeDebian,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    assert install(scripts, "lint") == 1
    said = capsys.readouterr().err
    assert "no sudo" in said
    assert "apt-get install clang-format" in said
    assert debian.calls() == []


def test_sudo_that_refuses(
    scripts: ModuleType,
    debian: FakeDebian,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    debian.add("sudo", "exit 1")
    assert install(scripts, "lint") == 1
    said = capsys.readouterr().err
    assert "sudo gave no root rights" in said
    assert "apt-get install clang-format" in said


def test_sudo_passes_on_that_nobody_is_asked(
    scripts: ModuleType, debian: FakeDebian, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    debian.add(
        "sudo",
        'case $1 in -n) exit 0;; esac\nexec env -i PATH="$PATH" "$@"',  # forgets the environment
    )
    debian.apt_get(f"echo $DEBIAN_FRONTEND >>{debian.folder}/frontend")
    assert install(scripts, "lint") == 0
    assert (debian.folder / "frontend").read_text().split() == ["noninteractive"] * 2


def test_another_system_is_told_what_is_needed(
    scripts: ModuleType,
    debian: FakeDebian,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    (debian.folder / "apt-get").unlink()
    assert install(scripts, "package") == 1
    said = capsys.readouterr().err
    assert "libceres-dev" in said
    assert "make demo SYSTEM_PACKAGES=skip" in said
    monkeypatch.setenv("SYSTEM_PACKAGES", "skip")
    assert install(scripts, "package") == 0


def test_an_unknown_section_is_an_error(
    scripts: ModuleType, debian: FakeDebian, capsys: pytest.CaptureFixture[str]
) -> None:
    assert install(scripts, "tests") == 2
    said = capsys.readouterr().err
    assert "no section tests" in said
    assert "cpp-tests" in said

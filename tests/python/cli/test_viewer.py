# SPDX-License-Identifier: BSD-3-Clause
"""The viewer on the command line: it is named, beside a run, and stays until Ctrl-C."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest

from orbslam2py.cli.demo import own_name
from support.browser import Browser
from support.command_line import CommandLine, Results
from support.viewer_pages import AS_URGENT, click_on, open_viewer

pytestmark = pytest.mark.watchdog(200)
pytest.importorskip("viser", reason="the viewer's extra is not installed")

DEMO = ("demo", "--frames", "10", "--sensor", "rgbd")


def test_the_demo_names_the_viewer_as_the_next_thing(command: CommandLine) -> None:
    done = command(*DEMO)
    assert done.code == 0
    assert "orbslam2py demo --viewer" in done.out
    assert (Path("runs/demo") / "map.npz").is_file()


@pytest.mark.parametrize(
    ("called", "on_path", "typed"),
    [
        ("{here}/.venv/bin/orbslam2py", False, ".venv/bin/orbslam2py"),
        ("/opt/tools/bin/orbslam2py", False, "/opt/tools/bin/orbslam2py"),
        ("/opt/tools/bin/orbslam2py", True, "orbslam2py"),
        ("{here}/src/orbslam2py/__main__.py", True, f"{sys.executable} -m orbslam2py"),
    ],
)
def test_the_program_is_named_as_it_can_be_called(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, called: str, on_path: bool, typed: str
) -> None:
    """After `make demo` it is in a folder that is not on the path."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [called.format(here=tmp_path), "demo"])
    monkeypatch.setattr("shutil.which", lambda name: f"/usr/bin/{name}" if on_path else None)
    assert own_name() == typed


def test_a_run_with_a_viewer_leaves_the_same_bytes(command: CommandLine) -> None:
    assert (
        command("synthesize", "lap", "--sensor", "rgbd", "--frames", 25, "--size", "320x240").code
        == 0
    )
    run = ("run", "lap", "--deterministic", "--quiet")
    assert command(*run, "--output", "without").code == 0
    done = command(*run, "--output", "with", "--viewer", "--viewer-port", 0, "--viewer-exit")
    assert done.code == 0
    assert "The viewer is at http://127.0.0.1:" in done.out
    for name in (
        "trajectory.txt",
        "trajectory_online.txt",
        "keyframes.txt",
        "points.ply",
        "map.npz",
    ):
        assert (Path("with") / name).read_bytes() == (Path("without") / name).read_bytes(), name


def test_a_run_without_a_viewer_loads_nothing_of_it(tmp_path: Path) -> None:
    """Neither the page nor what it is made of, nor anything that starts processes in its place."""
    code = """
import sys
from orbslam2py.cli import main
try:
    main()
finally:
    heavy = {"viser", "websockets", "msgspec", "multiprocessing", "rerun", "plotly"}
    names = {name for name in sys.modules if name.startswith("orbslam2py.viewer")}
    print("loaded:", *sorted((heavy & sys.modules.keys()) | names))
"""
    done = subprocess.run(
        [sys.executable, "-c", code, *DEMO, "--quiet"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1].split() == ["loaded:"]


def started(arguments: tuple[str, ...], folder: Path) -> tuple[subprocess.Popen[str], str]:
    """A command of its own, and where its viewer is."""
    environment = {name: value for name, value in os.environ.items() if name != "DISPLAY"}
    code = (
        "import sys\n"
        "from orbslam2py.viewer.process import companion\n"
        f"companion._CODE = {AS_URGENT!r} + companion._CODE\n"
        "from orbslam2py.cli import main\n"
        "sys.argv[0] = 'orbslam2py'\n"
        "main()\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", code, *arguments],
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    line = process.stdout.readline()
    assert line.startswith("The viewer is at http://127.0.0.1:"), process.communicate()[1]
    return process, line.split()[4].rstrip(":")


def ended(process: subprocess.Popen[str]) -> tuple[int, str]:
    """Press Ctrl-C and wait for the end: exit code, and all that was printed."""
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert "Traceback" not in err
    return process.returncode, out + err


def test_a_recorded_run_is_held_stepped_and_stopped_in_the_page(tmp_path: Path) -> None:
    """Far more images than it takes to press the buttons, on any computer."""
    images = ("--frames", "5000")
    arguments = ("demo", "--sensor", "rgbd", *images, "--viewer", "--viewer-port", "0")
    with Browser() as browser:
        process, address = started(arguments, tmp_path)
        page = open_viewer(browser, address)
        click_on(page, "Pause")
        page.wait_for("document.body.innerText.includes('Go on')")
        click_on(page, "Single step")
        click_on(page, "Go on")
        page.wait_for("document.body.innerText.includes('Pause')")
        click_on(page, "Stop")
        page.wait_for("document.body.innerText.includes('The run has ended')", 60)
    with urllib.request.urlopen(address, timeout=30) as answer:
        assert answer.status == 200  # it stays
    code, printed = ended(process)
    assert code == 130
    assert "until Ctrl-C" in printed
    report = Results(tmp_path / "runs/demo").report
    assert report["interrupted"]
    assert 0 < report["seen_frames"] < report["frames"]


def test_a_finished_run_is_watched_until_ctrl_c(command: CommandLine, tmp_path: Path) -> None:
    assert command(*DEMO).code == 0
    process, address = started(("view", "runs/demo", "--viewer-port", "0"), Path.cwd())
    with urllib.request.urlopen(address, timeout=30) as answer:
        assert answer.status == 200
    code, _ = ended(process)
    assert code == 0

# SPDX-License-Identifier: BSD-3-Clause
"""SIGTERM and SIGHUP are requests as Ctrl-C is: results written, nothing hidden left behind."""

from __future__ import annotations

import os
import pty
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from orbslam2py.cli import interrupts
from support.command_line import RUN_FILES, Results

pytestmark = pytest.mark.watchdog(90)

COMMAND = [sys.executable, "-m", "orbslam2py"]
#: Takes far longer than any of the tests.
DEMO = ["demo", "--output", "d", "--frames", "3000", "--quiet"]
STREET = [
    "synthesize",
    "s",
    "--world",
    "street",
    "--frames",
    "9000",
    "--size",
    "620x188",
    "--quiet",
]
ENDINGS = [(signal.SIGTERM, 143), (signal.SIGHUP, 129)]


def wait_until(there: Callable[[], object], process: subprocess.Popen[bytes]) -> None:
    end = time.monotonic() + 40
    while not there():
        assert process.poll() is None, "it has ended before"
        assert time.monotonic() < end
        time.sleep(0.02)


def hidden(folder: Path) -> list[str]:
    return [path.name for path in folder.iterdir() if path.name.startswith(".")]


def hears_all() -> None:
    """Undo what the tests may have been started with: ``nohup``, a job in the background."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)


def deaf_to(number: signal.Signals) -> Callable[[], None]:
    def prepare() -> None:
        hears_all()
        signal.signal(number, signal.SIG_IGN)

    return prepare


def begun(
    folder: Path, *arguments: str, before: list[str] | None = None, **more: Any
) -> subprocess.Popen[bytes]:
    more.setdefault("preexec_fn", hears_all)
    return subprocess.Popen(
        [*(before or []), *COMMAND, *arguments],
        cwd=folder,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        **more,
    )


def cpu_seconds(pid: int) -> float:
    """What a process has computed so far."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def in_the_middle(folder: Path, process: subprocess.Popen[bytes], pid: int | None = None) -> None:
    """Wait until some images are tracked, however slow the computer is."""
    pid = process.pid if pid is None else pid
    wait_until((folder / "d" / "frames.csv").is_file, process)
    begin = cpu_seconds(pid)
    wait_until(lambda: cpu_seconds(pid) > begin + 1.0, process)


def ended(process: subprocess.Popen[bytes]) -> tuple[int, str]:
    try:
        _, err = process.communicate(timeout=60)
    finally:
        process.kill()
    return process.returncode, err.decode()


def is_saved(folder: Path) -> None:
    results = Results(folder)
    assert results.report["interrupted"]
    assert len(results.frames) < results.report["frames"]
    assert {path.name for path in folder.iterdir()} >= RUN_FILES - {"groundtruth_aligned.txt"}


@pytest.mark.parametrize(("number", "code"), ENDINGS)
def test_a_run_saves_what_was_done(tmp_path: Path, number: signal.Signals, code: int) -> None:
    process = begun(tmp_path, *DEMO, "--video", "d.mp4")
    in_the_middle(tmp_path, process)
    process.send_signal(number)
    found, err = ended(process)
    assert found == code, err
    assert "Traceback" not in err
    is_saved(tmp_path / "d")
    assert (tmp_path / "d.mp4").stat().st_size > 0
    assert hidden(tmp_path) == []


@pytest.mark.parametrize(("number", "code"), ENDINGS)
def test_what_is_half_written_goes(tmp_path: Path, number: signal.Signals, code: int) -> None:
    process = begun(tmp_path, *STREET)
    wait_until(lambda: hidden(tmp_path), process)
    process.send_signal(number)
    assert ended(process) == (code, "")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(shutil.which("timeout") is None, reason="coreutils are not installed")
@pytest.mark.parametrize("arguments", [DEMO, STREET])
def test_a_signal_that_comes_twice_is_one_request(tmp_path: Path, arguments: list[str]) -> None:
    process = begun(tmp_path, *arguments, before=["timeout", "600"], start_new_session=True)
    if arguments is DEMO:
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children")
        wait_until(lambda: children.read_text().strip(), process)
        in_the_middle(tmp_path, process, int(children.read_text()))
    else:
        wait_until(lambda: hidden(tmp_path), process)
    process.send_signal(signal.SIGALRM)  # as when its time is over
    code, err = ended(process)
    assert code == 124, err
    assert "Traceback" not in err
    if arguments is DEMO:
        is_saved(tmp_path / "d")
    assert hidden(tmp_path) == []


def test_a_terminal_that_is_closed(tmp_path: Path) -> None:
    """Then also whatever is still said is an error, and the signal comes as a rule twice."""
    pid, terminal = pty.fork()
    if pid == 0:
        hears_all()
        os.chdir(tmp_path)
        os.execv(sys.executable, [*COMMAND, *DEMO[:-1]])
    shown = b""
    while b"frames/s" not in shown:
        shown += os.read(terminal, 65536)
    os.close(terminal)
    _, status = os.waitpid(pid, 0)
    assert os.waitstatus_to_exitcode(status) == 129
    is_saved(tmp_path / "d")


@pytest.mark.parametrize("ignored", [signal.SIGHUP, signal.SIGINT])
def test_what_is_ignored_stays_so_and_the_rest_is_heard(
    tmp_path: Path, ignored: signal.Signals
) -> None:
    """As under ``nohup``, and in a job in the background."""
    process = begun(tmp_path, *DEMO, preexec_fn=deaf_to(ignored))
    in_the_middle(tmp_path, process)
    process.send_signal(ignored)
    time.sleep(0.5)
    assert process.poll() is None
    process.send_signal(signal.SIGTERM)
    assert ended(process)[0] == 143
    is_saved(tmp_path / "d")


def test_only_a_second_request_later_on_breaks_off(monkeypatch: pytest.MonkeyPatch) -> None:
    with interrupts.EndingSignals() as ending, interrupts.StopOnInterrupt() as stop:
        for _ in range(2):
            signal.raise_signal(signal.SIGTERM)
            assert stop.event.wait(30)
        monkeypatch.setattr(interrupts, "_ECHO_SECONDS", 0.0)
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGTERM)
    assert ending.exit_code == 143


def test_a_request_while_the_event_is_locked_waits_for_nobody() -> None:
    """As for a moment in each wait, before which and after which the signal may come as well."""
    with interrupts.StopOnInterrupt() as stop:
        with stop.event._cond:  # type: ignore[attr-defined]
            signal.raise_signal(signal.SIGINT)
        assert stop.event.wait(30)


def test_a_request_is_known_before_any_other_thread_has_run(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """On a busy machine that takes as long as a frame or two, which are not to be tracked."""
    setters: list[Callable[[], None]] = []
    monkeypatch.setattr(
        interrupts._thread, "start_new_thread", lambda setter, _: setters.append(setter)
    )
    with interrupts.StopOnInterrupt() as stop:
        assert not stop.event.is_set()
        signal.raise_signal(signal.SIGINT)
        assert stop.event.is_set()
        assert len(setters) == 1, "who waits is woken"


def test_the_command_line_leaves_no_handlers_behind() -> None:
    code = (
        "import signal, sys\n"
        "from orbslam2py.cli import main\n"
        "sys.argv = ['orbslam2py', '--version']\n"
        "try:\n"
        "    main()\n"
        "except SystemExit:\n"
        "    pass\n"
        "assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL\n"
        "assert signal.getsignal(signal.SIGHUP) is signal.SIG_DFL\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, preexec_fn=hears_all)

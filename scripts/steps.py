# SPDX-License-Identifier: BSD-3-Clause
"""Run long commands as steps: the screen shows how far they are, a log file has their output.

Runs with the system's Python, which may be older than the package allows.
"""

from __future__ import annotations

import contextlib
import os
import re
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple, NoReturn

PROJECT = Path(__file__).resolve().parent.parent
LOGS = PROJECT / "build/logs"
OLDEST_PYTHON = (3, 10)

#: Seconds between two lines where the output is no terminal.
QUIET_SECONDS = 15.0
LOOK_SECONDS = 0.3
#: Lines of a log that are shown after a failure.
LAST_LINES = 20
FIRST_ERRORS = 5

#: What the output of a failed command shows, and what a person can do about it.
CAUSES: tuple[tuple[str, str], ...] = (
    (
        r"No space left on device|don't have enough free space",
        "The disk is full. Free some space, then try again.",
    ),
    (
        r"Temporary failure (in name resolution|resolving)|Could not (resolve|connect)|"
        r"Network is unreachable|Connection timed out|Failed to establish a new connection|"
        r"Name or service not known|Connection refused",
        "The server could not be reached. Check the network and the proxy (http_proxy, "
        "https_proxy), then try again.",
    ),
    (
        r"Killed signal terminated program|fatal error: Killed",
        "The compiler was stopped, mostly because memory ran out. "
        "Compile one file at a time: add JOBS=1 to the command (make demo JOBS=1).",
    ),
    (
        r"Unable to locate package|has no installation candidate",
        "This system's package sources do not have a package. Debian 12 has all of them in "
        "'main': look into /etc/apt/sources.list and /etc/apt/sources.list.d.",
    ),
    (
        r"Could NOT find Python.*Development",
        "The headers of this Python are missing (on Debian: the package python3-dev, or "
        "python3.X-dev for a Python that is not the system's).",
    ),
    (
        r"ensurepip is not available|No module named '?ensurepip",
        "This Python cannot make virtual environments (on Debian: install the package "
        "python3-venv, or python3.X-venv for a Python that is not the system's).",
    ),
)


class Step(NamedTuple):
    """A command, and what a line of its output says about how far it is."""

    command: Sequence[str]
    log: Path
    position: Callable[[str], str | None]
    environment: dict[str, str] | None = None
    name: str = ""  # where it is one of several


class FailedError(Exception):
    """A command failed; the text says which, shows the end of its output and names the log."""


class Display:
    """A line that moves on a terminal; elsewhere a line now and then."""

    def __init__(self, doing: str) -> None:
        self.doing = doing
        self.position = ""
        self.began = self.said = time.monotonic()
        self.moves = sys.stdout.isatty()
        self.show("...")

    def show(self, position: str) -> None:
        """Write now."""
        self.said = time.monotonic()
        ending = "" if self.moves else "\n"
        beginning = "\r\x1b[K" if self.moves else ""
        separator = " " if position == "..." else ": "
        print(f"{beginning}{self.doing}{separator}{position}", end=ending, flush=True)

    def update(self, position: str) -> None:
        """Write if it is time; an empty position is that of before."""
        position = self.position = position or self.position
        if self.moves or time.monotonic() - self.said >= QUIET_SECONDS:
            passed = f"{self.seconds()} s"
            self.show(f"{position}, {passed}" if position else passed)

    def seconds(self) -> int:
        """Give the time since the beginning."""
        return round(time.monotonic() - self.began)

    def done(self) -> None:
        """Say how long it took."""
        self.show(f"done in {self.seconds()} s")
        if self.moves:
            print(flush=True)

    def leave(self) -> None:
        """End the moving line."""
        if self.moves:
            print(flush=True)


def start(step: Step) -> subprocess.Popen[bytes]:
    """Start a command whose output goes into its log."""
    step.log.parent.mkdir(parents=True, exist_ok=True)
    with step.log.open("wb") as log:
        return subprocess.Popen(
            list(step.command),
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=subprocess.STDOUT,
            env={**os.environ, **(step.environment or {})},
            cwd=PROJECT,
        )


def follow(display: Display, *steps: Step) -> list[int]:
    """Run commands at the same time, show how far they are, and give their exit codes."""
    processes = [start(step) for step in steps]
    read = [0] * len(steps)
    positions = [""] * len(steps)
    try:
        while True:
            running = [process.poll() is None for process in processes]
            for index, step in enumerate(steps):
                read[index], found = _newest(step, read[index])
                if found:
                    positions[index] = f"{step.name} {found}".strip()
            if not any(running):
                return [process.returncode for process in processes]
            shown = [positions[i] for i, runs in enumerate(running) if runs and positions[i]]
            display.update("; ".join(shown))
            time.sleep(LOOK_SECONDS)
    except BaseException:  # an interrupt reaches the commands as well: let them end
        display.leave()
        for process in processes:
            with contextlib.suppress(PermissionError):  # sudo's; it was interrupted itself
                process.terminate()
            process.wait()
        raise


def _newest(step: Step, read: int) -> tuple[int, str | None]:
    """Give how far a log is read, and what the newest line that says something says."""
    with step.log.open("rb") as log:
        log.seek(read)
        text = log.read()
    complete = text.rfind(b"\n") + 1
    found = None
    for line in text[:complete].decode(errors="replace").splitlines():
        found = step.position(line) or found
    return read + complete, found


def failure(doing: str, log: Path, hint: str = "") -> FailedError:
    """Make the error of a failed command."""
    output = log.read_text(errors="replace")
    lines = [line for line in output.rstrip().splitlines() if not _STATUS.match(line)]
    last = lines[-LAST_LINES:]
    errors = [
        line for line in lines[:-LAST_LINES] if re.search(r"^E: |error:|ERROR:|FAILED:", line)
    ][:FIRST_ERRORS]
    parts = [f"{doing} failed."]
    if errors:
        parts += ["Its first errors:", *(f"  {line}" for line in errors)]
    parts += ["The end of its output:", *(f"  {line}" for line in last)]
    parts += [f"All of its output: {_short(log)}"]
    parts += [remedy for pattern, remedy in CAUSES if re.search(pattern, output)]
    if hint:
        parts.append(hint)
    return FailedError("\n".join(parts))


def run(doing: str, *steps: Step, hint: str = "") -> None:
    """Run commands at the same time; raises FailedError if one fails."""
    display = Display(doing)
    for index, code in enumerate(follow(display, *steps)):
        if code != 0:
            display.leave()
            raise failure(doing, steps[index].log, hint)
    display.done()


def _short(path: Path) -> str:
    try:
        return str(path.relative_to(Path.cwd()))
    except ValueError:
        return str(path)


def stop(message: str) -> NoReturn:
    """End the program with a message."""
    sys.stdout.flush()
    print(message, file=sys.stderr)
    sys.exit(1)


def main(function: Callable[[], None]) -> None:
    """Call the function of a script; its errors become messages."""
    try:
        function()
    except FailedError as failed:
        stop(str(failed))
    except OSError as error:
        stop(f"{error.filename or 'A file'}: {error.strerror or error}")
    except KeyboardInterrupt:
        sys.exit(130)


# ---- what lines of output say --------------------------------------------------------------------


def ninja_position(line: str) -> str | None:
    """Give [12/96] of a line of ninja."""
    match = re.match(r"\s*(\[\d+/\d+\])", line)
    return match and match[1]


def pip_position(line: str) -> str | None:
    """Give what pip works on."""
    match = re.match(r"\s*(?:Collecting|Downloading|Building wheel for) ([\w.-]+)", line)
    if match:
        return re.sub(r"-\d.*", "", match[1])
    return "installing" if line.startswith("Installing collected packages") else None


#: What apt-get says to programs.
_STATUS = re.compile(r"(dl|pm)status:")


def apt_position(line: str) -> str | None:
    """Give the percentage of a status line of apt-get."""
    match = re.match(r"(dl|pm)status:[^:]*(?::\w+)?:(\d+)[.\d]*:", line)
    if match is None:
        return None
    return f"{'downloading' if match[1] == 'dl' else 'installing'} {match[2]} %"

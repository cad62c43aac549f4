# SPDX-License-Identifier: BSD-3-Clause
"""The table of wrong inputs: every one is told, and nothing is lost.

Each entry of ``entries.txt`` is judged by its exit code, by what names the thing and by what names
the remedy, and by the folder it is given in: not a byte of it may have changed, nothing may have
been left behind.
"""

from __future__ import annotations

import re
import shlex
import shutil
from dataclasses import dataclass
from pathlib import Path

import pytest

from support.command_line import CommandLine
from support.wrong_inputs_place import fill, inventory

pytestmark = pytest.mark.watchdog(60)

TABLE = Path(__file__).with_name("entries.txt")
COMMANDS = {
    *("run", "demo", "evaluate", "synthesize", "calibrate", "check-imu", "import-camera"),
    *("settings new", "settings show", "settings check", "settings list"),
    *("vocabulary train", "vocabulary convert", "vocabulary info"),
}
#: What people should never see.
NOISE = ("Traceback", "Errno", "Value error", "object at 0x", ".tmp", "incompatible", "moov atom")
_CLASS_NAME = re.compile(r"\b[A-Z][a-z]+[A-Za-z]*(?:Error|Exception)\b")


@dataclass(frozen=True)
class Entry:
    arguments: str
    thing: str
    remedy: str
    code: int = 2


def entries() -> list[Entry]:
    lines = [line for line in TABLE.read_text().splitlines() if line and not line.startswith("#")]
    rows = [line.split(" | ") for line in lines]
    return [Entry(*row[:3], code=int(row[3]) if len(row) > 3 else 2) for row in rows]


ENTRIES = entries()


@pytest.fixture(scope="module")
def filled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("place")
    fill(place)
    return place


def in_one_line(text: str) -> str:
    """The message without the frame that wrong usage is shown in."""
    lines = (line.strip("│╭╮╰╯─ ") for line in text.splitlines())
    return " ".join(line for line in lines if line)


def test_the_table_is_long_and_covers_every_command() -> None:
    assert len(ENTRIES) >= 150
    assert len({entry.arguments for entry in ENTRIES}) == len(ENTRIES), "none is there twice"
    assert all(entry.thing != entry.remedy for entry in ENTRIES)
    for command in COMMANDS:
        told = [entry for entry in ENTRIES if entry.arguments.startswith(command)]
        assert told, command


@pytest.mark.parametrize("entry", ENTRIES, ids=lambda entry: entry.arguments)
def test_entry(
    filled: Path,
    entry: Entry,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    before = inventory(filled)
    command = CommandLine(monkeypatch, capfd, filled)
    done = command(*shlex.split(entry.arguments))
    told = in_one_line(done.err)
    made = inventory(filled)
    for name in sorted(made.keys() - before.keys(), reverse=True):
        path = filled / name
        path.unlink() if path.is_file() or path.is_symlink() else shutil.rmtree(path)
    assert done.code == entry.code, told
    assert entry.thing in told
    assert entry.remedy in told
    assert not [word for word in NOISE if word in told]
    assert not _CLASS_NAME.search(told), told
    left = {name: content for name, content in made.items() if name in before or entry.code == 2}
    assert left == before, "something was changed or left behind"
    if entry.code == 2 and told.startswith("Error: "):
        assert done.err.count("\n") <= 12

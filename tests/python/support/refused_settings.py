# SPDX-License-Identifier: BSD-3-Clause
"""Settings files that are refused, and what makes them right."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from orbslam2py import Settings
from support.command_line import CommandLine
from support.settings_files import DEPTH, MONO
from support.spoilt_runs import expect_refused

OURS = "".join(f"{key}: {value}\n" for key, value in MONO.items())
OURS_DEPTH = OURS + "".join(f"{key}: {value}\n" for key, value in DEPTH.items())


@dataclass(frozen=True)
class Case:
    """A wrong file, what is said, and the file when the message has been followed.

    Without `right` the message asks for other images, or for numbers that the file does not have.
    """

    text: str
    told: tuple[str, ...]
    right: Callable[[str], str] | None = None
    check: Callable[[Settings], bool] | None = None
    sensor: str = "mono"


def without(pattern: str) -> Callable[[str], str]:
    """Begin the lines with #."""
    return lambda text: re.sub(rf"^(?={pattern})", "# ", text, flags=re.MULTILINE)


def instead(old: str, new: str) -> Callable[[str], str]:
    def change(text: str) -> str:
        assert old in text
        return text.replace(old, new)

    return change


def refuse_and_follow(command: CommandLine, case: Case) -> None:
    """The file is refused, and with what the message says it can be used."""
    Path("a.yaml").write_text(case.text)
    done = command("settings", "check", "a.yaml", "--sensor", case.sensor)
    expect_refused(done, "a.yaml", *case.told)
    assert "remove" not in done.err
    assert "allow" not in done.err.replace("allowed", "")
    assert Path("a.yaml").read_text() == case.text
    if case.right is None:
        return
    followed = case.right(case.text)
    assert followed != case.text
    Path("a.yaml").write_text(followed)
    assert case.check is not None
    assert case.check(Settings.load("a.yaml", case.sensor))
    assert command("settings", "check", "a.yaml", "--sensor", case.sensor).code == 0

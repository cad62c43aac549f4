# SPDX-License-Identifier: BSD-3-Clause
"""The list of subcommands: quick to show, and what it says is what they are."""

import re
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import pytest
import typer
import typer.main

from orbslam2py.cli.app import SUBCOMMANDS, app
from support.command_line import CommandLine


@pytest.mark.parametrize("name", SUBCOMMANDS)
def test_summary_is_the_first_line_of_the_help(name: str) -> None:
    built = SUBCOMMANDS[name].build(name)
    first_paragraph = " ".join(built.help.split("\n\n")[0].split())
    assert SUBCOMMANDS[name].summary == first_paragraph


def test_the_list_loads_none_of_them() -> None:
    code = (
        "import sys; sys.argv = ['orbslam2py', '--help']\n"
        "from orbslam2py.cli import main\n"
        "try:\n    main()\nexcept SystemExit:\n    pass\n"
        "print([m for m in ('numpy', 'cv2', 'matplotlib', 'pydantic') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "Track a camera once around a synthetic corridor" in done.stdout
    assert done.stdout.splitlines()[-1] == "[]"


@pytest.mark.parametrize("name", SUBCOMMANDS)
def test_help_of_each_is_its_own(command: CommandLine, name: str) -> None:
    outcome = command(name, "--help")
    assert outcome.code == 0
    assert f"orbslam2py {name}" in outcome.out
    assert "--install-completion" not in outcome.out


def test_unknown_one_is_refused_with_the_nearest(command: CommandLine) -> None:
    outcome = command("evaluat")
    assert outcome.code == 2
    assert "evaluate" in outcome.err


def test_groups_hold_their_commands() -> None:
    for name, subcommand in SUBCOMMANDS.items():
        target = subcommand.load()
        if isinstance(target, typer.Typer):
            assert target.registered_commands, name


def leaves(command: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """All commands that are no groups, with their names."""
    names = getattr(command, "commands", None)
    if names is None:
        yield path, command
    for name in names or ():
        yield from leaves(command.get_command(None, name), (*path, name))


@pytest.mark.parametrize("columns", [80, 100, 120, 200])
def test_the_help_shows_all_names_of_options_whole(
    command: CommandLine, monkeypatch: pytest.MonkeyPatch, columns: int
) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))
    seen = set()
    for path, built in leaves(typer.main.get_command(app)):
        seen.add(path)
        done = command(*path, "--help")
        assert done.code == 0
        assert "\N{HORIZONTAL ELLIPSIS}" not in done.out, path
        options = (o for one in built.params for o in (*one.opts, *one.secondary_opts))
        names = {option for option in options if option.startswith("-")}
        assert names <= set(re.findall(r"[-\w]+", done.out)), path
        assert "--help" in done.out
    assert {("run",), ("map", "merge"), ("settings", "new")} <= seen


def test_examples_of_the_help_can_be_copied(
    command: CommandLine, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    lines = command("run", "--help").out.splitlines()
    example = "orbslam2py run video.mp4 --sensor mono --settings my.yaml --save office.orbmap"
    assert f"      {example}" in lines
    assert "  Example" in lines

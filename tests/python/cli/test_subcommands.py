# SPDX-License-Identifier: BSD-3-Clause
"""The list of subcommands: quick to show, and what it says is what they are."""

import subprocess
import sys

import pytest
import typer

from orbslam2py.cli.app import SUBCOMMANDS
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

# SPDX-License-Identifier: BSD-3-Clause
"""Assembles the subcommands and turns errors into messages and exit codes.

A subcommand is loaded on demand: most need libraries that load more slowly than a list of commands
should take.
"""

from __future__ import annotations

import importlib
import inspect
import itertools
import shutil
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import typer
import typer.core
import typer.main
from rich.console import Console

import orbslam2py
from orbslam2py.cli.closed_pipe import outlive_the_reader
from orbslam2py.cli.exit_codes import ExitCode
from orbslam2py.cli.interrupts import hold_while_loading
from orbslam2py.cli.messages import print_error, tell_repeated
from orbslam2py.errors import OrbSlamError, SettingsError

#: Columns of a terminal in which boxes have room for all names of options and their help.
_WIDE = 120


@dataclass(frozen=True)
class Subcommand:
    """A command, or a group of commands, that is not loaded yet."""

    module: str
    """In this package."""
    target: str
    """A function, or the `typer.Typer` of a group."""
    summary: str
    """The first line of its help, for the list of commands."""
    command_class: str | None = None
    """A module of this package and its class of commands, for arguments that typer cannot parse."""

    def load(self) -> Callable[..., None] | typer.Typer:
        """The function, or the group."""
        found: Callable[..., None] | typer.Typer = getattr(_module(self.module), self.target)
        return found

    def build(self, name: str) -> Any:
        """Entry point of the command."""
        target = self.load()
        if not isinstance(target, typer.Typer):
            cls = None
            if self.command_class is not None:
                module, _, class_name = self.command_class.partition(".")
                cls = getattr(_module(module), class_name)
            function, target = target, typer.Typer(rich_markup_mode="markdown")
            target.command(name, cls=cls)(function)
        target._add_completion = False  # that of the program is enough
        command = typer.main.get_command(target)
        if shutil.get_terminal_size().columns < _WIDE:
            _without_boxes(command)
        return command


def _without_boxes(command: Any) -> None:
    """Let the help of a command, or of all in a group, be plain text: then no name is cut."""
    commands = getattr(command, "commands", None)
    if commands is not None:  # plain text would cut the summaries in the list of a group
        for one in commands.values():
            _without_boxes(one)
        return
    command.rich_markup_mode = None
    text, title, examples = (command.help or "").partition("**Example**")
    examples = examples.replace("\n\n    ", "\n\n\b\n    ")  # lines to copy are not wrapped
    command.help = inspect.cleandoc(text) + "\n\n" + title.strip("*") + examples


def _module(name: str) -> Any:
    with hold_while_loading():
        return importlib.import_module(f"orbslam2py.cli.{name}")


#: In the order of the help.
SUBCOMMANDS = {
    "run": Subcommand(
        "run",
        "run",
        "Track a recorded sequence, a video or a live source; write trajectory, map and report.",
        "run_arguments.RunCommand",
    ),
    "devices": Subcommand(
        "devices", "devices", "List the cameras that are plugged in, with their modes."
    ),
    "batch": Subcommand(
        "batches.batch",
        "batch",
        "Run many sequences, settings and seeds on all cores or a cluster; write one table.",
    ),
    "benchmark": Subcommand(
        "batches.benchmark",
        "benchmark",
        "Run a data set (TUM RGB-D, KITTI, EuRoC, TUM-VI) beside figures of ORB-SLAM2 and 3.",
    ),
    "demo": Subcommand(
        "demo", "demo", "Track a camera once around a synthetic corridor: needs no data."
    ),
    "synthesize": Subcommand(
        "synthesize",
        "synthesize",
        "Write a synthetic sequence with calibration and exact ground truth.",
    ),
    "view": Subcommand(
        "view",
        "view",
        "Show a finished run in the browser, with a slider for the time, until Ctrl-C.",
    ),
    "evaluate": Subcommand(
        "evaluate",
        "evaluate",
        "Compare a trajectory with ground truth: ATE, RPE and KITTI's segment errors.",
    ),
    "report": Subcommand(
        "report",
        "report",
        "Make the page of a finished run again, from the files in its folder.",
    ),
    "compare": Subcommand(
        "report",
        "compare",
        "Set finished runs side by side: figures, paths, errors and times, in a table and as a "
        "page.",
    ),
    "calibrate": Subcommand(
        "calibrate",
        "calibrate",
        "Calibrate a camera, a stereo pair or a rig with a board; write settings that run takes.",
    ),
    "import-camera": Subcommand(
        "calibrate",
        "import_camera",
        "Turn another program's calibration into a settings file.",
    ),
    "check-imu": Subcommand(
        "check_imu",
        "check",
        "Track the images and compare the IMU with the camera: axes, signs, units, clock, gravity.",
    ),
    "config": Subcommand(
        "config", "show", "List the thresholds of the method, their defaults and what they mean."
    ),
    "settings": Subcommand("settings", "app", "Make, show, check and list settings files."),
    "vocabulary": Subcommand("vocabulary", "app", "Train, convert and inspect vocabularies."),
    "map": Subcommand(
        "maps",
        "app",
        "Look at map files, check, compare, merge, cut, move and refine them, and export them.",
    ),
}


class _Group(typer.core.TyperGroup):
    """Loads a subcommand on demand; leaves class names out of usage errors."""

    def __init__(self, **attributes: Any) -> None:
        super().__init__(**attributes)
        self._built: dict[str, Any] = {}
        for name, subcommand in SUBCOMMANDS.items():
            self.commands[name] = typer.core.TyperCommand(name, help=subcommand.summary)
        self._lists = False

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the arguments, none of which is empty."""
        if not ctx.resilient_parsing:  # as it is for what a shell completes
            refuse_empty(args)
        with hold_while_loading():  # typer loads what converts arguments
            return list(super().parse_args(ctx, args))

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return the subcommand, or for a list of commands only its name and summary."""
        if self._lists or cmd_name not in SUBCOMMANDS:
            return super().get_command(ctx, cmd_name)
        if cmd_name not in self._built:
            self._built[cmd_name] = SUBCOMMANDS[cmd_name].build(cmd_name)
        return self._built[cmd_name]

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Print the help, with the list of commands."""
        self._lists = True
        try:
            super().format_help(ctx, formatter)
        finally:
            self._lists = False

    def invoke(self, ctx: Any) -> Any:
        """Run the subcommand."""
        try:
            return super().invoke(ctx)
        except typer.BadParameter as error:
            error.message = error.message.replace("Value error, ", "")
            raise


app = typer.Typer(
    cls=_Group,
    name="orbslam2py",
    help="Visual SLAM for one camera, a stereo pair or RGB-D: images in, path and map out.",
    no_args_is_help=True,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


#: Options whose value is text that says nothing to the program.
_MAY_BE_EMPTY = ("--note",)


def refuse_empty(arguments: Sequence[str]) -> None:
    """Raise `SettingsError` for an empty argument, which a shell makes of an unset variable.

    As a path it would be the present folder.
    """
    for before, argument in itertools.pairwise(["", *arguments]):
        name, sign, value = argument.partition("=")
        if argument and not (name.startswith("--") and sign and not value):
            continue
        if before in _MAY_BE_EMPTY or name in _MAY_BE_EMPTY:
            continue
        named = name or (f"what follows {before}" if before.startswith("-") else "an argument")
        raise SettingsError(
            f"{named} is empty; give a value, or leave it out (is a variable of the shell not set?)"
        )


def _show_version(value: bool) -> None:
    if value:
        typer.echo(f"orbslam2py {orbslam2py.__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version."),
    ] = False,
) -> None:
    """Visual SLAM for one camera, a stereo pair or RGB-D: images in, path and map out."""


def run_app() -> None:
    """Run the subcommand; expected errors become one message and an exit code."""
    outlive_the_reader()
    try:
        app()
    except (OrbSlamError, OSError) as error:
        from orbslam2py._files import describe_error  # noqa: PLC0415  # already loaded, or slow

        tell_repeated()  # warnings before their consequences
        print_error(Console(stderr=True), "Error", describe_error(error))
        sys.exit(ExitCode.BAD_INPUT)
    finally:
        tell_repeated()

# SPDX-License-Identifier: BSD-3-Clause
"""Assembles the subcommands and turns errors into messages and exit codes."""

from __future__ import annotations

import sys
from typing import Annotated, Any

import typer
import typer.core
from rich.console import Console

from orbslam2py._files import describe_error
from orbslam2py._version import __version__
from orbslam2py.cli import (
    calibrate,
    demo,
    evaluate,
    maps,
    report,
    run,
    settings,
    synthesize,
    view,
    vocabulary,
)
from orbslam2py.cli.batches.batch import batch
from orbslam2py.cli.batches.benchmark import benchmark
from orbslam2py.cli.display import print_error, tell_repeated
from orbslam2py.cli.exit_codes import ExitCode
from orbslam2py.cli.run_arguments import RunCommand
from orbslam2py.errors import OrbSlamError


class _Group(typer.core.TyperGroup):
    """Leaves the names of classes out of messages about wrong usage."""

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


def _show_version(value: bool) -> None:
    if value:
        typer.echo(f"orbslam2py {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version."),
    ] = False,
) -> None:
    """Visual SLAM for one camera, a stereo pair or RGB-D: images in, path and map out."""


app.command("run", cls=RunCommand)(run.run)
app.command("batch")(batch)
app.command("benchmark")(benchmark)
app.command("demo")(demo.demo)
app.command("synthesize")(synthesize.synthesize)
app.command("view")(view.view)
app.command("evaluate")(evaluate.evaluate)
app.command("report")(report.report)
app.command("compare")(report.compare)
app.command("calibrate")(calibrate.calibrate)
app.command("import-camera")(calibrate.import_camera)
app.add_typer(settings.app, name="settings")
app.add_typer(vocabulary.app, name="vocabulary")
app.add_typer(maps.app, name="map")


def run_app() -> None:
    """Run the subcommand; errors a person can act on become one message and an exit code."""
    try:
        app()
    except (OrbSlamError, OSError) as error:
        tell_repeated()  # warnings before what they led to
        print_error(Console(stderr=True), "Error", describe_error(error))
        sys.exit(ExitCode.BAD_INPUT)
    finally:
        tell_repeated()

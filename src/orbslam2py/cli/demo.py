# SPDX-License-Identifier: BSD-3-Clause
"""``orbslam2py demo``: the whole system on a world made on the spot."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path
from typing import Annotated

import typer

from orbslam2py.cli.run_and_show import run_and_show
from orbslam2py.cli.run_options import ForceFlag, NoReportFlag, QuietFlag
from orbslam2py.cli.targets import check_kept
from orbslam2py.cli.viewing import (
    ViewerExit,
    ViewerFlag,
    ViewerHost,
    ViewerOptions,
    ViewerPort,
)
from orbslam2py.cli.watching import RecordOption, VideoOption
from orbslam2py.errors import SettingsError
from orbslam2py.runs.options import RunOptions
from orbslam2py.settings import Sensor
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence

DEFAULT_OUTPUT = Path("runs/demo")


def demo(
    sensor: Annotated[Sensor, typer.Option(help="What delivers the images.")] = Sensor.STEREO,
    frames: Annotated[
        int | None, typer.Option(help="Number of images [one lap and a bit].", min=10)
    ] = None,
    output: Annotated[Path, typer.Option(help="Folder for the results.")] = DEFAULT_OUTPUT,
    no_report: NoReportFlag = False,
    viewer: ViewerFlag = False,
    viewer_port: ViewerPort = None,
    viewer_host: ViewerHost = None,
    viewer_exit: ViewerExit = False,
    video: VideoOption = None,
    record: RecordOption = None,
    force: ForceFlag = False,
    quiet: QuietFlag = False,
) -> None:
    """Track a camera once around a synthetic corridor: needs no data.

    **Example**

        orbslam2py demo --sensor rgbd

        orbslam2py demo --viewer
    """
    check_kept(video, record, force=force)
    look = ViewerOptions(viewer, viewer_port, viewer_host, viewer_exit)
    if sensor is Sensor.RIG:
        raise SettingsError(
            "the demo has no rig: take mono, stereo or rgbd, or make images of a rig with "
            "'orbslam2py synthesize FOLDER --rig SETTINGS' and run them"
        )
    options = SyntheticOptions(world="corridor", sensor=sensor, frames=frames, speed=2.8, noise=2)
    sequence = SyntheticSequence(options)
    code = run_and_show(
        sequence,
        RunOptions(sensor),
        output=output,
        force=force or output == DEFAULT_OUTPUT,  # there, results are an earlier demo's
        report_page=not no_report,
        viewer=look,
        video=video,
        record=record,
        quiet=quiet,
    )
    if not quiet:
        typer.echo(f"Look at {output / 'trajectory.png'}.")
        if not viewer:
            typer.echo(f"To see it while it runs: {own_name()} demo --viewer")
    raise typer.Exit(code)


def own_name() -> str:
    """Return the command that calls this program, also if it is not on the path."""
    own = Path(sys.argv[0])
    if own.name == "__main__.py":
        return f"{_from_here(Path(sys.executable))} -m orbslam2py"
    found = shutil.which("orbslam2py")
    if found is not None or own.name != "orbslam2py":
        return "orbslam2py"
    return str(_from_here(own))


def _from_here(path: Path) -> Path:
    """Return a path for the command line: relative, if it is below the working folder."""
    absolute, here = path.absolute(), Path.cwd()
    return absolute.relative_to(here) if absolute.is_relative_to(here) else path

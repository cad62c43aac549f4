# SPDX-License-Identifier: BSD-3-Clause
"""``orbslam2py view``: a finished run in the viewer."""

from __future__ import annotations

import contextlib
import threading
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from orbslam2py._waiting import wait_for_event
from orbslam2py.cli.messages import log_to
from orbslam2py.cli.viewing import ViewerHost, ViewerPort
from orbslam2py.errors import DatasetError
from orbslam2py.live import open_source
from orbslam2py.runs.feeds import is_sequence


def view(
    folder: Annotated[Path, typer.Argument(help="Folder of the run.", metavar="RUN_FOLDER")] = Path(
        "runs/latest"
    ),
    sequence: Annotated[
        str | None,
        typer.Option(
            help="The sequence, video or folder that was run: its images are shown, too, and its "
            "ground truth.",
            metavar="SEQUENCE",
        ),
    ] = None,
    split: Annotated[
        bool, typer.Option("--split", help="For --sequence: the same as in the run.")
    ] = False,
    viewer_port: ViewerPort = None,
    viewer_host: ViewerHost = None,
) -> None:
    """Show a finished run in the browser, with a slider for the time, until Ctrl-C.

    **Example**

        orbslam2py view runs/06

        orbslam2py view runs/06 --sequence dataset/sequences/06
    """
    from orbslam2py.runs.report_page import read_run  # noqa: PLC0415
    from orbslam2py.viewer.live import announce  # noqa: PLC0415  # slow to load
    from orbslam2py.viewer.replay import Replay  # noqa: PLC0415
    from orbslam2py.viewer.server import LOOPBACK  # noqa: PLC0415

    log_to(Console(stderr=True), quiet=False)
    if split and sequence is None:
        raise DatasetError("--split says what --sequence holds; give it as well")
    run = read_run(folder)
    images = None
    if sequence is not None:
        chosen = str(folder / "settings.yaml")
        opened = open_source(sequence, run.sensor, settings=chosen, split=split)
        if not is_sequence(opened):
            raise DatasetError("--sequence names a camera, whose images are gone; name a recording")
        images = opened
    replay = Replay(run, images, host=viewer_host or LOOPBACK, port=viewer_port)
    try:
        # Ctrl-C counts from the moment that the address is shown.
        with contextlib.suppress(KeyboardInterrupt):
            announce(replay.address, open_browser=True)
            wait_for_event(threading.Event())
    finally:
        replay.stop()

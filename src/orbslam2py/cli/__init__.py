# SPDX-License-Identifier: BSD-3-Clause
"""The command ``orbslam2py``."""

from __future__ import annotations

import os
import sys

from orbslam2py.cli.exit_codes import ExitCode
from orbslam2py.cli.interrupts import EndingSignals, hold_while_loading
from orbslam2py.cli.terminal_encoding import accept_all_letters


def main() -> None:
    """Run the command line; expected errors become one message and an exit code."""
    accept_all_letters()
    with EndingSignals() as ending:
        try:
            _run()
        except KeyboardInterrupt:
            sys.exit(ending.exit_code)
        except SystemExit as end:
            if end.code == ExitCode.INTERRUPTED:
                sys.exit(ending.exit_code)
            raise


def _run() -> None:
    try:
        # FFmpeg writes of broken videos by itself, beside the message.
        os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
        # Loading the libraries takes long enough for a Ctrl-C.
        with hold_while_loading():
            from orbslam2py.cli.app import run_app  # noqa: PLC0415

        run_app()
    except ImportError as error:
        if error.name != "orbslam2py._core":
            raise
        print(error, file=sys.stderr)
        sys.exit(ExitCode.FAILED)


__all__ = ["main"]

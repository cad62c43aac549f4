# SPDX-License-Identifier: BSD-3-Clause
"""Exit codes of the command line."""

from enum import IntEnum


class ExitCode(IntEnum):
    """Exit codes of the program."""

    OK = 0
    FAILED = 1
    """Something failed during the run; the results so far are saved. Two files differ."""
    BAD_INPUT = 2
    """Bad input or usage; nothing was run."""
    NOTHING_TRACKED = 3
    HUNG_UP = 129
    """The terminal was closed (SIGHUP); the results so far are saved."""
    INTERRUPTED = 130
    """Ctrl-C; the results so far are saved."""
    TERMINATED = 143
    """Termination was requested (SIGTERM); the results so far are saved."""

# SPDX-License-Identifier: BSD-3-Clause
"""Exit codes of the command line."""

from enum import IntEnum


class ExitCode(IntEnum):
    """Exit codes of the program."""

    OK = 0
    FAILED = 1
    """Something broke in the middle; what was done until then is saved. Two files differ."""
    BAD_INPUT = 2
    """Bad input or usage; nothing was run."""
    NOTHING_TRACKED = 3
    HUNG_UP = 129
    """The terminal was closed (SIGHUP); what was done until then is saved."""
    INTERRUPTED = 130
    """Ctrl-C; what was done until then is saved."""
    TERMINATED = 143
    """Asked to end (SIGTERM); what was done until then is saved."""

# SPDX-License-Identifier: BSD-3-Clause
"""``orbslam2py map``: commands for map files."""

from orbslam2py.cli.maps.commands import app

__all__ = ["app"]

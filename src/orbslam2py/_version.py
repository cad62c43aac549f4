# SPDX-License-Identifier: BSD-3-Clause
"""The installed version."""

from importlib.metadata import version

#: As in pyproject.toml.
__version__ = version("orbslam2py")

# SPDX-License-Identifier: BSD-3-Clause
"""The method: tracking, local mapping, loop closing, their threads, and the system around them.

Users import it from the package itself: ``orbslam2py.System``.
"""

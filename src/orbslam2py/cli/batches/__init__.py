# SPDX-License-Identifier: BSD-3-Clause
"""``orbslam2py batch`` and ``benchmark``: many runs, one table."""

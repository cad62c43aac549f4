# SPDX-License-Identifier: BSD-3-Clause
"""The measurements, and their references.

Programs are started as ``python -m benchmarks.FOLDER.NAME`` in the checkout; all have ``--help``.
"""

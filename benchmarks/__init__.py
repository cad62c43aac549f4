# SPDX-License-Identifier: BSD-3-Clause
"""What is measured, and beside what.

Programs are started as ``python -m benchmarks.FOLDER.NAME`` in the checkout; all have ``--help``.
"""

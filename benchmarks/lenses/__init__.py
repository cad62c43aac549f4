# SPDX-License-Identifier: BSD-3-Clause
"""Lenses, raw pairs and rigs on synthetic sequences: ``python -m benchmarks.lenses``."""

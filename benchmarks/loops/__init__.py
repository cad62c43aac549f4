# SPDX-License-Identifier: BSD-3-Clause
"""Closing loops: how well, at what cost, and tracking meanwhile."""

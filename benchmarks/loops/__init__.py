# SPDX-License-Identifier: BSD-3-Clause
"""Closing loops: quality, cost, and tracking during corrections."""

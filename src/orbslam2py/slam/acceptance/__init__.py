# SPDX-License-Identifier: BSD-3-Clause
"""Validation of pose estimates, and search of alternative hypotheses.

``docs/method/tracking.md#evidence``.
"""

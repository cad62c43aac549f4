# SPDX-License-Identifier: BSD-3-Clause
"""Evidence before belief: what speaks for a pose, and where else it is looked for.

``docs/method/tracking.md#evidence``.
"""

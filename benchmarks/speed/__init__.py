# SPDX-License-Identifier: BSD-3-Clause
"""How fast: single steps, vocabularies, whole sequences, Python's share, locks."""

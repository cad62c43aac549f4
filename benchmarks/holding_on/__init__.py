# SPDX-License-Identifier: BSD-3-Clause
"""How well tracking holds on to motions that are hard to follow."""

# SPDX-License-Identifier: BSD-3-Clause
"""Maps cut, moved, and laid into other worlds."""

# SPDX-License-Identifier: BSD-3-Clause
"""What the programs share: the yardstick, the original's figures, runs, tables, arguments."""

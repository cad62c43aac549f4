# SPDX-License-Identifier: BSD-3-Clause
"""How a single camera's maps begin on recorded sequences: see `benchmarks.starts.__main__`."""

# SPDX-License-Identifier: BSD-3-Clause
"""The effect of each mechanism beyond the published method: see `benchmarks.ablation.__main__`."""

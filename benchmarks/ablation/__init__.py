# SPDX-License-Identifier: BSD-3-Clause
"""What each mechanism beyond the published method gives: see `benchmarks.ablation.__main__`."""

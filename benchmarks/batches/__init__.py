# SPDX-License-Identifier: BSD-3-Clause
"""Many runs: how much faster several workers are, what the engine costs, where its limits are."""

# SPDX-License-Identifier: BSD-3-Clause
"""Several maps: whether those that can meet do, and those that only look alike do not."""

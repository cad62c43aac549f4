# SPDX-License-Identifier: BSD-3-Clause
"""How exact: trajectories, relocalization, place recognition."""

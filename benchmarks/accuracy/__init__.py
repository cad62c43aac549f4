# SPDX-License-Identifier: BSD-3-Clause
"""How exact: trajectories, poses found again, places told apart."""

# SPDX-License-Identifier: BSD-3-Clause
"""Maps for other programs: COLMAP, nerfstudio, pose graphs, point clouds, trajectories."""

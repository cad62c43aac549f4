# SPDX-License-Identifier: BSD-3-Clause
"""What a person watches: the image with its points, the map, what becomes of both over time."""

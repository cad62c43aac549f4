# SPDX-License-Identifier: BSD-3-Clause
"""The map outside of a running system: plain copies of it."""

from orbslam2py.maps.snapshot import MapSnapshot

__all__ = ["MapSnapshot"]

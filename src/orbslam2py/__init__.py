# SPDX-License-Identifier: BSD-3-Clause
"""Visual SLAM for Python.

Feed images of one camera, a stereo pair or an RGB-D camera, get the camera's path and a map:

>>> import orbslam2py
>>> with orbslam2py.System("tum1", "rgbd") as slam:  # doctest: +SKIP
...     for image, depth, timestamp in camera:
...         record = slam.track_rgbd(image, depth, timestamp)

Poses are named by frames: ``T_cw`` maps world to camera, ``T_wc`` camera to world. Cameras look
along +z, x points right, y down. Lengths are metres, times seconds, angles radians. One
camera alone cannot see metres: its unit of length is the median depth of the first view.
"""

from typing import Any

import lazy_loader

# The names stand in __init__.pyi and are loaded on first use: the C++ extension imports
# orbslam2py.errors while it is being loaded, and the command line wants to be in charge before
# libraries are loaded.
_public_name, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> Any:
    """Give a public name, or the compiled part."""
    if name == "_core":
        from orbslam2py._extension import load  # noqa: PLC0415

        return load()
    return _public_name(name)

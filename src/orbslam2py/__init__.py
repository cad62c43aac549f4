# SPDX-License-Identifier: BSD-3-Clause
"""ORB-SLAM2 for Python people.

Feed images of one camera, a stereo pair or an RGB-D camera, get the camera's path and a map:

>>> import orbslam2py
>>> with orbslam2py.System("tum1", "rgbd") as slam:  # doctest: +SKIP
...     for image, depth, timestamp in camera:
...         record = slam.track_rgbd(image, depth, timestamp)

Poses are named by frames: ``T_cw`` maps world to camera, ``T_wc`` camera to world. Cameras look
along +z, x points right, y down. Lengths are metres, times seconds, angles radians. One
camera alone cannot see metres: its unit of length is the median depth of the first view.
"""

import lazy_loader

# The names stand in __init__.pyi and are loaded on first use: the C++ extension imports
# orbslam2py.errors while it is being loaded, and the command line wants to be in charge before
# libraries are loaded.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

# SPDX-License-Identifier: BSD-3-Clause
"""Use the package and another OpenCV in one process: both must do as they do alone.

``beside_opencv.py cv2|orbslam2py FOLDER``: which is loaded first, and where cv2 must come from.
"""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

import numpy as np

first, folder = sys.argv[1], Path(sys.argv[2])
names = ["cv2", "orbslam2py._core"]
cv2, _core = (
    # The statement would be put in alphabetical order by tools that tidy imports.
    {name: importlib.import_module(name) for name in sorted(names, key=lambda n: first not in n)}[n]
    for n in names
)
assert Path(cv2.__file__).is_relative_to(folder), cv2.__file__

image = np.random.default_rng(0).integers(0, 256, (240, 320, 3), dtype=np.uint8)
grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
grey = cv2.GaussianBlur(cv2.resize(grey, (640, 480)), (7, 7), 2)
results = []
for _ in range(3):
    extracted = _core.OrbExtractor(_core.OrbOptions(n_features=500)).extract(grey)
    results.append((extracted.keypoints.tobytes(), extracted.descriptors.tobytes()))
    keypoints, descriptors = cv2.ORB_create(500).detectAndCompute(grey, None)
    assert len(keypoints) > 100, "cv2 found nothing"
    try:  # an exception of either's C++ is caught by its own
        cv2.resize(grey, (0, 0))
    except cv2.error:
        pass
    else:
        raise AssertionError("cv2 accepted a wrong size")
assert len(set(results)) == 1, "the same image gave different keypoints"
print(
    f"cv2 {cv2.__version__}, {first} first: {len(extracted.keypoints)} keypoints, {len(keypoints)}"
)

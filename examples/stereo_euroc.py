# SPDX-License-Identifier: BSD-3-Clause
"""Stereo SLAM on a EuRoC sequence: every pose with its uncertainty.

The loader rectifies the raw images with the calibration that comes with the sequence.

python examples/stereo_euroc.py V1_01_easy
"""

import sys

import numpy as np

import orbslam2py as orb

if len(sys.argv) != 2:
    sys.exit("usage: python examples/stereo_euroc.py V1_01_easy")

sequence = orb.open_sequence(sys.argv[1], "stereo")

with orb.System(sequence.settings, "stereo", wait_for_mapping=True) as slam:
    for frame in sequence:
        images, timestamp = frame.images, frame.timestamp
        record = slam.track_stereo(images.image, images.right, timestamp)
        if record.T_wc is None or record.covariance is None:
            print(f"{timestamp:.3f}  {record.state.name}: {record.reason}")
            continue
        position = np.round(record.T_wc[:3, 3], 3)
        millimetres = 1e3 * np.sqrt(np.diag(record.covariance)[3:])
        print(f"{timestamp:.3f}  {position} m  +- {np.round(millimetres, 1)} mm")

points = slam.map_snapshot().point_positions
print(f"{len(points)} map points, {slam.n_keyframes} keyframes")

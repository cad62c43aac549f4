# SPDX-License-Identifier: BSD-3-Clause
"""SLAM with the left camera of a EuRoC sequence: what each image was matched to.

The lens is undistorted on the way; pixels below are undistorted ones.

python examples/mono_euroc.py V1_01_easy
"""

import sys

import orbslam2py as orb

if len(sys.argv) != 2:
    sys.exit("usage: python examples/mono_euroc.py V1_01_easy")

sequence = orb.open_sequence(sys.argv[1], "mono")

with orb.System(sequence.settings, "mono", wait_for_mapping=True) as slam:
    for frame in sequence:
        timestamp = frame.timestamp
        record = slam.track_monocular(frame.images.image, timestamp, details=True)
        if record.T_wc is None or record.features is None:
            print(f"{timestamp:.3f}  {record.state.name}: {record.reason}")
            continue
        matched = record.features.keypoints[record.features.inliers]
        x, y = matched.mean(axis=0)
        print(f"{timestamp:.3f}  {len(matched)} map points in view, around ({x:.0f}, {y:.0f})")

points = slam.map_snapshot().point_positions
print(f"{len(points)} map points, {slam.n_keyframes} keyframes")

# SPDX-License-Identifier: BSD-3-Clause
"""Stereo SLAM on a sequence of the KITTI odometry benchmark, compared with its ground truth.

python examples/stereo_kitti.py dataset/sequences/06
"""

import sys

import orbslam2py as orb
from orbslam2py.evaluation import evaluate_trajectory
from orbslam2py.trajectory import write_kitti

if len(sys.argv) != 2:
    sys.exit("usage: python examples/stereo_kitti.py dataset/sequences/06")

sequence = orb.open_sequence(sys.argv[1], orb.Sensor.STEREO)

with orb.System(sequence.settings, "stereo", wait_for_mapping=True) as slam:
    for i, timestamp in enumerate(sequence.timestamps):
        images = sequence.load(i)
        record = slam.track_stereo(images.image, images.right, timestamp)
        print(
            f"\r{i + 1}/{len(sequence)}  {record.state.name}  {record.n_inliers} inliers ", end=""
        )
print()

trajectory = slam.trajectory()
write_kitti("trajectory_kitti.txt", trajectory, len(sequence))
truth = sequence.ground_truth()
if truth is not None:
    result = evaluate_trajectory(trajectory, truth)
    if result.ate is not None:
        print(f"absolute error {result.ate.rmse:.3f} m")
    if result.t_rel_percent is not None:  # needs at least 100 m
        print(f"drift over 100 to 800 m: {result.t_rel_percent:.2f} %")

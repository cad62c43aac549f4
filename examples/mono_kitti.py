# SPDX-License-Identifier: BSD-3-Clause
"""SLAM with the left camera of a KITTI sequence; the ground truth gives the scale.

python examples/mono_kitti.py dataset/sequences/06
"""

import sys

import orbslam2py as orb
from orbslam2py.evaluation import Alignment, evaluate_trajectory

if len(sys.argv) != 2:
    sys.exit("usage: python examples/mono_kitti.py dataset/sequences/06")

sequence = orb.open_sequence(sys.argv[1], orb.Sensor.MONOCULAR)

with orb.System(sequence.settings, "mono", wait_for_mapping=True) as slam:
    for i, timestamp in enumerate(sequence.timestamps):
        record = slam.track_monocular(sequence.load(i).image, timestamp)
        said = record.reason or f"{record.n_inliers} inliers"
        print(f"{i + 1}/{len(sequence)}  {record.state.name}  {said}")

trajectory = slam.trajectory()
truth = sequence.ground_truth()
if truth is not None:
    # One camera sees no metres: rotation, translation and scale are fitted.
    result = evaluate_trajectory(trajectory.select(~trajectory.lost), truth, Alignment.SIM3)
    if result.ate is not None:
        print(f"absolute error {result.ate.rmse:.3f} m")
    print(f"one unit is {result.transform.scale:.2f} m")

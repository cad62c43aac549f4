# SPDX-License-Identifier: BSD-3-Clause
"""SLAM with a single camera on the colour images of a TUM RGB-D sequence.

python examples/mono_tum.py rgbd_dataset_freiburg1_desk
"""

import sys

import orbslam2py as orb
from orbslam2py.trajectory import write_tum

if len(sys.argv) != 2:
    sys.exit("usage: python examples/mono_tum.py rgbd_dataset_freiburg1_desk")

sequence = orb.open_sequence(sys.argv[1], orb.Sensor.MONOCULAR)

with orb.System(sequence.settings, "mono", wait_for_mapping=True) as slam:
    for i, timestamp in enumerate(sequence.timestamps):
        record = slam.track_monocular(sequence.load(i).image, timestamp)
        if record.T_wc is None:  # at first: until two views with enough parallax are there
            print(f"{timestamp:.3f}  {record.state.name}: {record.reason}")
        elif record.is_keyframe:
            x, y, z = record.T_wc[:3, 3]
            print(f"{timestamp:.3f}  keyframe at ({x:.2f}, {y:.2f}, {z:.2f}) units")

write_tum("trajectory.txt", slam.trajectory())
print(f"{slam.n_keyframes} keyframes, {slam.n_map_points} points; poses are in trajectory.txt")

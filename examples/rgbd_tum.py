# SPDX-License-Identifier: BSD-3-Clause
"""RGB-D SLAM on a sequence of the TUM RGB-D benchmark.

python examples/rgbd_tum.py rgbd_dataset_freiburg1_desk
"""

import sys

import orbslam2py as orb
from orbslam2py.trajectory import write_tum

if len(sys.argv) != 2:
    sys.exit("usage: python examples/rgbd_tum.py rgbd_dataset_freiburg1_desk")

sequence = orb.open_sequence(sys.argv[1], "rgbd")

with orb.System(sequence.settings, "rgbd", wait_for_mapping=True) as slam:
    for frame in sequence:
        images, timestamp = frame.images, frame.timestamp
        record = slam.track_rgbd(images.image, images.depth, timestamp)
        if record.T_wc is None:
            print(f"{timestamp:.3f}  {record.state.name}: {record.reason}")
        elif record.is_keyframe:
            x, y, z = record.T_wc[:3, 3]
            print(f"{timestamp:.3f}  keyframe at ({x:.2f}, {y:.2f}, {z:.2f}) m")

write_tum("trajectory.txt", slam.trajectory())
print(f"{slam.n_keyframes} keyframes, {slam.n_map_points} points; poses are in trajectory.txt")

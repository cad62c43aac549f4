# SPDX-License-Identifier: BSD-3-Clause
"""SLAM with a video and the settings file of its camera.

`orbslam2py calibrate` writes a settings file from pictures of a chessboard.

python examples/mono_video.py video.mp4 my_camera.yaml
"""

import sys

import numpy as np

import orbslam2py as orb
from orbslam2py.datasets import VideoSequence

if len(sys.argv) != 3:
    sys.exit("usage: python examples/mono_video.py video.mp4 my_camera.yaml")

video = VideoSequence(sys.argv[1], settings=sys.argv[2])

with orb.System(video.settings, "mono", wait_for_mapping=True) as slam:
    said = None
    for i, timestamp in enumerate(video.timestamps):
        record = slam.track_monocular(video.load(i).image, timestamp)
        if record.reason != said:
            said = record.reason
            print(f"{timestamp:.2f} s  {record.state.name}  {said}")

trajectory = slam.trajectory()
way = np.linalg.norm(np.diff(trajectory.positions, axis=0), axis=1).sum()
print(f"{len(trajectory)} poses over {way:.1f} units, {slam.n_map_points} points")

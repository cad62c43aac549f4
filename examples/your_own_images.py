# SPDX-License-Identifier: BSD-3-Clause
"""Stereo SLAM on NumPy arrays with your own calibration.

The images are rendered here, so this runs without any data:

python examples/your_own_images.py
"""

import numpy as np

import orbslam2py as orb
from orbslam2py.settings import CameraSettings, DepthSettings, OrbSettings, Settings
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence

camera = SyntheticSequence(SyntheticOptions(world="corridor", sensor="stereo", frames=100))

# What you know about your camera: focal length and centre [pixels], baseline times focal length.
settings = Settings(
    sensor=orb.Sensor.STEREO,
    camera=CameraSettings(
        fx=camera.camera.fx,
        fy=camera.camera.fy,
        cx=camera.camera.cx,
        cy=camera.camera.cy,
        fps=20,
        bf=camera.baseline * camera.camera.fx,
    ),
    orb=OrbSettings(n_features=1200),
    depth=DepthSettings(close_factor=40),
)

with orb.System(settings, "stereo") as slam:
    for i in range(len(camera)):
        images = camera.load(i)  # uint8 arrays of shape (height, width)
        record = slam.track_stereo(images.image, images.right, timestamp=i / 20)
    print(f"{record.state.name}: the camera is at {np.round(record.T_wc[:3, 3], 2)} m")

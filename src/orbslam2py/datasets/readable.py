# SPDX-License-Identifier: BSD-3-Clause
"""The images and IMU samples that can be read, with examples; the documentation is made of it."""

from __future__ import annotations

from dataclasses import dataclass

from orbslam2py.datasets.base import Layout


@dataclass(frozen=True)
class ReadableLayout:
    """A layout of images on disk.

    Attributes
    ----------
    name
        Its name, for the message.
    sensors
        Sensors that it can have images for.
    description
        How it is recognised, and its special features.
    example
        Example of its files or lines.
    layouts
        Names of these layouts in reports.
    """

    name: str
    sensors: str
    description: str
    example: str
    layouts: tuple[Layout, ...] = ()


READABLE_LAYOUTS = (
    ReadableLayout(
        "TUM RGB-D",
        "mono, rgbd",
        "`rgb.txt`, and `depth.txt` or `associations.txt`: lines of time stamp and path.",
        "rgb.txt: 1305031102.175304 rgb/1305031102.175304.png",
        (Layout.TUM,),
    ),
    ReadableLayout(
        "KITTI odometry",
        "mono, stereo",
        "`times.txt`, `calib.txt` and numbered images; grey (0, 1) or colour (2, 3).",
        "image_0/000000.png  image_1/000000.png  times.txt  calib.txt",
        (Layout.KITTI,),
    ),
    ReadableLayout(
        "KITTI raw",
        "mono, stereo",
        "An unpacked drive, with the calibration in the folder of its day.",
        "2011_09_26/2011_09_26_drive_0001_sync/image_00/data  2011_09_26/calib_cam_to_cam.txt",
        (Layout.KITTI_RAW,),
    ),
    ReadableLayout(
        "EuRoC",
        "mono, stereo",
        "`mav0/cam0` and `cam1` with `data.csv` and `sensor.yaml`; TUM-VI as well.",
        "mav0/cam0/data/1403636579763555584.png  mav0/cam0/data.csv  mav0/cam0/sensor.yaml",
        (Layout.EUROC,),
    ),
    ReadableLayout(
        "ICL-NUIM",
        "mono, rgbd",
        "The TUM-compatible form, with its negative focal length.",
        "associations.txt  rgb/0.png  depth/0.png",
        (Layout.ICL_NUIM,),
    ),
    ReadableLayout(
        "7-Scenes",
        "mono, rgbd",
        "Colour, depth and pose files of one number.",
        "frame-000000.color.png  frame-000000.depth.png  frame-000000.pose.txt",
        (Layout.SEVEN_SCENES,),
    ),
    ReadableLayout(
        "Bonn RGB-D dynamic",
        "mono, rgbd",
        "As TUM RGB-D, recognised by its folder's name.",
        "rgbd_bonn_balloon/rgb.txt  rgbd_bonn_balloon/depth.txt",
        (Layout.BONN,),
    ),
    ReadableLayout(
        "Replica (NICE-SLAM)",
        "mono, rgbd",
        "Rendered images with the camera in the folder above.",
        "results/frame000000.jpg  results/depth000000.png  traj.txt  ../cam_params.json",
        (Layout.REPLICA,),
    ),
    ReadableLayout(
        "OpenLORIS-Scene",
        "mono, rgbd",
        "Colour with aligned depth, and its sensors' file.",
        "color.txt  aligned_depth.txt  sensors.yaml",
        (Layout.OPENLORIS,),
    ),
    ReadableLayout(
        "bag of ROS 1",
        "mono, stereo, rgbd",
        "A `.bag`, also of the RealSense Viewer; topics are chosen by types and names.",
        "drive.bag with /camera/color/image_raw (sensor_msgs/Image)",
        (Layout.ROSBAG1,),
    ),
    ReadableLayout(
        "bag of ROS 2",
        "mono, stereo, rgbd",
        "A `.db3` with or without `metadata.yaml`, also of the RealSense SDK; or its folder.",
        "recording/metadata.yaml  recording/recording_0.db3",
        (Layout.ROSBAG2,),
    ),
    ReadableLayout(
        "MCAP",
        "mono, stereo, rgbd",
        "A `.mcap` with messages of ROS 1 or ROS 2.",
        "drive.mcap",
        (Layout.MCAP,),
    ),
    ReadableLayout(
        "folder of images",
        "mono",
        "PNG, JPEG and others in the order of their names; times by `--fps`, `--times` or names.",
        "photos/000000.jpg",
    ),
    ReadableLayout(
        "folder of colour and folder of depth",
        "rgbd",
        "Two folders side by side, images paired by name or number.",
        "color/000000.jpg  depth/000000.png",
    ),
    ReadableLayout(
        "pair in two folders, or in one",
        "mono, stereo",
        "Names that differ in left and right, l and r, 0 and 1, 1 and 2, or 2 and 3.",
        "left/0000.png  right/0000.png\nleft_0000.png  right_0000.png",
    ),
    ReadableLayout(
        "images with both views side by side",
        "stereo",
        "Videos, folders and cameras, with `--split`.",
        "orbslam2py run wide.mp4 --sensor stereo --split ...",
    ),
    ReadableLayout("video", "mono", "What OpenCV decodes.", "drive.mp4"),
    ReadableLayout(
        "camera", "mono", "The number of a camera that is plugged in.", "orbslam2py run 0 ..."
    ),
)


@dataclass(frozen=True)
class ReadableImu:
    """Samples of an IMU, or settings of one.

    Attributes
    ----------
    name
        Whose they are.
    description
        One line about the data that are read.
    example
        Files or lines of it.
    """

    name: str
    description: str
    example: str


#: Samples of IMUs.
READABLE_SAMPLES = (
    ReadableImu(
        "EuRoC, TUM-VI",
        "Time in ns, gyro, accelerometer.",
        "mav0/imu0/data.csv: 1403636579758555392,-0.0991,0.1473,0.0272,8.1477,-0.3759,-2.4026",
    ),
    ReadableImu(
        "table beside the images",
        "A header names the columns, with units in brackets; times in s, ms, us or ns.",
        "imu.csv: timestamp [s],gyro_x [deg/s],gyro_y,gyro_z,accel_x [g],accel_y,accel_z",
    ),
    ReadableImu(
        "table beside a video",
        "The same, in `VIDEO.imu.csv` or `imu.csv`; anywhere else with `--imu-samples`.",
        "walk.mp4  walk.imu.csv",
    ),
    ReadableImu(
        "two tables",
        "One of the gyro and one of the accelerometer, as apps of phones write them: "
        "`--imu-samples` twice.",
        "Gyroscope.csv: time,seconds_elapsed,z,y,x",
    ),
    ReadableImu(
        "GoPro",
        "The track GPMF of the MP4 file; axes in the order of `ORIN`.",
        "GX010001.MP4",
    ),
    ReadableImu(
        "KITTI raw",
        "Accelerations and angular rates of `oxts`.",
        "oxts/timestamps.txt  oxts/data/0000000000.txt",
    ),
    ReadableImu(
        "OpenLORIS-Scene",
        "Gyro and accelerometer of the camera.",
        "d400_gyroscope.txt  d400_accelerometer.txt",
    ),
    ReadableImu(
        "bags",
        "The topic of the type Imu, or two of them named gyro and accel.",
        "drive.bag with /imu0 (sensor_msgs/Imu)",
    ),
)

#: Files that describe an IMU.
READABLE_IMU_SETTINGS = (
    ReadableImu(
        "ORB-SLAM3",
        "Noise, rate, and the matrix from camera to IMU; also inside the settings of the camera.",
        "IMU.NoiseGyro: 1.7e-4\nIMU.T_b_c1: !!opencv-matrix",
    ),
    ReadableImu(
        "Kalibr",
        "`imu.yaml` and the camchain with `T_cam_imu` and `timeshift_cam_imu`: two files.",
        "gyroscope_noise_density: 0.0019\ncam0: T_cam_imu: [[0.0, -1.0, 0.0, 0.05], ...]",
    ),
    ReadableImu(
        "EuRoC",
        "`sensor.yaml` of the IMU and of the camera: two files, or their folder.",
        "mav0/imu0/sensor.yaml  mav0/cam0/sensor.yaml",
    ),
    ReadableImu(
        "Basalt",
        "The calibration as JSON.",
        '{"value0": {"T_imu_cam": [{"px": 0.05, "py": 0.0, ...}], "gyro_noise_std": [...]}}',
    ),
)

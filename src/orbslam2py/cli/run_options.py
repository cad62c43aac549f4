# SPDX-License-Identifier: BSD-3-Clause
"""The options of ``orbslam2py run``: input, method, and output."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from orbslam2py.datasets import AccelUnit, GyroUnit
from orbslam2py.settings.sensor import Sensor
from orbslam2py.slam.effort import Effort

# ---- the images ----------------------------------------------------------------------------------
SequenceArgument = Annotated[
    str,
    typer.Argument(
        help="Folder of a TUM RGB-D, KITTI or EuRoC sequence; folder of images, or one that holds "
        "a folder of images and one of depth, or images of a left and a right camera; bag of "
        "ROS 1 or ROS 2 (.bag, .db3, .mcap, or its folder); video file; live source (ends with "
        "Ctrl-C): number of a camera, v4l:0, realsense:SERIAL, oak:ID, rtsp://HOST/PATH, topics of "
        "ROS 2 (ros2: or zenoh:). "
        "'orbslam2py devices' lists connected devices."
    ),
]
SensorOption = Annotated[
    Sensor | None,
    typer.Option(help="Sensor of the images [the richest one that has images]."),
]
SettingsOption = Annotated[
    str | None,
    typer.Option(
        help="Built-in name (tum1, kitti04-12, euroc, ...) or ORB-SLAM YAML file; "
        "chosen automatically if the sequence determines it.",
        metavar="NAME_OR_FILE",
    ),
]
StartOption = Annotated[int, typer.Option(help="First frame.", min=0)]
StrideOption = Annotated[int, typer.Option(help="Use every Nth frame.", min=1)]
MaxFramesOption = Annotated[
    int | None, typer.Option(help="Use at most this number of frames.", min=1)
]
FpsOption = Annotated[
    float | None,
    typer.Option(
        help="Images per second of a folder of images [that of the settings] or a video [its "
        "own time stamps]; for a camera, the rate to request.",
    ),
]
TimesOption = Annotated[
    Path | None,
    typer.Option(
        help="File with a time stamp per image of a folder or video: seconds, milliseconds, "
        "microseconds, nanoseconds or dates (the unit is recognised). With the images' file names "
        "or without (rgb.txt, data.csv); names in the first line say which columns are the time "
        "and the file."
    ),
]
TopicsOption = Annotated[
    str | None,
    typer.Option(
        help="Topics of a bag or a robot: left (or image), right, depth, info, right_info, "
        "depth_info, truth  "
        "[guessed by types and names].",
        metavar="left=/a,right=/b",
    ),
]
SplitFlag = Annotated[
    bool,
    typer.Option(
        "--split",
        help="Each image of a video, folder or camera holds two views side by side: the left half "
        "is the left one of a stereo pair.",
    ),
]
RecordInputOption = Annotated[
    Path | None,
    typer.Option(
        help="Write all images and samples of a live source into this file (.mcap), without loss. "
        "'orbslam2py run FILE' repeats the run.",
    ),
]
MaskOption = Annotated[
    Path | None,
    typer.Option(
        help="Image parts to use: an 8-bit image, 0 = ignore, or a folder with one per image.",
        metavar="FILE_OR_FOLDER",
    ),
]
ImuFlag = Annotated[
    bool | None,
    typer.Option(
        "--imu/--no-imu",
        help="Use the samples of an IMU, or do not [of a recording: if it has samples and settings "
        "of its IMU; of a live source: do not].",
        show_default=False,
    ),
]
ImuSettingsOption = Annotated[
    list[str] | None,
    typer.Option(
        help="IMU settings of ORB-SLAM3, Kalibr, EuRoC or Basalt; twice for two files that "
        "complete each other [those of --settings, or of the recording].",
        metavar="FILE",
    ),
]
ImuNoiseOption = Annotated[
    str | None,
    typer.Option(
        "--imu-noise",
        help="Name of the chip, such as bmi088, if the files do not contain the noise.",
        metavar="CHIP",
    ),
]
GyroUnitOption = Annotated[
    GyroUnit | None,
    typer.Option(help="Unit of the gyro in that table [its header, or rad/s]."),
]
AccelUnitOption = Annotated[
    AccelUnit | None,
    typer.Option(help="Unit of the accelerometer in that table [its header, or m/s^2]."),
]
ImuSamplesOption = Annotated[
    list[Path] | None,
    typer.Option(
        "--imu-samples",
        help="Table with the samples of the IMU: time, gyro x y z, accelerometer x y z; twice for "
        "one of the gyro and one of the accelerometer [those of the recording].",
        metavar="FILE",
    ),
]
RealtimeFlag = Annotated[
    bool,
    typer.Option("--realtime", help="Follow the time stamps; drop frames as a camera would."),
]


# ---- the method ----------------------------------------------------------------------------------
VocabularyOption = Annotated[
    Path | None, typer.Option(help="Vocabulary file; the one of the package if not given.")
]
DeterministicFlag = Annotated[
    bool,
    typer.Option(
        "--deterministic", help="Map in the tracking thread: every run gives the same bytes."
    ),
]
LoopClosingFlag = Annotated[
    bool,
    typer.Option(
        "--loop-closing/--no-loop-closing",
        help="Recognise places seen before and correct the drift.",
    ),
]
FullAdjustmentFlag = Annotated[
    bool,
    typer.Option(
        "--full-adjustment/--no-full-adjustment", help="After a loop, refine the whole map."
    ),
]
FullAdjustmentTimeLimitOption = Annotated[
    float | None,
    typer.Option(
        help="Seconds after which a full adjustment stops and keeps its result so far.",
        metavar="SECONDS",
    ),
]
FinalAdjustmentFlag = Annotated[
    bool,
    typer.Option(
        "--final-adjustment", help="At the end, refine the finished map before it is written."
    ),
]
SeveralMapsFlag = Annotated[
    bool,
    typer.Option(
        "--several-maps/--one-map",
        help="After a long tracking loss, begin another map, and join maps that show the same "
        "place; or wait until the old map is in view again.",
    ),
]
NewMapAfterOption = Annotated[
    float | None,
    typer.Option(
        help="Seconds of tracking loss after which another map begins [2].", metavar="SECONDS"
    ),
]
EffortOption = Annotated[
    Effort,
    typer.Option(
        help="How much work goes into map and path: fast makes fewer keyframes, light finds "
        "features only where patches of known points are not enough (one camera, RGB-D), thorough "
        "matches every frame with the map once more when the map has settled."
    ),
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        help="Change a threshold of the method, such as tracking.map_matches=12; may be given "
        "several times. `orbslam2py config` lists all.",
        metavar="NAME=VALUE",
    ),
]
SeedOption = Annotated[int, typer.Option(help="Seed of all random draws.", min=0)]


# ---- maps of other runs, and for others ----------------------------------------------------------
LoadOption = Annotated[
    Path | None,
    typer.Option(
        help="Begin in a map that was saved before; its settings serve if --settings gives no "
        "others.",
        metavar="FILE",
    ),
]
InitialPoseOption = Annotated[
    str | None,
    typer.Option(
        help="Likely pose of the camera in the loaded map; it is tried first.",
        metavar="X,Y,Z[,QX,QY,QZ,QW]",
    ),
]
AllowOtherSetupFlag = Annotated[
    bool,
    typer.Option(
        "--allow-other-setup",
        help="Load the map although it was made with another camera or vocabulary.",
    ),
]
LocalizeOption = Annotated[
    int | None,
    typer.Option(
        help="Localization mode, in which the map does not change: after N frames; without N from "
        "the first frame on, in a loaded map.",
        min=0,
        metavar="[N]",
    ),
]
SaveOption = Annotated[
    Path | None, typer.Option(help="Save the maps in this file.", metavar="FILE")
]
AutosaveOption = Annotated[
    float | None,
    typer.Option(help="Also save it during the run, at this interval.", metavar="SECONDS"),
]
SaveImagesFlag = Annotated[
    bool,
    typer.Option("--save-images", help="Keep a small grey image of every keyframe in the map."),
]
SavePatchesFlag = Annotated[
    bool,
    typer.Option(
        "--save-patches/--no-save-patches",
        help="Keep the patches that sightings are aligned to in the map, a kilobyte per point.",
    ),
]


# ---- the results ---------------------------------------------------------------------------------
OutputOption = Annotated[
    Path | None, typer.Option(help="Folder for the results [runs/SEQUENCE-TIME].")
]
ForceFlag = Annotated[
    bool,
    typer.Option(
        "--force",
        help="Write into an output folder that is not empty, and remove results of an earlier run "
        "in it; replace a video or recording.",
    ),
]
NoReportFlag = Annotated[
    bool, typer.Option("--no-report", help="Do not write the page report.html.")
]
QuietFlag = Annotated[bool, typer.Option("--quiet", help="Only errors.")]

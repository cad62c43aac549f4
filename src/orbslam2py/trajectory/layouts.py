# SPDX-License-Identifier: BSD-3-Clause
"""The layouts of trajectory files that can be read, with examples."""

from __future__ import annotations

from dataclasses import dataclass

from orbslam2py.trajectory.writers import TrajectoryFormat

_TUM, _KITTI, _EUROC = TrajectoryFormat.TUM, TrajectoryFormat.KITTI, TrajectoryFormat.EUROC


@dataclass(frozen=True)
class TrajectoryLayout:
    """A layout of trajectory files.

    Attributes
    ----------
    name
        Its name, for the message.
    written_by
        Data sets and programs that write it.
    description
        Its special features.
    example
        The first lines of a file; all examples contain the pose 1, 2, 3 with a rotation of 90
        degrees about z.
    file_format
        The format for its reading.
    """

    name: str
    written_by: str
    description: str
    example: str
    file_format: TrajectoryFormat


#: All layouts that `read_trajectory` reads.
TRAJECTORY_LAYOUTS = (
    TrajectoryLayout(
        "TUM",
        "TUM RGB-D, ORB-SLAM2, evo, RTAB-Map (--poses_format 1)",
        "Time in seconds, position, quaternion with w last; separated by blanks.",
        "# timestamp tx ty tz qx qy qz qw\n"
        "1700000000.25 1.0 2.0 3.0 0.0 0.0 0.70710678 0.70710678\n",
        _TUM,
    ),
    TrajectoryLayout(
        "TUM in nanoseconds",
        "ORB-SLAM3",
        "As TUM, with the time in ns; ms and us are read as well.",
        "1700000000250000000 1.0 2.0 3.0 0.0 0.0 0.70710678 0.70710678\n",
        _TUM,
    ),
    TrajectoryLayout(
        "table with a head",
        "pandas, spreadsheets, rostopic echo -p",
        "The names of the columns give their order: time or timestamp; x, tx, px or position.x; "
        "qx, q_x or orientation.x. Further columns are left out. Blanks, tabs, commas or "
        "semicolons separate.",
        "num,t,x,y,z,qx,qy,qz,qw\n0,1700000000.25,1.0,2.0,3.0,0.0,0.0,0.70710678,0.70710678\n",
        _TUM,
    ),
    TrajectoryLayout(
        "TUM with further columns",
        "OpenVINS with covariances, RTAB-Map (--poses_format 11)",
        "Columns after the eighth are ignored. OpenVINS writes JPL's quaternion of the world "
        "in the body; its numbers are those of the usual one of the body in the world.",
        "#timestamp x y z qx qy qz qw id\n"
        "1700000000.25 1.0 2.0 3.0 0.0 0.0 0.70710678 0.70710678 7\n",
        _TUM,
    ),
    TrajectoryLayout(
        "OpenVINS state",
        "OpenVINS (state_estimate.txt)",
        "The quaternion before the position, as its head says.",
        "# timestamp(s) q p v bg ba\n1700000000.25 0.0 0.0 0.70710678 0.70710678 1.0 2.0 3.0 "
        "0.1 0.1 0.1 0.0 0.0 0.0 0.0 0.0 0.0\n",
        _TUM,
    ),
    TrajectoryLayout(
        "number first",
        "trackers with several cameras",
        "A whole number before or after the time.",
        "7 1700000000.25 1.0 2.0 3.0 0.0 0.0 0.70710678 0.70710678\n",
        _TUM,
    ),
    TrajectoryLayout(
        "EuRoC",
        "EuRoC, TUM-VI, Kimera (traj_vio.csv)",
        "Time in ns, position, quaternion with w first; commas separate. Poses of the body.",
        "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],"
        "q_RS_z []\n1700000000250000000,1.0,2.0,3.0,0.70710678,0.0,0.0,0.70710678\n",
        _EUROC,
    ),
    TrajectoryLayout(
        "VINS",
        "VINS-Mono, VINS-Fusion (vio.csv, vins_result_loop.csv)",
        "As EuRoC without a head, with velocities, and with a comma at the end of the line.",
        "1700000000250000000,1.0,2.0,3.0,0.70710678,0.0,0.0,0.70710678,0.5,0.0,0.0,\n",
        _EUROC,
    ),
    TrajectoryLayout(
        "KITTI",
        "KITTI odometry, RTAB-Map (--poses_format 0 and 2)",
        "The upper three rows of a pose, 12 numbers; no time.",
        "0.0 -1.0 0.0 1.0 1.0 0.0 0.0 2.0 0.0 0.0 1.0 3.0\n",
        _KITTI,
    ),
    TrajectoryLayout(
        "4x4 matrices",
        "Replica, ScanNet",
        "A whole pose row by row, 16 numbers; no time.",
        "0.0 -1.0 0.0 1.0 1.0 0.0 0.0 2.0 0.0 0.0 1.0 3.0 0.0 0.0 0.0 1.0\n",
        _KITTI,
    ),
    TrajectoryLayout(
        "time and matrix",
        "own programs",
        "A time before the 12 or 16 numbers of a pose.",
        "1700000000.25 0.0 -1.0 0.0 1.0 1.0 0.0 0.0 2.0 0.0 0.0 1.0 3.0\n",
        _TUM,
    ),
)

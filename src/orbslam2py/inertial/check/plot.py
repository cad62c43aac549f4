# SPDX-License-Identifier: BSD-3-Clause
"""Picture of an IMU beside the path of the camera."""

from __future__ import annotations

from os import PathLike

import numpy as np

from orbslam2py import _palette as palette
from orbslam2py._figures import write_figure
from orbslam2py._palette import hexadecimal
from orbslam2py.inertial.check.report import ImuReport
from orbslam2py.inertial.samples import ImuSamples

_CAMERA = hexadecimal(palette.PAPER_PATH)
_GYRO = hexadecimal(palette.PAPER_LOOP)
_AXES = ("#c1272d", "#2a7f3f", "#2f5fb3")


def draw_imu_check(
    path: str | PathLike[str], report: ImuReport, samples: ImuSamples, *, title: str
) -> None:
    """Draw the rotation rates of camera and gyro, and the force in the world, into a picture.

    Parameters
    ----------
    path
        Where to write; the suffix gives the format, PNG without one.
    report, samples
        What is shown. What could not be compared with the camera is shown as it was read.
    title
        First line above the picture.

    Raises
    ------
    OutputFileError
        If the ending is that of no format of pictures that is known here.
    OSError
        If the file cannot be written.
    """
    # The object interface keeps the process-wide state of pyplot untouched.
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415
    from matplotlib.figure import Figure  # noqa: PLC0415

    figure = Figure(figsize=(10, 9), dpi=100, layout="constrained")
    FigureCanvasAgg(figure)
    verdict = "fits" if report.fits else ", ".join(fault.kind for fault in report.faults)
    figure.suptitle(f"{title}\n{verdict}", fontsize=11, parse_math=False)
    axes = figure.subplots(4, 1, sharex=True)
    start = float(samples.timestamps[0])
    rates = report.rates
    for k, name in enumerate("xyz"):
        if rates is None:
            axes[k].plot(samples.timestamps - start, samples.gyro[:, k], color=_GYRO, lw=0.8)
        else:
            turned = rates.scale * (rates.gyro - rates.bias) @ rates.M.T
            at = rates.at + rates.offset - start
            axes[k].plot(at, rates.camera[:, k], color=_CAMERA, lw=1.2, label="camera")
            axes[k].plot(at, turned[:, k], color=_GYRO, lw=0.8, label="gyro, as it fits best")
            axes[k].legend(loc="upper right", fontsize=8)
        axes[k].set_ylabel(f"rate about {name}\n[rad/s]")
    force, t = samples.accel, samples.timestamps
    label = "accelerometer\n[m/s²]"
    if report.gravity is not None:
        force, t = report.gravity.up, report.gravity.t
        label = "force in the\nworld [m/s²]"
    for k, name in enumerate("xyz"):
        axes[3].plot(t - start, force[:, k], color=_AXES[k], lw=0.7, label=name)
    axes[3].plot(t - start, np.linalg.norm(force, axis=1), color="#555555", lw=0.5, label="length")
    axes[3].set_ylabel(label)
    axes[3].legend(loc="upper right", fontsize=8, ncols=4)
    axes[3].set_xlabel("seconds from the first sample")
    for one in axes:
        one.grid(alpha=0.3)
    write_figure(path, figure)

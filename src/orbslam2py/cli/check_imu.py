# SPDX-License-Identifier: BSD-3-Clause
"""``orbslam2py check-imu``: compares the IMU of a recording with its camera."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape

from orbslam2py._figures import check_picture_name
from orbslam2py.cli.exit_codes import ExitCode
from orbslam2py.cli.imu_arguments import check_units, imu_settings_given, read_tables
from orbslam2py.cli.messages import log_to
from orbslam2py.cli.run_options import (
    AccelUnitOption,
    FpsOption,
    GyroUnitOption,
    ImuNoiseOption,
    ImuSettingsOption,
    QuietFlag,
    SensorOption,
    SequenceArgument,
    SettingsOption,
    TimesOption,
    TopicsOption,
    VocabularyOption,
)
from orbslam2py.cli.targets import check_apart, check_target
from orbslam2py.datasets import (
    FramesInOrder,
    IterableSequence,
    imu_of,
    imu_settings_of,
)
from orbslam2py.errors import DatasetError
from orbslam2py.inertial.check import ImuReport, check_imu, draw_imu_check
from orbslam2py.live import open_source
from orbslam2py.settings import ImuSettings, Sensor
from orbslam2py.slam.system import System
from orbslam2py.trajectory import Trajectory

EXAMPLE = """
**Example**

    orbslam2py check-imu MH_01_easy --sensor mono

    orbslam2py check-imu phone.mp4 --imu-samples imu.csv --gyro-unit deg/s --settings camera.yaml

    orbslam2py check-imu drive --imu-settings camchain-imucam.yaml --imu-settings imu.yaml
"""


def check(
    sequence: SequenceArgument,
    sensor: SensorOption = None,
    settings: SettingsOption = None,
    imu_settings: ImuSettingsOption = None,
    imu_chip: ImuNoiseOption = None,
    imu: Annotated[
        list[Path] | None,
        typer.Option(
            "--imu-samples",
            "--imu",
            help="Table with the samples: time, gyro x y z, accelerometer x y z; twice for one of "
            "the gyro and one of the accelerometer [those of the recording].",
            metavar="FILE",
        ),
    ] = None,
    gyro_unit: GyroUnitOption = None,
    accel_unit: AccelUnitOption = None,
    fps: FpsOption = None,
    times: TimesOption = None,
    topics: TopicsOption = None,
    vocabulary: VocabularyOption = None,
    seconds: Annotated[
        float, typer.Option(help="Length of the recording that is tracked.", min=1.0)
    ] = 60.0,
    reach: Annotated[
        float,
        typer.Option(help="Largest time offset that is tried [s].", min=0.01, max=60.0),
    ] = 0.5,
    plot: Annotated[
        Path | None, typer.Option(help="Picture to write: rates of camera and gyro, gravity.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing picture.")] = False,
    quiet: QuietFlag = False,
) -> None:
    """Track the images and compare the IMU with the camera: axes, signs, units, clock, gravity.

    Exit code 0 if it fits, 1 if a fault was found, 2 if the input is wrong.
    """
    log_to(Console(stderr=True), quiet=quiet)
    check_units(imu, gyro_unit, accel_unit)
    if plot is not None:
        check_picture_name(plot, "--plot")
        check_apart({"--plot": plot}, imu or [])
    check_target(plot, force=force)
    images = open_source(sequence, sensor, settings=settings, fps=fps, times=times, topics=topics)
    if not isinstance(images, FramesInOrder):
        raise DatasetError(
            f"{sequence} is a camera, whose IMU is not read; record it first, and check that"
        )
    given = read_tables(imu, gyro_unit, accel_unit)
    samples = imu_of(images) if given is None else given
    if samples is None:
        raise DatasetError(
            f"{sequence} has no samples of an IMU; give a table with --imu-samples FILE "
            "(time, gyro x y z, accelerometer x y z)"
        )
    believed = _believed(images, settings, imu_settings, imu_chip)
    paths = _tracked(images, vocabulary, seconds)
    report = check_imu(samples, paths, believed, reach=reach)
    if plot is not None:
        draw_imu_check(plot, report, samples, title=f"IMU of {Path(sequence).name}")
    _print(report, believed, plot, quiet=quiet)
    raise typer.Exit(ExitCode.OK if report.fits else ExitCode.FAILED)


check.__doc__ = f"{check.__doc__}\n{EXAMPLE}"


def _believed(
    images: IterableSequence, settings: str | None, files: list[str] | None, chip: str | None
) -> ImuSettings | None:
    """The IMU settings for the camera of the images; None if there are none."""
    found = imu_settings_given(settings, files, chip)
    if found is None:
        found = imu_settings_of(images)
    rectification = images.settings.rectification
    if found is None or images.sensor is not Sensor.STEREO or rectification is None:
        return found
    return found.seen_by(rectification.left.R)


def _tracked(images: IterableSequence, vocabulary: Path | None, seconds: float) -> list[Trajectory]:
    """Paths of the camera in the first part of the recording, one per map."""
    last = float(images.timestamps[0]) + seconds

    system = System(
        images.settings, images.sensor, vocabulary, deterministic=True, loop_closing=False
    )
    with system:
        system.run(itertools.takewhile(lambda frame: frame.timestamp <= last, images))
    return [path for path in system.trajectories() if len(path)]


def _print(
    report: ImuReport, believed: ImuSettings | None, plot: Path | None, *, quiet: bool
) -> None:
    console = Console(highlight=False, soft_wrap=True, markup=True)
    if not quiet:
        for note in report.notes:
            console.print(escape(note))
        if believed is None:
            console.print("no IMU settings are known (--imu-settings): only the best fit is shown")
        for question in report.open_questions:
            console.print(f"[yellow]Not checked:[/] {escape(question)}")
        if plot is not None:
            console.print(f"Look at [bold]{escape(str(plot))}[/]")
    for fault in report.faults:
        console.print(f"[bold red]Fault ({fault.kind}):[/] {escape(fault.text)}")
    if report.fits:
        checked = "" if not report.open_questions else ", within the limits of the check"
        console.print(f"[bold green]The IMU fits{checked}.[/]")

# SPDX-License-Identifier: BSD-3-Clause
"""``orbslam2py calibrate`` and ``orbslam2py import-camera``: settings files for own cameras."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from orbslam2py._figures import check_picture_name
from orbslam2py._files import IMAGE_SUFFIXES
from orbslam2py.calibration import (
    Board,
    BoardViews,
    Calibration,
    CameraFileFormat,
    find_views,
    read_camera_file,
)
from orbslam2py.calibration import calibrate as calibrate_views
from orbslam2py.calibration.plot import draw_residuals
from orbslam2py.cli.messages import log_to
from orbslam2py.cli.synthesize import parse_size
from orbslam2py.cli.targets import check_apart, check_target
from orbslam2py.errors import OutputFileError, SettingsError
from orbslam2py.settings import CameraSettings, OrbSettings, Sensor, settings_for_camera
from orbslam2py.settings.check import warn_of_doubts
from orbslam2py.settings.defaults import ASSUMED_DEPTH_FACTOR
from orbslam2py.settings.pair_views import views_of_pair

Output = Annotated[Path, typer.Option("--output", "-o", help="Settings file to write.")]
Fps = Annotated[
    float | None, typer.Option(help="Frames per second of the camera [that of the video, or 30].")
]
Features = Annotated[
    int | None,
    typer.Option(help="ORB features per image [1000, or 2000 above 0.6 megapixels]."),
]
OutputSensor = Annotated[
    Sensor | None, typer.Option(help="Sensor of the settings [that of the file].")
]
DepthFactor = Annotated[
    float | None,
    typer.Option(help="RGB-D: units of the depth images per metre [1000: millimetres]."),
]
Baseline = Annotated[
    float | None,
    typer.Option(help="Stereo: distance of the cameras [m]. RGB-D: 40 of these are close [0.075]."),
]
Force = Annotated[bool, typer.Option("--force", help="Replace existing files.")]
Quiet = Annotated[bool, typer.Option("--quiet", help="Only errors.")]


def calibrate(
    source: Annotated[
        Path, typer.Argument(help="Video, or folder of images, of a chessboard seen by the camera.")
    ],
    board: Annotated[
        str, typer.Option(metavar="CxR", help="Inner corners of the board, such as 9x6.")
    ],
    square: Annotated[float, typer.Option(help="Side of a square [m].")],
    output: Output,
    fps: Fps = None,
    features: Features = None,
    every: Annotated[
        int | None,
        typer.Option(
            help="Search every Nth image [all of a folder, four per second of a video].",
            min=1,
        ),
    ] = None,
    max_views: Annotated[
        int, typer.Option(help="Most views to use: those that differ most.", min=4)
    ] = 40,
    k3: Annotated[bool, typer.Option("--k3", help="Estimate k3 as well: for wide lenses.")] = False,
    plot: Annotated[
        Path | None, typer.Option(help="Picture of the residuals (.png, .jpg, .svg, .pdf ...).")
    ] = None,
    sensor: Annotated[
        Sensor, typer.Option(help="What the settings are for: mono, or rgbd.")
    ] = Sensor.MONOCULAR,
    depth_factor: DepthFactor = None,
    baseline: Baseline = None,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Calibrate a camera with a chessboard; write a settings file that run takes."""
    if sensor is Sensor.STEREO:
        raise SettingsError(
            "calibrate sees one camera, and a pair needs both together; calibrate it with Kalibr "
            "and give its file to orbslam2py import-camera"
        )
    # What does not go together is refused before the long search.
    a_camera = CameraSettings(1.0, 1.0, 0.0, 0.0, fps=30.0 if fps is None else fps)
    orb = None if features is None else OrbSettings(n_features=features)
    settings_for_camera(a_camera, sensor, baseline=baseline, depth_factor=depth_factor, orb=orb)
    model = Board.parse(board, square)
    images = [path for path in source.glob("*") if _is_image(path)]
    check_apart({"--output": output, "--plot": plot}, [source, *images])
    if plot is not None:
        _check_plot(plot, source)
    for path in (output, plot):
        check_target(path, force=force)
    console = Console(quiet=quiet)
    found = _search(source, model, every, console)
    result = calibrate_views(found, model, max_views=max_views, k3=k3)
    result.save(
        output,
        fps=fps or found.fps or 30.0,
        n_features=features,
        sensor=sensor,
        depth_factor=depth_factor,
        baseline=baseline,
    )
    if plot is not None:
        draw_residuals(plot, result, title=f"Calibration from {source.name}")
    console.print(_table(result, source))
    if sensor is Sensor.RGBD and depth_factor is None:
        console.print(ASSUMED_DEPTH_FACTOR, highlight=False)
    elif sensor is Sensor.RGBD:
        console.print(f"depth images: {depth_factor:g} units per metre", highlight=False)
    for warning in result.warnings():
        console.print(f"[bold yellow]Warning:[/] {escape(warning)}", highlight=False)
    console.print(f"Settings are in [bold]{escape(str(output))}[/]", highlight=False)
    if plot is not None:
        console.print(f"Look at [bold]{escape(str(plot))}[/]", highlight=False)


def import_camera(
    file: Annotated[
        Path,
        typer.Argument(
            help="Calibration file of OpenCV, Kalibr, ROS, COLMAP, KITTI, EuRoC, OAK, ZED and "
            "others (--format lists all)."
        ),
    ],
    output: Output,
    file_format: Annotated[
        CameraFileFormat, typer.Option("--format", help="Who wrote the file.")
    ] = CameraFileFormat.AUTO,
    camera: Annotated[
        int | None,
        typer.Option(
            help="Number of the camera in a file of several; without it, the pair if the file "
            "holds one. With --sensor stereo, the left camera of the pair.",
            min=0,
        ),
    ] = None,
    right: Annotated[
        Path | None,
        typer.Option(help="ROS, EuRoC: the file of the right camera, to get settings for a pair."),
    ] = None,
    size: Annotated[
        str | None,
        typer.Option(
            help="Size of the images, such as 640x480, if the file does not tell it or holds "
            "several (ZED).",
            metavar="WxH",
        ),
    ] = None,
    sensor: OutputSensor = None,
    depth_factor: DepthFactor = None,
    baseline: Baseline = None,
    fps: Annotated[
        float | None, typer.Option(help="Frames per second of the camera [30; KITTI: 10].")
    ] = None,
    features: Features = None,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Turn another program's calibration into a settings file."""
    check_apart({"--output": output}, [file, *([] if right is None else [right])])
    check_target(output, force=force)
    log_to(Console(stderr=True), quiet=quiet)
    settings = read_camera_file(
        file,
        file_format,
        camera=camera,
        right=right,
        size=None if size is None else parse_size(size),
        sensor=sensor,
        baseline=baseline,
        depth_factor=depth_factor,
        fps=fps,
        n_features=features,
    )
    settings.save(output)
    warn_of_doubts(settings, output)
    console = Console(quiet=quiet, highlight=False, soft_wrap=True)
    for line in settings.describe():
        console.print(line, markup=False)
    if settings.rectification is not None:
        console.print(str(views_of_pair(settings.rectification)), markup=False)
    console.print(f"Settings are in [bold]{escape(str(output))}[/]")


def _check_plot(plot: Path, source: Path) -> None:
    check_picture_name(plot, "--plot")
    if _is_image(plot) and plot.resolve().parent == source.resolve():
        raise OutputFileError(
            f"--plot {plot} would lie among the images that are read, and be one of the next "
            f"calibration's; give it another place than {source}"
        )


def _is_image(path: Path) -> bool:
    return path.suffix.lower() in IMAGE_SUFFIXES


def _search(source: Path, board: Board, every: int | None, console: Console) -> BoardViews:
    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("looking for the board", total=None)

        def show(searched: int, seen: int) -> None:
            bar.update(task, description=f"board seen in {seen} of {searched} images")

        return find_views(source, board, every=every, progress=show)


def _table(result: Calibration, source: Path) -> Table:
    table = Table(title=escape(f"{source.name}, board {result.board}"), show_header=False)
    table.add_column(justify="left")
    table.add_column(justify="right")
    nearest, farthest = result.distances
    width, height = result.size
    table.add_row("images searched, with board", f"{result.n_searched}, {result.n_found}")
    table.add_row("views used, left out", f"{len(result.views)}, {len(result.left_out)}")
    table.add_row("image size", f"{width} x {height}")
    table.add_row("image covered", f"{result.coverage:.0%}")
    table.add_row("distance of the board [m]", f"{nearest:.2f} to {farthest:.2f}")
    table.add_row("reprojection error (RMS) [pixels]", f"{result.rms:.3f}")
    table.add_section()
    values = [result.K[0, 0], result.K[1, 1], result.K[0, 2], result.K[1, 2], *result.distortion]
    names = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")
    for i, (name, value, sigma) in enumerate(
        zip(names, values, result.deviations.tolist(), strict=True)
    ):
        digits = 2 if i < 4 else 5
        if value or sigma:
            table.add_row(name, f"{value:.{digits}f} +- {sigma:.{digits}f}")
    return table


EXAMPLE = "{}\n\n**Example**\n\n    orbslam2py {}\n"
calibrate.__doc__ = EXAMPLE.format(
    calibrate.__doc__,
    "calibrate board.mp4 --board 9x6 --square 0.025 --output my.yaml --plot residuals.png",
)
import_camera.__doc__ = EXAMPLE.format(
    import_camera.__doc__, "import-camera camchain.yaml --output my.yaml --fps 20"
)

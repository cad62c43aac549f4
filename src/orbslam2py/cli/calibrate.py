# SPDX-License-Identifier: BSD-3-Clause
"""``orbslam2py calibrate`` and ``orbslam2py import-camera``: settings files for own cameras."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from orbslam2py._figures import check_picture_name
from orbslam2py._files import IMAGE_SUFFIXES
from orbslam2py.calibration import (
    BoardViews,
    CameraFileFormat,
    Target,
    calibrate_rig,
    find_views,
    parse_board,
    read_camera_file,
)
from orbslam2py.calibration import calibrate as calibrate_views
from orbslam2py.calibration.families import wanted_family
from orbslam2py.calibration.plot import draw_residuals
from orbslam2py.calibration.rig_files import check_camchain
from orbslam2py.cli.calibration_results import (
    lines_of_depth,
    print_results,
    write_rig,
)
from orbslam2py.cli.messages import log_to
from orbslam2py.cli.synthesize import parse_size
from orbslam2py.cli.targets import check_apart, check_target
from orbslam2py.errors import OutputFileError, SettingsError
from orbslam2py.settings import CameraSettings, OrbSettings, Sensor, settings_for_camera
from orbslam2py.settings.check import warn_of_doubts
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
    sources: Annotated[
        list[Path],
        typer.Argument(
            metavar="SOURCE",
            help="Video, or folder of images, of a board seen by the camera; one for each camera "
            "of a pair (left, right) or rig.",
        ),
    ],
    board: Annotated[
        str,
        typer.Option(
            metavar="BOARD",
            help="9x6: inner corners of a chessboard. charuco:11x8: squares. aprilgrid:6x6: tags. "
            "Or a target file of Kalibr.",
        ),
    ],
    output: Output,
    square: Annotated[float | None, typer.Option(help="Side of a square, or of a tag [m].")] = None,
    marker: Annotated[float | None, typer.Option(help="ChArUco: side of a marker [m].")] = None,
    dictionary: Annotated[
        str | None, typer.Option(help="ChArUco: dictionary of the markers [4X4_50].")
    ] = None,
    spacing: Annotated[
        float | None,
        typer.Option(help="AprilGrid: gap between two tags by the side of a tag [0.3]."),
    ] = None,
    model: Annotated[
        str | None,
        typer.Option(
            help="Lens model: pinhole, radtan4, radtan5, rational, thin_prism, kannala_brandt, "
            "double_sphere, eucm, mei or fov [that of least cross-validated error]."
        ),
    ] = None,
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
    k3: Annotated[bool, typer.Option("--k3", help="The same as --model radtan5.")] = False,
    plot: Annotated[
        Path | None,
        typer.Option(
            help="Picture of the residuals (.png, .jpg, .svg, .pdf ...); of several cameras one "
            "each."
        ),
    ] = None,
    camchain: Annotated[
        Path | None, typer.Option(help="Several cameras: also write a camchain of Kalibr.")
    ] = None,
    sensor: Annotated[
        Sensor | None,
        typer.Option(
            help="What the settings are for [mono for one source, stereo for two; a rig of more "
            "gives a camchain]."
        ),
    ] = None,
    depth_factor: DepthFactor = None,
    baseline: Baseline = None,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Calibrate a camera, a stereo pair or a rig with a board; write settings that run takes."""
    # What does not go together is refused before the long search.
    for_what = _sensor_of(sources, sensor)
    given = {"--baseline": baseline, "--depth-factor": depth_factor, "--k3": k3 or None}
    if len(sources) == 1:
        _refuse_camchain(camchain)
        a_camera = CameraSettings(1.0, 1.0, 0.0, 0.0, fps=30.0 if fps is None else fps)
        orb = None if features is None else OrbSettings(n_features=features)
        settings_for_camera(
            a_camera, for_what, baseline=baseline, depth_factor=depth_factor, orb=orb
        )
    else:
        _refuse_single(given)
    family = wanted_family(model, k3=k3)
    if camchain is not None or len(sources) > 2:
        check_camchain(family or "radtan4")
    _refuse_twice(sources)
    target = parse_board(board, square, marker=marker, dictionary=dictionary, spacing=spacing)
    images = [path for source in sources for path in source.glob("*") if _is_image(path)]
    check_apart({"--output": output, "--plot": plot, "--camchain": camchain}, [*sources, *images])
    plots = _plots_of(plot, len(sources))
    for picture, source in zip(plots, sources, strict=False):
        _check_plot(picture, source)
    for target_file in (output, camchain, *plots):
        check_target(target_file, force=force)
    console = Console(quiet=quiet)
    found = [_search(source, target, every, console) for source in sources]
    rate = fps or found[0].fps or 30.0
    if len(sources) == 1:
        result = calibrate_views(found[0], target, max_views=max_views, model=family)
        result.save(
            output,
            fps=rate,
            n_features=features,
            sensor=for_what,
            depth_factor=depth_factor,
            baseline=baseline,
        )
        cameras, lines = [result], [*lines_of_depth(for_what, depth_factor)]
        warnings = result.warnings()
    else:
        rig = calibrate_rig(found, target, max_views=max_views, model=family)
        cameras = list(rig.cameras)
        lines, warnings = write_rig(rig, sources, output, camchain, fps=rate, n_features=features)
    for path, one, source in zip(plots, cameras, sources, strict=False):
        draw_residuals(path, one, title=f"Calibration from {source.name}")
    print_results(console, cameras, sources, lines, warnings)
    what = "Settings are" if len(sources) <= 2 else "The camchain is"
    console.print(f"{what} in [bold]{escape(str(output))}[/]", highlight=False)
    for path in plots:
        console.print(f"Look at [bold]{escape(str(path))}[/]", highlight=False)


def _sensor_of(sources: list[Path], sensor: Sensor | None) -> Sensor:
    """The sensor that the sources are for."""
    if sensor is None:
        return Sensor.MONOCULAR if len(sources) == 1 else Sensor.STEREO
    if sensor is Sensor.STEREO and len(sources) == 1:
        raise SettingsError(
            f"--sensor stereo needs the images of both cameras, and there is only {sources[0]}; "
            "give two folders or videos: the left one, then the right one"
        )
    if sensor is not Sensor.STEREO and len(sources) > 1:
        raise SettingsError(
            f"--sensor {sensor} is one camera, and {len(sources)} sources are given; give one of "
            "them, or leave --sensor out to calibrate them together"
        )
    return sensor


def _refuse_twice(sources: list[Path]) -> None:
    seen: set[Path] = set()
    for source in sources:
        if source.resolve() in seen:
            raise SettingsError(
                f"{source} is given twice; give the folder or video of each camera once"
            )
        seen.add(source.resolve())


def _refuse_camchain(camchain: Path | None) -> None:
    if camchain is not None:
        raise SettingsError("--camchain goes with two sources or more; leave it out for one camera")


def _refuse_single(given: Mapping[str, object]) -> None:
    for option, value in given.items():
        if value is not None:
            raise SettingsError(
                f"{option} goes with one camera, and several sources are given; leave it out: the "
                "distances of the cameras are calibrated"
            )


def _plots_of(plot: Path | None, n: int) -> list[Path]:
    """A picture per camera: ``residuals.png``, or ``residuals_cam0.png`` and so on."""
    if plot is None:
        return []
    if n == 1:
        return [plot]
    return [plot.with_stem(f"{plot.stem}_cam{number}") for number in range(n)]


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
            help="Size of the images, such as 640x480, if the file does not contain it or holds "
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


def _search(source: Path, board: Target, every: int | None, console: Console) -> BoardViews:
    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("looking for the board", total=None)

        def show(searched: int, seen: int) -> None:
            bar.update(task, description=f"board seen in {seen} of {searched} images")

        return find_views(source, board, every=every, progress=show)


EXAMPLE = "{}\n\n**Example**\n\n    orbslam2py {}\n"
calibrate.__doc__ = EXAMPLE.format(
    calibrate.__doc__,
    "calibrate board.mp4 --board 9x6 --square 0.025 --output my.yaml --plot residuals.png",
)
import_camera.__doc__ = EXAMPLE.format(
    import_camera.__doc__, "import-camera camchain.yaml --output my.yaml --fps 20"
)

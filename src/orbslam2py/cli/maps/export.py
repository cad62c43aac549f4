# SPDX-License-Identifier: BSD-3-Clause
"""``orbslam2py map export``: maps for other programs."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import Annotated, Any

import cv2
import numpy as np
import typer
import typer.core
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

from orbslam2py._arrays import ByteArray
from orbslam2py.cli.calibrate import Force, Quiet
from orbslam2py.cli.maps.edits import MapNumber
from orbslam2py.cli.maps.images import open_images
from orbslam2py.cli.messages import log_to
from orbslam2py.cli.targets import check_apart, check_target
from orbslam2py.errors import DatasetError
from orbslam2py.maps import (
    ImageOfKeyframe,
    SavedMap,
    export_colmap,
    export_g2o,
    export_nerfstudio,
    export_points,
    export_trajectory,
    images_of,
    keyframe_path,
    load_map,
    with_colours,
)
from orbslam2py.maps.edits.parts import take_map
from orbslam2py.maps.exports.pinhole_views import checked_field
from orbslam2py.trajectory import Trajectory


class ExportFormat(str, Enum):
    """Formats for the export of a map."""

    COLMAP = "colmap"
    COLMAP_TEXT = "colmap-text"
    NERFSTUDIO = "nerfstudio"
    PLY = "ply"
    PCD = "pcd"
    G2O = "g2o"
    TUM = "tum"
    KITTI = "kitti"
    EUROC = "euroc"

    def __str__(self) -> str:
        return self.value


_FOLDERS = (ExportFormat.COLMAP, ExportFormat.COLMAP_TEXT, ExportFormat.NERFSTUDIO)
_POINTS = (ExportFormat.PLY, ExportFormat.PCD)
_PATHS = (ExportFormat.TUM, ExportFormat.KITTI, ExportFormat.EUROC)


class ExportCommand(typer.core.TyperCommand):
    """Tells users that the format is an argument and no option."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Refuse ``--format``, which other commands have."""
        if any(argument.split("=")[0] == "--format" for argument in args):
            raise DatasetError(
                "map export has no --format; the format comes first: orbslam2py map export ply "
                "FILE OUTPUT"
            )
        return super().parse_args(ctx, args)


def export(
    file_format: Annotated[
        ExportFormat,
        typer.Argument(
            metavar="FORMAT",
            help="colmap, colmap-text or nerfstudio (a folder); ply or pcd (points); g2o (graph of "
            "the keyframes); tum, kitti or euroc (path of the keyframes).",
        ),
    ],
    file: Annotated[Path, typer.Argument(help="Map file.")],
    output: Annotated[Path, typer.Argument(help="Folder or file to write.")],
    images: Annotated[
        str | None,
        typer.Option(
            help="The sequence that the map was made of: its images are written undistorted, or "
            "give the points their colours [the images in the map file].",
            metavar="SEQUENCE",
        ),
    ] = None,
    fps: Annotated[float | None, typer.Option(help="For --images: the same as in the run.")] = None,
    times: Annotated[
        Path | None, typer.Option(help="For --images: the same as in the run.")
    ] = None,
    split: Annotated[
        bool, typer.Option("--split", help="For --images: the same as in the run.")
    ] = False,
    without_images: Annotated[
        bool, typer.Option("--without-images", help="Use no images, also if the map file has some.")
    ] = False,
    field: Annotated[
        float | None,
        typer.Option(
            help="Fisheye lens, colmap and nerfstudio: write pinhole images with this angle of "
            "view in the longer direction [degrees; only if the format cannot hold the lens: the "
            "widest without empty borders]."
        ),
    ] = None,
    frames: Annotated[
        bool,
        typer.Option(
            "--frames", help="tum, kitti, euroc: all images of the last run, not only keyframes."
        ),
    ] = False,
    number: MapNumber = None,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Write a map for another program: Gaussian splatting, NeRF, photogrammetry, viewers, tools."""
    _refuse_what_does_nothing(file_format, images, fps, times, without_images, frames)
    if split and images is None:
        raise DatasetError("--split says what --images hold; give these as well")
    _check_field(file_format, field, without_images)
    log_to(Console(stderr=True), quiet=quiet)
    saved = take_map(load_map(file, images=images is None and not without_images), number)
    if file_format not in _FOLDERS:
        check_target(output, force=force)
        check_apart({"the output": output}, [file, *([] if times is None else [times])])
    console = Console(quiet=quiet, highlight=False, soft_wrap=True)
    source = None if without_images else _image_source(saved, images, fps, times, split)
    with _progress(console) as bar:
        _write(saved, file_format, output, source, bar, frames=frames, force=force, field=field)
    console.print(f"{_what(saved, file_format)} is in [bold]{escape(str(output))}[/]")
    if source is None and file_format in _FOLDERS:
        console.print("No images are beside it: give the sequence with --images to train on it.")


def _refuse_what_does_nothing(
    file_format: ExportFormat,
    images: str | None,
    fps: float | None,
    times: Path | None,
    without_images: bool,
    frames: bool,
) -> None:
    if frames and file_format not in _PATHS:
        raise DatasetError(f"--frames is for tum, kitti and euroc; {file_format} has keyframes")
    if (images is not None or without_images) and file_format not in (*_FOLDERS, *_POINTS):
        name = "--without-images" if images is None else "--images"
        raise DatasetError(f"{name} has no meaning for {file_format}, which has none; leave it out")
    if images is not None and without_images:
        raise DatasetError("--images and --without-images exclude each other")
    for name, value in (("--fps", fps), ("--times", times)):
        if value is not None and images is None:
            raise DatasetError(f"{name} says when --images were taken; give these as well")


def _check_field(file_format: ExportFormat, field: float | None, without_images: bool) -> None:
    if field is None:
        return
    if file_format not in _FOLDERS or without_images:
        what = "--without-images" if without_images else str(file_format)
        raise DatasetError(f"--field is of the images, and {what} writes none; leave it out")
    checked_field(field)


def _image_source(
    saved: SavedMap, images: str | None, fps: float | None, times: Path | None, split: bool
) -> ImageOfKeyframe | None:
    if images is not None:
        return images_of(saved.contents, open_images(saved, images, fps, times, split))
    return (lambda keyframe: _decoded(saved, keyframe)) if saved.images else None


def _decoded(saved: SavedMap, keyframe: int) -> ByteArray | None:
    """Grey image of a keyframe from the map file."""
    if keyframe not in saved.images:
        return None
    content = np.frombuffer(saved.images[keyframe], np.uint8)
    return np.asarray(cv2.imdecode(content, cv2.IMREAD_GRAYSCALE), np.uint8)


def _write(
    saved: SavedMap,
    file_format: ExportFormat,
    output: Path,
    images: ImageOfKeyframe | None,
    bar: Progress,
    *,
    frames: bool,
    force: bool,
    field: float | None,
) -> None:
    contents = saved.contents
    task = bar.add_task("images", total=len(contents.keyframes), visible=images is not None)

    def show(done: int, total: int) -> None:
        bar.update(task, completed=done, total=total)

    if file_format is ExportFormat.NERFSTUDIO:
        export_nerfstudio(
            contents, output, images=images, replace=force, progress=show, field=field
        )
    elif file_format in _FOLDERS:
        binary = file_format is ExportFormat.COLMAP
        export_colmap(
            contents,
            output,
            images=images,
            binary=binary,
            replace=force,
            progress=show,
            field=field,
        )
    elif file_format in _POINTS:
        coloured = contents if images is None else with_colours(contents, images)
        export_points(coloured, output, str(file_format))
    elif file_format is ExportFormat.G2O:
        export_g2o(contents, output)
    else:
        path = frame_path(saved) if frames else keyframe_path(contents)
        export_trajectory(path, output, str(file_format))


def frame_path(saved: SavedMap) -> Trajectory:
    """All images of the last run in the map's world.

    Raises
    ------
    DatasetError
        If the map has none.
    """
    path = saved.trajectory(in_world=True)
    if path.lost.all():
        raise DatasetError("the map has no frames of a run; leave --frames out for its keyframes")
    return path


def _what(saved: SavedMap, file_format: ExportFormat) -> str:
    contents = saved.contents
    if file_format in _POINTS:
        return f"A cloud of {len(contents.points)} points"
    if file_format in _PATHS:
        return "The path"
    if file_format is ExportFormat.G2O:
        return f"The graph of {len(contents.keyframes)} keyframes"
    return f"The map of {len(contents.keyframes)} keyframes and {len(contents.points)} points"


def _progress(console: Console) -> Progress:
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    return Progress(*columns, console=console, transient=True, disable=not console.is_terminal)

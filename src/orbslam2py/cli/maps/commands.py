# SPDX-License-Identifier: BSD-3-Clause
"""``orbslam2py map``: contents, checks and uses of map files."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape

from orbslam2py._figures import check_picture_name
from orbslam2py.cli.calibrate import Force, Quiet
from orbslam2py.cli.exit_codes import ExitCode
from orbslam2py.cli.maps.description import describe_map
from orbslam2py.cli.maps.edits import MapFile, MapNumber, align, crop, optimize, save_edited
from orbslam2py.cli.maps.export import ExportCommand, export
from orbslam2py.cli.maps.merge import merge
from orbslam2py.cli.targets import check_apart, check_target
from orbslam2py.errors import MapFileError
from orbslam2py.maps import MapContents, load_map, map_differences, verify_map_file
from orbslam2py.maps.edits.parts import map_numbers, take_map
from orbslam2py.runs.map_picture import draw_map

app = typer.Typer(
    help="Look at map files, check, compare, merge, cut, move and refine them, and export them.",
    no_args_is_help=True,
    rich_markup_mode="markdown",
)


def info(
    file: MapFile,
    picture: Annotated[
        Path | None,
        typer.Option(
            help="Picture of the path (.png, .jpg, .svg, .pdf ...); of several maps, unless --map "
            "names one.",
            metavar="FILE",
        ),
    ] = None,
    number: MapNumber = None,
    force: Force = False,
) -> None:
    """Show what is in a map file: camera, keyframes, points, runs, extent."""
    check_target(picture, force=force)
    check_apart({"--picture": picture}, [file])
    if picture is not None:
        check_picture_name(picture, "--picture")
    if number is not None and picture is None:
        raise MapFileError("--map says of which map the picture is to be: --picture FILE.png")
    saved = load_map(file, images=True)
    console = Console(highlight=False, soft_wrap=True)
    for name, value in describe_map(saved, file):
        console.print(f"{name:20}{value}", markup=False)
    if picture is not None:
        chosen = saved if number is None else take_map(saved, number)
        draw_map(picture, chosen, title=file.name)
        console.print(f"Look at [bold]{escape(str(picture))}[/]")


def verify(files: Annotated[list[Path], typer.Argument(help="Map files.")]) -> None:
    """Check map files thoroughly: checksums, references, numbers, and the rules of a map.

    Ends at the first file that is damaged, with exit code 2.
    """
    console = Console(highlight=False, soft_wrap=True)
    for file in files:
        contents = verify_map_file(file).contents
        console.print(
            f"{file} is whole: {len(contents.keyframes)} keyframes, {len(contents.points)} points"
            f"{_in_maps(contents)}",
            markup=False,
        )


def _in_maps(contents: MapContents) -> str:
    n = int(map_numbers(contents.keyframes).max()) + 1
    return f", in {n} maps" if n > 1 else ""


def compare(
    first: MapFile, second: Annotated[Path, typer.Argument(help="Another map file.")]
) -> None:
    """Compare what two map files hold, bit by bit; exit code 1 if they differ.

    When and by which version they were written does not count.
    """
    lines = map_differences(load_map(first, images=True), load_map(second, images=True))
    console = Console(highlight=False, soft_wrap=True)
    for line in lines:
        console.print(line, markup=False)
    if lines:
        console.print(f"{first} and {second} differ", markup=False)
        raise typer.Exit(ExitCode.FAILED)
    console.print(f"{first} and {second} hold the same", markup=False)


def compact(
    file: MapFile,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="File to write [the same].")
    ] = None,
    without_images: Annotated[
        bool, typer.Option("--without-images", help="Leave the keyframes' images out.")
    ] = False,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Write a map file again with the smallest size, without the remains of autosaving."""
    saved = load_map(file, images=not without_images)
    if without_images:
        saved = replace(saved, images={})
    before = file.stat().st_size
    target = file if output is None else output
    save_edited(saved, target, force=force or output is None)
    after = target.stat().st_size
    Console(quiet=quiet, highlight=False, soft_wrap=True).print(
        f"{target}: {after / 1e6:.2f} MB, {before / 1e6:.2f} MB before", markup=False
    )


EXAMPLE = "{}\n\n**Example**\n\n    orbslam2py map {}\n"
for command, example in (
    (info, "info office.orbmap --picture office.png"),
    (verify, "verify office.orbmap"),
    (compare, "compare office.orbmap copy.orbmap"),
    (merge, "merge monday.orbmap tuesday.orbmap --output both.orbmap"),
    (compact, "compact office.orbmap --output small.orbmap"),
    (export, "export colmap office.orbmap office-colmap --images video.mp4"),
    (crop, "crop office.orbmap --output start.orbmap --from 0 --to 30"),
    (align, "align office.orbmap --output metric.orbmap --length 2.5 --between 0 12.4"),
    (optimize, "optimize office.orbmap --output refined.orbmap"),
):
    command.__doc__ = EXAMPLE.format(command.__doc__, example)
    own_class = ExportCommand if command is export else None
    app.command(command.__name__, cls=own_class)(command)

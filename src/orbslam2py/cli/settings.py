# SPDX-License-Identifier: BSD-3-Clause
"""``orbslam2py settings``: make, show, check and list settings files."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from orbslam2py._files import atomic_write
from orbslam2py.cli.calibrate import Baseline, DepthFactor, Force, Quiet
from orbslam2py.cli.messages import log_to
from orbslam2py.cli.synthesize import parse_size
from orbslam2py.cli.targets import check_target
from orbslam2py.errors import SettingsError
from orbslam2py.settings import (
    BUILTIN_NAMES,
    CameraSettings,
    OrbSettings,
    Sensor,
    Settings,
    builtin_settings,
    settings_for_camera,
)
from orbslam2py.settings.builtin import BUILTIN_DATA, builtin_sensors
from orbslam2py.settings.check import read_choice, warn_of_doubts
from orbslam2py.settings.defaults import ASSUMED_DEPTH_FACTOR
from orbslam2py.settings.fisheye import LENS_PARAMETERS, PINHOLE, checked_model
from orbslam2py.settings.groups import DISTORTION_FIELDS

app = typer.Typer(
    help="Make, show, check and list settings files.",
    no_args_is_help=True,
    rich_markup_mode="markdown",
)

Choice = Annotated[str, typer.Argument(metavar="NAME_OR_FILE", help="Built-in name, or file.")]
OfSensor = Annotated[
    Sensor | None, typer.Option(help="Sensor [the one that the name or the file is for].")
]


def new(
    sensor: Annotated[Sensor, typer.Option(help="Sensor of the images.")],
    fx: Annotated[float, typer.Option(help="Focal length in x [pixels].")],
    fy: Annotated[float, typer.Option(help="Focal length in y [pixels].")],
    cx: Annotated[float, typer.Option(help="Image centre in x [pixels].")],
    cy: Annotated[float, typer.Option(help="Image centre in y [pixels].")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="File to write [the terminal].")
    ] = None,
    size: Annotated[
        str | None, typer.Option(help="Size of the images, such as 640x480.", metavar="WxH")
    ] = None,
    fps: Annotated[float, typer.Option(help="Images per second.")] = 30.0,
    depth_factor: DepthFactor = None,
    baseline: Baseline = None,
    distortion: Annotated[
        str | None,
        typer.Option(
            help="OpenCV's k1,k2,p1,p2, with k3, with k3,k4,k5,k6, or with s1,s2,s3,s4 as well "
            "[none].",
            metavar="NUMBERS",
        ),
    ] = None,
    model: Annotated[
        str,
        typer.Option(
            help="Camera model: pinhole, kannala_brandt, double_sphere, eucm, mei, fov or "
            "thin_prism."
        ),
    ] = PINHOLE,
    lens: Annotated[
        str | None,
        typer.Option(
            help="Parameters of a fisheye model, such as k1,k2,k3,k4 of kannala_brandt [none].",
            metavar="NUMBERS",
        ),
    ] = None,
    features: Annotated[
        int | None,
        typer.Option(help="ORB features per image [1000, or 2000 above 0.6 megapixels]."),
    ] = None,
    rgb: Annotated[bool, typer.Option("--rgb", help="Colour images are RGB, not BGR.")] = False,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Make settings of the numbers of a camera; all others get their usual values."""
    check_target(output, force=force)
    width, height = (None, None) if size is None else parse_size(size)
    camera = CameraSettings(fx, fy, cx, cy, width=width, height=height, fps=fps, rgb=rgb)
    settings = settings_for_camera(
        replace(camera, **(_coefficients(distortion) | _lens(model, lens, distortion))),
        sensor,
        baseline=baseline,
        depth_factor=depth_factor,
        orb=None if features is None else OrbSettings(n_features=features),
    )
    if output is None:
        typer.echo(settings.to_yaml(), nl=False)
        return
    with atomic_write(output) as stream:
        stream.write(settings.to_yaml())
    log_to(Console(stderr=True), quiet=quiet)
    warn_of_doubts(settings, output)
    console = Console(quiet=quiet, highlight=False, soft_wrap=True)
    _describe(console, settings)
    if sensor is Sensor.RGBD and depth_factor is None:
        console.print(ASSUMED_DEPTH_FACTOR)
    console.print(f"Settings are in [bold]{escape(str(output))}[/]")


def show(choice: Choice, sensor: OfSensor = None) -> None:
    """Print settings as a complete file, to look at or to start from."""
    log_to(Console(stderr=True), quiet=False)
    chosen = read_choice(choice)
    typer.echo(chosen.load(sensor or chosen.likely_sensor).to_yaml(), nl=False)


def check(choice: Choice, sensor: OfSensor = None) -> None:
    """Check a settings file as a whole: say what is wrong, doubtful, and what it is good for."""
    log_to(Console(stderr=True), quiet=False)
    chosen = read_choice(choice)
    settings = chosen.load(sensor or chosen.likely_sensor)
    warn_of_doubts(settings, choice)
    console = Console(highlight=False, soft_wrap=True)
    _describe(console, settings)
    # What is asked for is loaded, as a run does it: it is complete for that, too.
    usable = dict.fromkeys((*([sensor] if sensor else []), *chosen.usable_sensors()))
    console.print(f"{choice} is complete for {', '.join(map(str, usable))}", markup=False)


def list_names() -> None:
    """List the built-in settings: name, sensors, size of the images, focal length, data."""
    table = Table("name", "sensors", "images", "fx [pixels]", "data")
    for name in BUILTIN_NAMES:
        sensors = builtin_sensors(name)
        camera = builtin_settings(name, sensors[0]).camera
        size = f"{camera.width} x {camera.height}"
        words = ", ".join(map(str, sensors))
        table.add_row(name, words, size, f"{camera.fx:.1f}", BUILTIN_DATA[name])
    Console(highlight=False).print(table)


def _coefficients(text: str | None) -> dict[str, Any]:
    """Return the distortion by the names of the fields of `CameraSettings`."""
    if text is None:
        return {}
    try:
        numbers = [float(word) for word in text.replace(",", " ").split()]
    except ValueError:
        numbers = []
    if len(numbers) == len(LENS_PARAMETERS["thin_prism"]):
        return {"model": "thin_prism", "lens": tuple(numbers)}
    if len(numbers) not in (4, 5, 8):
        raise SettingsError(
            f"--distortion is '{text}'; give four, five, eight or twelve numbers "
            "k1,k2,p1,p2[,k3[,k4,k5,k6[,s1,s2,s3,s4]]] like 0.1,-0.2,0,0"
        )
    return dict(zip(DISTORTION_FIELDS, numbers, strict=False))


def _lens(model: str, text: str | None, distortion: str | None) -> dict[str, Any]:
    """Return the fields of `CameraSettings` for a fisheye lens; empty for a pinhole."""
    model = checked_model(model)
    names = ",".join(LENS_PARAMETERS.get(model, ()))
    if model == PINHOLE:
        if text is None:
            return {}
        raise SettingsError(
            "--lens goes with a fisheye model; name it with --model "
            f"({', '.join(LENS_PARAMETERS)}), or give --distortion for a pinhole"
        )
    if distortion is not None:
        raise SettingsError(
            f"--distortion goes with a pinhole, and --model is {model}; give --lens {names} instead"
        )
    try:
        numbers = [float(word) for word in (text or "").replace(",", " ").split()]
    except ValueError:
        numbers = []
    if len(numbers) != len(LENS_PARAMETERS[model]):
        raise SettingsError(
            f"--lens is {'missing' if text is None else repr(text)}; the model {model} needs the "
            f"numbers --lens {names}"
        )
    return {"model": model, "lens": tuple(numbers)}


def _describe(console: Console, settings: Settings) -> None:
    for line in settings.describe():
        console.print(line, markup=False)


EXAMPLE = "{}\n\n**Example**\n\n    orbslam2py settings {}\n"
new.__doc__ = EXAMPLE.format(
    new.__doc__,
    "new --sensor rgbd --fx 525 --fy 525 --cx 319.5 --cy 239.5 --size 640x480 "
    "--depth-factor 1000 -o phone.yaml",
)
show.__doc__ = EXAMPLE.format(show.__doc__, "show tum1")
check.__doc__ = EXAMPLE.format(check.__doc__, "check my.yaml")
list_names.__doc__ = EXAMPLE.format(list_names.__doc__, "list")
app.command("new")(new)
app.command("show")(show)
app.command("check")(check)
app.command("list")(list_names)

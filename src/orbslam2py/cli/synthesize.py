# SPDX-License-Identifier: BSD-3-Clause
"""``orbslam2py synthesize``: a sequence with exact ground truth, made on the spot."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from orbslam2py._arguments import number_of
from orbslam2py.errors import SettingsError
from orbslam2py.settings import Sensor, Settings
from orbslam2py.synthetic import (
    Corners,
    SyntheticMotion,
    SyntheticOptions,
    SyntheticSequence,
    SyntheticWorld,
)

EXAMPLE = """
**Example**

    orbslam2py synthesize lap --world corridor --sensor rgbd --layout tum

    orbslam2py run lap --sensor rgbd
"""


World = Annotated[SyntheticWorld, typer.Option(help="Where the camera moves.")]
Sensors = Annotated[Sensor, typer.Option(help="What delivers the images.")]


class _Written(str, Enum):
    """Layouts that are written."""

    TUM = "tum"
    KITTI = "kitti"
    EUROC = "euroc"
    ROSBAG1 = "rosbag1"
    ROSBAG2 = "rosbag2"
    MCAP = "mcap"


Layouts = Annotated[
    _Written | None,
    typer.Option(
        help="File names and formats: tum for mono and rgbd, kitti or euroc for mono and stereo; "
        "rosbag1, rosbag2, mcap: a bag of ROS 1 or 2, for all.  "
        "[default: kitti for stereo, else tum]"
    ),
]
Frames = Annotated[int | None, typer.Option(help="Number of images.  [default: the whole path]")]
Laps = Annotated[
    float | None,
    typer.Option(
        help="Instead of --frames: number of laps, if the path returns to its start.  "
        "[default: 1.2; figure-eight: 1.1]"
    ),
]
Length = Annotated[
    float | None, typer.Option(help="Metres of the straight street.  [default: 600]")
]
Fps = Annotated[float | None, typer.Option(help="Frames per second.  [default: 20; streets: 10]")]
Speed = Annotated[
    float | None,
    typer.Option(
        help="Metres per second along a path.  [default: 0.7; two-rooms: 0.4; streets: 10]"
    ),
]
Pace = Annotated[float, typer.Option(help="Times the usual speed, in every world.")]
Motion = Annotated[SyntheticMotion, typer.Option(help="How the camera moves along its path.")]
Bends = Annotated[
    Corners,
    typer.Option(
        "--corners", help="Whether the camera turns early in bends, or together with the path."
    ),
]
Blur = Annotated[
    float, typer.Option(help="How long the shutter is open, in times between two frames: 0 to 1.")
]
Cover = Annotated[
    str,
    typer.Option(
        metavar="SECONDS",
        help="Seconds that a hand covers the lens, in the middle; FROM:SECONDS says when.",
    ),
]
Pieces = Annotated[
    int | None,
    typer.Option(
        help="Number of pieces of the path; they come in another order, with darkness between."
    ),
]
Order = Annotated[
    str | None,
    typer.Option(
        metavar="N,N,...",
        help="Which of the pieces come, in which order, from 0; the others are left out.  "
        "[default: all, shuffled by --seed]",
    ),
]
Gap = Annotated[
    float | None,
    typer.Option(help="Seconds in the dark between two pieces.  [default: 3]"),
]
Overlap = Annotated[
    float | None,
    typer.Option(
        help="Seconds by which each piece begins earlier and ends later: what neighbours share.  "
        "[default: 0]"
    ),
]
Exposure = Annotated[
    str,
    typer.Option(
        metavar="FACTOR", help="Factor on the grey values; LOW:HIGH jumps about once a second."
    ),
]
Size = Annotated[
    str | None, typer.Option(metavar="WxH", help="Pixels.  [default: 640x480; streets: 1241x376]")
]
Lens = Annotated[
    Path | None,
    typer.Option(
        metavar="SETTINGS",
        help="Settings file of a camera through whose lens the images are seen: any camera model, "
        "fisheye lenses as well. With --sensor stereo of a raw pair (Camera2.*, or LEFT.* and "
        "RIGHT.*): raw images of both cameras.",
    ),
]


Rig = Annotated[
    Path | None,
    typer.Option(
        metavar="SETTINGS",
        help="Settings file of a rig (Camera1.*, Camera2.*, Camera2.T_c1_c2, ...): images of all "
        "its cameras through their lenses. Then --sensor is rig.",
    ),
]


def synthesize(
    folder: Annotated[Path, typer.Argument(help="Folder to write; must be new or empty.")],
    world: World = SyntheticWorld.ROOM,
    sensor: Sensors = Sensor.STEREO,
    layout: Layouts = None,
    frames: Frames = None,
    laps: Laps = None,
    fps: Fps = None,
    length: Length = None,
    speed: Speed = None,
    pace: Pace = 1.0,
    motion: Motion = SyntheticMotion.SMOOTH,
    corners: Bends = Corners.ROUND,
    size: Size = None,
    lens: Lens = None,
    rig: Rig = None,
    seed: Annotated[int, typer.Option(help="Another seed, another world.")] = 0,
    noise: Annotated[float, typer.Option(help="Noise of the images [grey levels].")] = 0.0,
    depth_noise: Annotated[
        float, typer.Option(help="Noise of the depth at 1 m [m]; grows with its square.")
    ] = 0.0,
    exposure: Exposure = "1",
    blur: Blur = 0.0,
    cover: Cover = "0",
    pieces: Pieces = None,
    order: Order = None,
    gap: Gap = None,
    overlap: Overlap = None,
    lateral: Annotated[float, typer.Option(help="Metres to the right of the usual path.")] = 0.0,
    yaw: Annotated[float, typer.Option(help="Degrees that the camera looks to the right.")] = 0.0,
    imu: Annotated[
        bool, typer.Option("--imu", help="Write samples of an IMU beside the camera, too.")
    ] = False,
    imu_noise: Annotated[
        str | None,
        typer.Option(
            metavar="CHIP",
            help="Noise and bias of a chip in the samples, such as mpu6050, bmi088 or adis16448.  "
            "[default: none]",
        ),
    ] = None,
    force: Annotated[
        bool, typer.Option("--force", help="Replace a synthetic sequence in the folder.")
    ] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="Only errors.")] = False,
) -> None:
    """Write a synthetic sequence with calibration and exact ground truth."""
    if rig is not None:
        sensor = Sensor.RIG
    if depth_noise and sensor not in (Sensor.RGBD, Sensor.RIG):
        raise SettingsError("--depth-noise is of depth images: --sensor rgbd")
    pair = sensor is Sensor.STEREO
    options = SyntheticOptions(
        world=world,
        sensor=sensor,
        frames=frames,
        laps=laps,
        fps=fps,
        length=length,
        speed=speed,
        pace=pace,
        motion=motion,
        corners=corners,
        size=None if size is None else parse_size(size),
        seed=seed,
        noise=noise,
        depth_noise=depth_noise,
        exposure=parse_exposure(exposure),
        blur=blur,
        cover=parse_cover(cover),
        pieces=pieces,
        order=None if order is None else parse_order(order),
        gap=gap,
        overlap=overlap,
        lateral=lateral,
        yaw=yaw,
        lens=None if lens is None or pair else Settings.load(lens, Sensor.MONOCULAR).camera,
        lens_pair=Settings.load(lens, Sensor.STEREO) if lens is not None and pair else None,
        imu=imu,
        imu_noise=imu_noise,
        rig=None if rig is None else Settings.load(rig, Sensor.RIG),
    )
    sequence = SyntheticSequence(options)
    console = Console(quiet=quiet)
    _write(sequence, folder, layout, force=force, console=console)
    console.print(
        f"{number_of(len(sequence), 'frame')} {'is' if len(sequence) == 1 else 'are'} in "
        f"[bold]{escape(str(folder))}[/]",
        highlight=False,
        soft_wrap=True,
    )


synthesize.__doc__ = f"{synthesize.__doc__}\n{EXAMPLE}"


def _write(
    sequence: SyntheticSequence,
    folder: Path,
    layout: _Written | None,
    *,
    force: bool,
    console: Console,
) -> None:
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    with Progress(*columns, TimeRemainingColumn(), console=console, transient=True) as bar:
        task = bar.add_task("Rendering", total=len(sequence))
        sequence.write(
            folder,
            None if layout is None else layout.value,
            force=force,
            progress=lambda done, total: bar.update(task, completed=done, total=total),
        )


def parse_size(text: str) -> tuple[int, int]:
    """Read ``640x480``.

    Raises
    ------
    SettingsError
        If the text is anything else.
    """
    width, cross, height = text.lower().partition("x")
    if not (cross and width.isdecimal() and height.isdecimal()):
        raise SettingsError(f"--size is '{text}'; give width x height like 640x480")
    return int(width), int(height)


def parse_exposure(text: str) -> float | tuple[float, float]:
    """Read a factor, or the least and the greatest value of one that jumps: ``0.4:1.5``.

    Raises
    ------
    SettingsError
        If the text is anything else.
    """
    factors = _one_or_two(text)
    if factors is None:
        raise SettingsError(f"--exposure is '{text}'; give a factor like 0.8, or two like 0.4:1.5")
    return factors


def parse_cover(text: str) -> float | tuple[float, float]:
    """Read a duration in seconds, or a start and a duration: ``10:3``.

    Raises
    ------
    SettingsError
        If the text is anything else.
    """
    seconds = _one_or_two(text)
    if seconds is None:
        raise SettingsError(
            f"--cover is '{text}'; give seconds like 1.5, or when and how long like 10:3"
        )
    return seconds


def _one_or_two(text: str) -> float | tuple[float, float] | None:
    """Return a number, or two with a colon between them; None for anything else."""
    try:
        numbers = [float(part) for part in text.split(":")]
    except ValueError:
        return None
    if len(numbers) == 2:
        return numbers[0], numbers[1]
    return numbers[0] if len(numbers) == 1 else None


def parse_order(text: str) -> tuple[int, ...]:
    """Read numbers of pieces: ``2,0,1``.

    Raises
    ------
    SettingsError
        If the text is anything else.
    """
    parts = [part.strip() for part in text.split(",")]
    if not all(part.isdecimal() and part.isascii() for part in parts):
        raise SettingsError(f"--order is '{text}'; give numbers of pieces from 0, like 2,0,1")
    return tuple(int(part) for part in parts)

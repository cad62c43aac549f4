# SPDX-License-Identifier: BSD-3-Clause
"""``orbslam2py devices``: connected devices."""

from __future__ import annotations

import json
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape

from orbslam2py.errors import DatasetError
from orbslam2py.live import KINDS, FoundDevice, Kind

EXAMPLE = """
**Example**

    orbslam2py devices

    orbslam2py run realsense:031422250347 --sensor stereo
"""


def devices(
    as_json: Annotated[
        bool, typer.Option("--json", help="Print what is found as JSON, for programs.")
    ] = False,
) -> None:
    """List the cameras that are plugged in, with their modes."""
    console = Console()
    found: list[FoundDevice] = []
    problems: list[str] = []
    for kind in KINDS:
        if kind.can_be_listed:
            devices_of_kind, problem = _look(kind)
            found += devices_of_kind
            problems += [problem] if problem else []
    if as_json:
        document: dict[str, Any] = {
            "devices": [
                {"source": one.source, "description": one.description, "modes": list(one.modes)}
                for one in found
            ],
            "not_looked_for": problems,
        }
        typer.echo(json.dumps(document, indent=2))
        return
    for one in found:
        head = f"[bold]{escape(one.source)}[/]  {escape(one.description)}"
        console.print(head, highlight=False, soft_wrap=True)
        for mode in one.modes:
            console.print(f"    {escape(mode)}", highlight=False, soft_wrap=True)
    if not found:
        console.print("No camera is plugged in that can be found.", highlight=False)
    for problem in problems:
        console.print(f"Not looked for: {escape(problem)}", highlight=False, soft_wrap=True)
    others = [kind.example for kind in KINDS if not kind.can_be_listed]
    if others:
        console.print(
            f"Not listed, for they have addresses: {escape(', '.join(others))}", highlight=False
        )


def _look(kind: Kind) -> tuple[list[FoundDevice], str | None]:
    """Find the devices of a kind, or say why they cannot be found."""
    try:
        return kind.find(), None
    except DatasetError as error:
        return [], str(error)
    except Exception as error:  # a library of a maker may fail in any way; the others are listed
        return [], f"{kind.prefix}: {error}"


devices.__doc__ = f"{devices.__doc__}\n{EXAMPLE}"

# SPDX-License-Identifier: BSD-3-Clause
"""``orbslam2py config``: list the thresholds of the method."""

from __future__ import annotations

import ast
import inspect
import itertools
from dataclasses import fields
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from orbslam2py.errors import SettingsError
from orbslam2py.slam.config import PRESETS, Config, all_values, value_of

EXAMPLE = """
**Example**

    orbslam2py config

    orbslam2py config tracking
"""


def show(
    name: Annotated[
        str | None, typer.Argument(help="A section, or one value.", metavar="[NAME]")
    ] = None,
) -> None:
    """List the thresholds of the method, their defaults and what they mean."""
    meanings = descriptions()
    chosen = [(full, value) for full, value in all_values(Config()) if _is_of(full, name)]
    if not chosen:
        value_of(Config(), str(name))  # raises, and names the nearest one
        raise SettingsError(f"the configuration has no section {name}")
    console = Console()
    table = Table("name", "default", "meaning", show_lines=False)
    for full, value in chosen:
        table.add_row(full, str(value), meanings[full])
    console.print(table)
    if name is None:
        for preset, changes in PRESETS.items():
            listed = ", ".join(f"{one}={value}" for one, value in changes.items())
            console.print(f"effort {preset}: {listed or 'the defaults'}", highlight=False)
        console.print("Change one with: orbslam2py run ... --set NAME=VALUE", highlight=False)


def _is_of(full: str, name: str | None) -> bool:
    return name is None or full == name or full.startswith(f"{name}.")


def descriptions() -> dict[str, str]:
    """Return what each value means, by its name with a dot: the docstrings of the fields."""
    found = {}
    for section in fields(Config):
        kind: Any = type(getattr(Config(), section.name))
        (definition,) = ast.parse(inspect.getsource(kind)).body
        assert isinstance(definition, ast.ClassDef)
        names = {one.name for one in fields(kind)}
        for field, text in itertools.pairwise(definition.body):
            if not isinstance(field, ast.AnnAssign) or not isinstance(field.target, ast.Name):
                continue
            if field.target.id in names:
                said = text.value.value if _is_text(text) else ""  # type: ignore[attr-defined]
                found[f"{section.name}.{field.target.id}"] = " ".join(str(said).split())
    return found


def _is_text(node: ast.stmt) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


show.__doc__ = f"{show.__doc__}\n{EXAMPLE}"

# SPDX-License-Identifier: BSD-3-Clause
"""The reference of the command line as Markdown, from the signatures that typer reads as well."""

from __future__ import annotations

import inspect
import types
import typing
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import Enum
from typing import Any

import typer
from typer.models import ArgumentInfo, OptionInfo

from orbslam2py.cli.app import SUBCOMMANDS

PROGRAM = "orbslam2py"
_VALUES = {int: "INTEGER", float: "NUMBER", str: "TEXT"}


@dataclass(frozen=True)
class Parameter:
    """An argument or option of a command."""

    name: str
    info: ArgumentInfo | OptionInfo
    kind: Any
    """Type of the value, without None."""
    default: object
    """`inspect.Parameter.empty` if it must be given."""

    @property
    def is_option(self) -> bool:
        """Whether it is given by a name."""
        return isinstance(self.info, OptionInfo)

    @property
    def required(self) -> bool:
        """Whether it must be given."""
        return self.default is inspect.Parameter.empty


@dataclass(frozen=True)
class Command:
    """A command, with the names of the groups it belongs to."""

    name: str
    function: Callable[..., None]

    def parameters(self) -> list[Parameter]:
        """Arguments and options in their order."""
        hints = typing.get_type_hints(self.function, include_extras=True)
        found = []
        for name, parameter in inspect.signature(self.function).parameters.items():
            kind, *extras = typing.get_args(hints[name])
            info = next(e for e in extras if isinstance(e, (ArgumentInfo, OptionInfo)))
            found.append(Parameter(name, info, _without_none(kind), parameter.default))
        return found

    def text_and_example(self) -> tuple[str, list[str]]:
        """What it does, and the lines of its example."""
        text, _, example = inspect.cleandoc(self.function.__doc__ or "").partition("**Example**")
        return text.strip(), [line.strip() for line in example.splitlines() if line.strip()]


def commands() -> Iterator[Command]:
    """Yield every command, in the order of the help."""
    for name, subcommand in SUBCOMMANDS.items():
        target = subcommand.load()
        if not isinstance(target, typer.Typer):
            yield Command(name, target)
            continue
        for entry in target.registered_commands:
            assert entry.callback is not None
            yield Command(f"{name} {entry.name}", entry.callback)


def reference() -> str:
    """All commands: what they do, arguments, options with defaults, examples."""
    return "\n".join(_section(command) for command in commands())


def _section(command: Command) -> str:
    text, example = command.text_and_example()
    arguments = [p for p in command.parameters() if not p.is_option]
    options = [p for p in command.parameters() if p.is_option]
    usage = " ".join([PROGRAM, command.name, "[OPTIONS]", *map(_argument_name, arguments)])
    lines = [f"## {command.name}", "", text, "", "```text", usage, "```", ""]
    if arguments:
        lines += ["| argument | meaning |", "|---|---|"]
        lines += [f"| `{_argument_name(p)}` | {_cell(p.info.help)} |" for p in arguments]
        lines.append("")
    if options:
        lines += ["| option | default | meaning |", "|---|---|---|"]
    for option in options:
        help_text, default = _help_and_default(option)
        lines.append(f"| {_option_names(option)} | {default} | {help_text} |")
    lines += ["", "```bash", *example, "```", ""]
    return "\n".join(lines)


def _without_none(kind: Any) -> Any:
    if typing.get_origin(kind) in (typing.Union, types.UnionType):
        return next(k for k in typing.get_args(kind) if k is not type(None))
    return kind


def _argument_name(argument: Parameter) -> str:
    name = str(argument.info.metavar or argument.name).upper()
    return name if argument.required else f"[{name}]"


def _option_names(option: Parameter) -> str:
    # Within Annotated the first name takes the place of the default.
    declared = [option.info.default, *(option.info.param_decls or ())]
    names = [n for n in declared if isinstance(n, str) and n.startswith("-")]
    if not names:
        own = option.name.replace("_", "-")
        names = [f"--{own}/--no-{own}" if option.kind is bool else f"--{own}"]
    names = [f"`{name}`" for name in "/".join(names).split("/")]
    return f"{', '.join(names)} {_values(option)}".strip()


def _values(option: Parameter) -> str:
    if option.kind is bool:
        return ""
    if isinstance(option.kind, type) and issubclass(option.kind, Enum):
        return " or ".join(f"`{member.value}`" for member in option.kind)
    return f"`{option.info.metavar or _VALUES.get(option.kind, 'PATH')}`"


def _help_and_default(option: Parameter) -> tuple[str, str]:
    """Split the help, which names defaults that are no single value in brackets at its end."""
    text = str(option.info.help or "")
    said = ""
    if text.endswith(("].", "]")) and "[" in text:
        text, _, said = text.removesuffix(".").removesuffix("]").rpartition("[")
        said = said.removeprefix("default:").strip()
        text = text.strip()
        if not text.endswith("."):
            text += "."
        if option.default is not None or " " not in said:  # a unit
            text, said = f"{text.removesuffix('.')} [{said}].", ""
    return _cell(text), said or _default(option)


def _default(option: Parameter) -> str:
    if option.required:
        return "required"
    if option.kind is bool:
        return "on" if option.default else "off"
    if option.default is None or option.default == "":
        return ""
    value = option.default
    return f"`{value.value if isinstance(value, Enum) else value}`"


def _cell(text: str | None) -> str:
    return (text or "").replace("|", "\\|")

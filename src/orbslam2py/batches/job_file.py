# SPDX-License-Identifier: BSD-3-Clause
"""The text of a job file as named values, none of them repeated."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from orbslam2py._arguments import cannot_open
from orbslam2py.errors import SettingsError

_MERGE = "tag:yaml.org,2002:merge"


class _KeyTwiceError(yaml.MarkedYAMLError):  # type: ignore[misc]
    """A mapping has a repeated key."""


class _Loader(yaml.SafeLoader):  # type: ignore[misc]
    """Refuses repeated keys, of which PyYAML uses the last without a message."""

    def compose_mapping_node(self, anchor: Any) -> Any:
        """Check the written keys, before those of merged mappings (``<<``) are added."""
        node = super().compose_mapping_node(anchor)
        places: dict[tuple[str, str], Any] = {}
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode) or key.tag == _MERGE:
                continue
            first = places.setdefault((key.tag, key.value), key)
            if first is not key:
                line = first.start_mark.line + 1
                raise _KeyTwiceError(
                    problem=f"'{key.value}' is given twice (first on line {line}); keep one",
                    problem_mark=key.start_mark,
                )
        return node


def read_document(path: Path) -> Mapping[str, Any]:
    """Read the contents of a job file.

    Raises
    ------
    SettingsError
        If it cannot be read, is no YAML, repeats a key, or has no named values.
    """
    try:
        document = yaml.load(path.read_text(encoding="utf-8"), _Loader)
    except OSError as error:
        raise SettingsError(cannot_open(path, error, "job file")) from error
    except yaml.MarkedYAMLError as error:
        line = error.problem_mark.line + 1 if error.problem_mark else 1
        if isinstance(error, _KeyTwiceError):
            raise SettingsError(f"{path}:{line}: {error.problem}") from error
        raise SettingsError(f"{path}:{line} is no YAML: {error.problem}; correct it") from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise SettingsError(f"{path} is no text in YAML; give a job file") from error
    except ValueError as error:  # of a date such as 2024-13-45
        raise SettingsError(
            f"{path} is no YAML: {error}; put text that looks like a date into quotes"
        ) from error
    if not isinstance(document, Mapping):
        raise SettingsError(f"{path} holds no named values; it needs at least 'sequences:'")
    return document

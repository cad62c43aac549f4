# SPDX-License-Identifier: BSD-3-Clause
"""The scripts that `make demo` calls, as modules."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType

import pytest

from support.data import CHECKOUT


def load_scripts(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> ModuleType:
    """Give the scripts as modules of one name space; logs go into a folder of the test."""
    monkeypatch.syspath_prepend(CHECKOUT / "scripts")
    names = ["steps", "install_system_packages", "install_requirements", "make_venv"]
    names += ["build_package"]
    for name in names:
        monkeypatch.delitem(sys.modules, name, raising=False)
    together = ModuleType("scripts")
    for name in names:
        module = __import__(name)
        if hasattr(module, "LOGS"):
            monkeypatch.setattr(module, "LOGS", tmp_path / "logs")
        setattr(together, name, module)
    return together

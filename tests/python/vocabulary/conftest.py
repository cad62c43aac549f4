# SPDX-License-Identifier: BSD-3-Clause
"""A small vocabulary, and a cache of one's own."""

from __future__ import annotations

from pathlib import Path

import pytest

from orbslam2py.vocabulary import ENVIRONMENT_VARIABLE, load_vocabulary
from support.vocabularies import TEXT


@pytest.fixture(autouse=True)
def private_cache(tmp_path, monkeypatch):
    """Parsed copies go nowhere else, and nobody has chosen a vocabulary."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv(ENVIRONMENT_VARIABLE, raising=False)


@pytest.fixture(scope="session")
def vocabulary():
    return load_vocabulary(TEXT, cache=False)


@pytest.fixture
def text(tmp_path) -> Path:
    """A copy of the golden file in a folder of its own."""
    path = tmp_path / "words.txt"
    path.write_bytes(TEXT.read_bytes())
    return path

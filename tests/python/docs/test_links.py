# SPDX-License-Identifier: BSD-3-Clause
"""Links lead somewhere: to pages, headings and pictures; from the code into the docs as well."""

from __future__ import annotations

import importlib
import re
from functools import lru_cache
from pathlib import Path
from types import ModuleType

import pytest

from support.documents import ROOT, anchors_of, documents, prose_of, read, tracked_files

_LINK = re.compile(
    r"(?<!\\)!?\[(?:[^\[\]]|\[[^\]]*\])*\]\(\s*<?([^)\s>]+)>?(?:\s+\"[^\"]*\")?\s*\)"
)
_POINTER = re.compile(r"docs/[\w/-]+\.md(?:#[\w-]+)?")

#: Pages that the site makes of files elsewhere in the checkout; see scripts/docs_hooks.py.
MADE = {"docs/contributing.md": "CONTRIBUTING.md", "docs/changelog.md": "CHANGELOG.md"}
PAGES = [*documents(), ROOT / "CONTRIBUTING.md"]


@pytest.fixture(scope="module")
def command_reference() -> ModuleType:
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(ROOT / "scripts")
        return importlib.import_module("command_reference")


@lru_cache
def anchors(path: Path) -> frozenset[str]:
    return frozenset(anchors_of(read(path)))


def links_of(path: Path) -> list[str]:
    """Targets of the links of a page, without those to other hosts."""
    text = re.sub(r"`[^`\n]*`", "", prose_of(read(path)))
    return [t for t in _LINK.findall(text) if not re.match(r"[a-z]+:", t)]


def made_from(path: Path) -> Path:
    name = str(path.relative_to(ROOT)) if path.is_relative_to(ROOT) else str(path)
    return ROOT / MADE[name] if name in MADE else path


@pytest.mark.parametrize("path", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_links_lead_somewhere(path: Path, command_reference: ModuleType) -> None:
    dead = []
    for target in links_of(path):
        name, _, anchor = target.partition("#")
        page = made_from((path.parent / name).resolve()) if name else path
        if not page.exists():
            dead.append(target)
        elif anchor and page.suffix == ".md":
            known = anchors(page)
            if "<!-- all commands -->" in read(page):
                known |= anchors_of(command_reference.reference())
            made_of_code = anchor.startswith("orbslam2py.") and f"::: {anchor}\n" in read(page)
            if anchor not in known and not made_of_code:
                dead.append(target)
    assert not dead, f"{path.relative_to(ROOT)} points to nothing: {dead}"


def test_pointers_from_the_code_lead_somewhere() -> None:
    dead = []
    for path in tracked_files(
        "src", "tests", "benchmarks", "examples", "scripts", "Makefile", ".ci"
    ):
        if path.suffix in {".png", ".bvoc", ".npz", ".npy", ".gz"} or not path.is_file():
            continue
        for pointer in _POINTER.findall(path.read_text(encoding="utf-8", errors="replace")):
            name, _, anchor = pointer.partition("#")
            page = made_from(ROOT / name)
            if not page.is_file() or (anchor and anchor not in anchors(page)):
                dead.append(f"{path.relative_to(ROOT)}: {pointer}")
    assert not dead, dead


def test_code_in_prose_names_pages_that_exist() -> None:
    """README and others name pages as `docs/....md` as well."""
    dead = []
    for path in [*PAGES, ROOT / "CHANGELOG.md", *tracked_files("third_party_notes")]:
        dead += [
            f"{path.relative_to(ROOT)}: {pointer}"
            for pointer in _POINTER.findall(read(path))
            if not made_from(ROOT / pointer.partition("#")[0]).is_file()
        ]
    assert not dead, dead


def test_every_page_is_in_the_navigation() -> None:
    """MkDocs warns of it as well, but only when the site is made."""
    navigation = set(re.findall(r"[\w/-]+\.md", read(ROOT / "mkdocs.yml").partition("nav:")[2]))
    pages = {str(p.relative_to(ROOT / "docs")) for p in tracked_files("docs") if p.suffix == ".md"}
    made = {name.removeprefix("docs/") for name in MADE}
    assert pages <= navigation
    missing = navigation - pages - made
    # The chapters of the book are checked by MkDocs.
    assert all(name.startswith("method/") for name in missing), missing

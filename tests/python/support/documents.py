# SPDX-License-Identifier: BSD-3-Clause
"""The Markdown files of the documentation, taken apart: blocks of code, headings, links, tables."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]

#: Languages of blocks that are looked at, not run.
SHOWN = frozenset({"text", "yaml", "json", "csv", "mermaid", "cpp", "toml"})
SHELL = frozenset({"bash", "console"})

_FENCE = re.compile(r"^(?P<indent> *)(?P<ticks>`{3,})\s*(?P<language>[\w+-]*)\s*$")
_MARK = re.compile(r"^\s*<!-- (?P<kind>not run|exit code|check|file): (?P<text>.*?) -->\s*$")
_HEADING = re.compile(r"^(?P<level>#{1,6}) +(?P<title>.+?)(?: +\{.*\})?\s*$")
_MARKED = re.compile(r'<a id="([\w-]+)"></a>')
_COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)


@dataclass(frozen=True)
class Mark:
    """A comment in the source that says how a block is run; readers do not see it."""

    kind: str
    """``not run``, ``exit code`` and ``file`` stand above a block, ``check`` below it."""
    text: str
    line: int


@dataclass
class Block:
    """A fenced block."""

    path: Path
    line: int
    """Of its first line within the fence, from 1."""
    language: str
    text: str
    marks: list[Mark] = field(default_factory=list)

    @property
    def place(self) -> str:
        """File and line for messages."""
        return f"{self.path.relative_to(ROOT)}:{self.line}"

    def mark(self, kind: str) -> str | None:
        """Text of the mark of this kind, None without one."""
        return next((mark.text for mark in self.marks if mark.kind == kind), None)


def read(path: Path) -> str:
    return path.read_text(encoding="utf-8")


def documents() -> list[Path]:
    """README, everything in docs, and the examples' README."""
    return [ROOT / "README.md", *sorted(ROOT.glob("docs/**/*.md")), ROOT / "examples/README.md"]


@lru_cache
def blocks_of(path: Path) -> tuple[Block, ...]:
    """All fenced blocks, with the marks that belong to them."""
    blocks: list[Block] = []
    above: list[Mark] = []
    fence = indent = ""
    for number, line in enumerate(read(path).splitlines(), start=1):
        opening = _FENCE.match(line)
        mark = _MARK.match(line)
        if fence:
            if line.strip() == fence:
                fence = ""
            else:
                blocks[-1].text += line.removeprefix(indent) + "\n"
        elif opening:
            fence, indent = opening["ticks"], opening["indent"]
            blocks.append(Block(path, number + 1, opening["language"], "", above))
            above = []
        elif mark and mark["kind"] == "check":
            blocks[-1].marks.append(Mark("check", mark["text"], number))
        elif mark:
            above.append(Mark(mark["kind"], mark["text"], number))
        elif line.strip() and above:
            raise ValueError(f"{path}:{above[0].line}: no block follows this comment")
    return tuple(blocks)


def prose_of(text: str) -> str:
    """The text with blocks of code and comments blanked out, lines kept."""
    kept, fence = [], ""
    for line in text.splitlines():
        opening = _FENCE.match(line)
        if fence:
            fence = "" if line.strip() == fence else fence
            kept.append("")
        elif opening:
            fence = opening["ticks"]
            kept.append("")
        else:
            kept.append(line)
    return _COMMENT.sub(lambda m: "\n" * m[0].count("\n"), "\n".join(kept))


def headings_of(text: str) -> Iterator[str]:
    for line in prose_of(text).splitlines():
        heading = _HEADING.match(line)
        if heading:
            yield heading["title"]


def anchors_of(text: str) -> set[str]:
    """What a link may point to: GitHub's anchors of the headings, MkDocs', and those marked."""
    anchors = set(_MARKED.findall(prose_of(text)))
    for title in headings_of(text):
        plain = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", title).replace("`", "")
        github = re.sub(r"[^\w\- ]", "", plain.lower()).replace(" ", "-")
        mkdocs = re.sub(r"[-\s]+", "-", re.sub(r"[^\w\s-]", "", plain).strip().lower())
        anchors |= {github, mkdocs}
    return anchors


def table_below(text: str, heading: str) -> list[list[str]]:
    """Rows of the first table below a heading, without its head, cells stripped."""
    lines = iter(text.splitlines())
    for line in lines:
        found = _HEADING.match(line)
        if found and found["title"] == heading:
            break
    else:
        raise ValueError(f"no heading '{heading}'")
    rows: list[list[str]] = []
    for line in lines:
        if line.startswith("|"):
            rows.append(cells_of(line))
        elif rows or _HEADING.match(line):
            break
    return rows[2:]


def cells_of(line: str) -> list[str]:
    """Cells of a row of a table."""
    return [cell.strip().replace("\\|", "|") for cell in re.split(r"(?<!\\)\|", line.strip())[1:-1]]


def code_in(cell: str) -> list[str]:
    """Names in code within a text."""
    return re.findall(r"`([^`]+)`", cell)


def tracked_files(*patterns: str) -> list[Path]:
    """Files that git knows, below the folder of the checkout."""
    listing = subprocess.run(
        ["git", "ls-files", "-z", "--", *patterns], cwd=ROOT, check=True, capture_output=True
    ).stdout.decode()
    return [ROOT / name for name in listing.split("\0") if name]

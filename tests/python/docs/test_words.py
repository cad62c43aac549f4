# SPDX-License-Identifier: BSD-3-Clause
"""What no file of the project says."""

from __future__ import annotations

import re

from support.documents import ROOT, tracked_files

#: References to a text that is not part of the project, by number.
FOREIGN = re.compile(r"\bspec(ification)? ?[0-9]|D[0-9]+-[0-9]+", re.IGNORECASE)
BINARY = {".png", ".bvoc", ".npz", ".npy", ".gz", ".jpg", ".mp4"}
#: What others wrote, and this file, which names what it looks for.
LEFT_OUT = {"CHANGELOG.md", "docs/assets/mermaid.min.js", "tests/python/docs/test_words.py"}


def test_nothing_refers_to_what_is_not_here() -> None:
    found = []
    for path in tracked_files():
        name = str(path.relative_to(ROOT))
        if name in LEFT_OUT or path.suffix in BINARY or not path.is_file():
            continue
        text = path.read_text(encoding="utf-8", errors="replace")
        for number, line in enumerate(text.splitlines(), start=1):
            if FOREIGN.search(line):
                found.append(f"{name}:{number}: {line.strip()}")
    assert not found, "\n".join(found)

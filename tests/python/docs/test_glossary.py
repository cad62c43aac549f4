# SPDX-License-Identifier: BSD-3-Clause
"""The glossary names files and names that exist, in the order of the alphabet."""

from __future__ import annotations

import re

from support.documents import ROOT, code_in, read, table_below

ROWS = table_below(read(ROOT / "docs/glossary.md"), "Glossary")


def test_each_place_in_the_code_exists() -> None:
    wrong = []
    for term, _, place in ROWS:
        path, *names = code_in(place)
        if not (ROOT / path).is_file():
            wrong.append(f"{term}: no file {path}")
            continue
        text = read(ROOT / path)
        wrong += [
            f"{term}: no {name} in {path}" for name in names if not re.search(rf"\b{name}\b", text)
        ]
    assert not wrong, "\n".join(wrong)


def test_terms_are_in_the_order_of_the_alphabet_and_said_in_a_sentence() -> None:
    terms = [row[0].lower() for row in ROWS]
    assert terms == sorted(set(terms))
    assert len(terms) >= 60
    assert all(re.fullmatch(r"[^.]+\.", meaning) for _, meaning, _ in ROWS)

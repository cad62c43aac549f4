# SPDX-License-Identifier: BSD-3-Clause
"""The tables of thresholds in the book say what stands in the code."""

from __future__ import annotations

import ast
import re
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import pytest

from orbslam2py.settings.fit import FitThresholds
from orbslam2py.slam.config import Config
from support.documents import ROOT, cells_of, read

HEADER = ("name in the code", "value")
CHAPTERS = sorted(ROOT.glob("docs/method/*.md"))

_CPP = re.compile(r"^`(?P<name>\w+)` in `(?P<file>[\w/]+\.(?:hpp|cpp))`")
_CONSTANT = re.compile(r"^`(?P<name>_?[A-Z][A-Z_]*)` in `(?P<file>slam/[\w/]+\.py)`")
_PYTHON = re.compile(r"^`(?P<owner>[A-Za-z_]\w*)\.(?P<field>\w+)`$")
_NUMBER = r"[-+]?(?:\d[\d']*\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"


@dataclass(frozen=True)
class Row:
    """A threshold as the book tells it."""

    path: Path
    line: int
    name: str
    value: str

    @property
    def place(self) -> str:
        return f"{self.path.name}:{self.line}: {self.name}"


def rows_of(path: Path) -> list[Row]:
    rows, inside = [], False
    for number, line in enumerate(read(path).splitlines(), start=1):
        if not line.startswith("|"):
            inside = False
            continue
        cells = cells_of(line)
        if tuple(cells[:2]) == HEADER:
            inside = True
        elif inside and not set(cells[0]) <= set("-: "):
            rows.append(Row(path, number, cells[0], cells[1]))
    return rows


def number_in(text: str) -> float | None:
    """The first number of a cell or a literal: ``100 px^2``, ``1e-4``, ``0.8F``, ``1/3``."""
    plain = re.sub(r"[`$\\]", "", text).replace("\N{MINUS SIGN}", "-").replace(" 000", "000")
    fraction = re.match(rf"^\s*({_NUMBER})\s*/\s*({_NUMBER})", plain)
    if fraction:
        return _float(fraction[1]) / _float(fraction[2])
    found = re.search(_NUMBER, plain)
    return _float(found[0]) if found else None


def _float(text: str) -> float:
    return float(text.replace("'", ""))


def literals_of(text: str, name: str) -> list[float]:
    """Numbers that a name is given in C++: after ``=`` or within braces, up to the semicolon."""
    plain = re.sub(r"//[^\n]*", "", text)
    found = []
    for match in re.finditer(rf"\b{name}\b\s*(?:=(?!=)|\{{)([^;{{}}]*)", plain):
        value = match[1].strip()
        found += [float(word == "true") for word in ("true", "false") if value == word]
        found += [_float(n) for n in re.findall(rf"(?<![\w.]){_NUMBER}", value)]
        whole = number_in(value) if "/" in value else None
        found += [] if whole is None else [whole]
    return found


def constants_of(text: str) -> dict[str, float]:
    """Numbers that a Python module gives to names: ``_MOST = 6`` or ``_FEW, _MANY = 2, 10``."""
    found = {}
    for node in ast.parse(text).body:
        if not isinstance(node, ast.Assign):
            continue
        (target,) = node.targets
        names, values = [target], [node.value]
        if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
            names, values = target.elts, node.value.elts
        for name, value in zip(names, values, strict=True):
            if isinstance(value, ast.Constant) and isinstance(value.value, int | float):
                found[ast.unparse(name)] = float(value.value)
    return found


@pytest.fixture(scope="module")
def thresholds() -> dict[str, Any]:
    """Sections of the configuration, and other classes of thresholds, by their names."""
    sections = {field.name: getattr(Config(), field.name) for field in fields(Config)}
    return {**sections, "FitThresholds": FitThresholds()}


@pytest.mark.parametrize("path", CHAPTERS, ids=lambda p: p.stem)
def test_thresholds_of_the_core(path: Path) -> None:
    wrong = []
    for row in rows_of(path):
        named = _CPP.match(row.name)
        if named is None:
            continue
        source = ROOT / "src/cpp" / named["file"]
        told = number_in(row.value)
        if not source.is_file():
            wrong.append(f"{row.place}: no such file")
        elif told is None:
            wrong.append(f"{row.place}: no number in '{row.value}'")
        else:
            code = literals_of(read(source), named["name"])
            if not any(abs(told - value) <= 1e-9 * max(1.0, abs(value)) for value in code):
                wrong.append(f"{row.place}: the book says {told:g}, the code {code}")
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("path", CHAPTERS, ids=lambda p: p.stem)
def test_thresholds_of_python(path: Path, thresholds: dict[str, Any]) -> None:
    wrong = []
    for row in rows_of(path):
        named = _PYTHON.match(row.name)
        if named is None:
            continue
        owner = thresholds.get(named["owner"])
        defaults = {} if owner is None else asdict(owner)
        if named["field"] not in defaults:
            wrong.append(f"{row.place}: no such field")
        elif number_in(row.value) != pytest.approx(float(defaults[named["field"]])):
            wrong.append(f"{row.place}: '{row.value}', the code {defaults[named['field']]}")
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("path", CHAPTERS, ids=lambda p: p.stem)
def test_constants_of_python(path: Path) -> None:
    wrong = []
    for row in rows_of(path):
        named = _CONSTANT.match(row.name)
        if named is None:
            continue
        source = ROOT / "src/orbslam2py" / named["file"]
        code = constants_of(read(source)) if source.is_file() else {}
        if number_in(row.value) != pytest.approx(code.get(named["name"])):
            wrong.append(f"{row.place}: '{row.value}', the code {code.get(named['name'])}")
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("path", CHAPTERS, ids=lambda p: p.stem)
def test_names_of_thresholds_are_of_a_known_form(path: Path) -> None:
    """A typing error must not turn a row into one that nothing checks."""
    forms = (_CPP, _CONSTANT, _PYTHON)
    odd = [
        row.place
        for row in rows_of(path)
        if row.name.startswith("`") and not any(form.match(row.name) for form in forms)
    ]
    assert not odd, f"neither a name in a file nor section.field: {odd}"


def test_numbers_are_read() -> None:
    assert number_in("100 px^2") == 100
    assert number_in("`1e-4`") == 1e-4
    assert number_in("1/3 of the image") == pytest.approx(1 / 3)
    assert number_in("$-0.5$ degrees") == -0.5
    assert number_in("none") is None
    text = "double ratio = 0.8;\n  int k_most{1'000};\n  if (ratio == 2) {}\n  bool on = true;"
    assert literals_of(text, "ratio") == [0.8]
    assert literals_of(text, "k_most") == [1000]
    assert literals_of(text, "on") == [1]
    assert literals_of("const double k = std::log(1.5);", "k") == [1.5]
    assert literals_of("Options ransac{0.99, 10};  // 7", "ransac") == [0.99, 10]
    assert constants_of("_MOST = 6\n_FEW, MANY = 2, 1.5  # frames\n_X = f(3)\n") == {
        "_MOST": 6,
        "_FEW": 2,
        "MANY": 1.5,
    }
    assert literals_of("using Eight = std::array<int, 8>;", "Eight") == [8]

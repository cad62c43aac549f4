# SPDX-License-Identifier: BSD-3-Clause
"""Figures as files: the format that a name asks for, and letters that the usual font has not."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
from matplotlib import font_manager
from matplotlib.figure import Figure

from orbslam2py import _figures
from orbslam2py._figures import PICTURE_ENDINGS, check_picture_name, write_figure
from orbslam2py.errors import OutputFileError
from support.files import names_in
from support.fonts import write_font

pytestmark = pytest.mark.watchdog(30)


def figure(text: str) -> Figure:
    made = Figure(figsize=(4, 1), dpi=100)
    made.suptitle(text, parse_math=False, x=0.0, ha="left", fontsize=20)
    return made


def drawn(path: Path, text: str) -> np.ndarray:
    """The picture of a text; nothing may be said about it anywhere."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        write_figure(path, figure(text))
    picture = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    assert picture is not None
    return np.asarray(picture)


# ---- formats -------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("name", "begin"),
    [
        ("a.png", b"\x89PNG"),
        ("a", b"\x89PNG"),
        ("a.PNG", b"\x89PNG"),
        ("a.jpg", b"\xff\xd8\xff"),
        ("a.jpeg", b"\xff\xd8\xff"),
        ("a.webp", b"RIFF"),
        ("a.tif", b"II*\0"),
        ("a.pdf", b"%PDF"),
        ("a.svg", b"<?xml"),
    ],
)
def test_the_ending_tells_the_format(tmp_path: Path, name: str, begin: bytes) -> None:
    check_picture_name(tmp_path / name)
    write_figure(tmp_path / name, figure("words"))
    assert (tmp_path / name).read_bytes().startswith(begin)
    assert names_in(tmp_path) == [name]


@pytest.mark.parametrize("name", ["a.bmp", "a.html", "run.2024"])
def test_other_endings_are_refused(tmp_path: Path, name: str) -> None:
    for refuse in (check_picture_name, lambda path: write_figure(path, figure("words"))):
        with pytest.raises(OutputFileError) as refused:
            refuse(tmp_path / name)
        assert f"{tmp_path / name} cannot be a picture" in str(refused.value)
        for ending in PICTURE_ENDINGS:
            assert ending in str(refused.value)
    assert names_in(tmp_path) == []


# ---- letters -------------------------------------------------------------------------------------
@pytest.fixture
def no_other_fonts(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Those that Matplotlib brings along, whatever the computer has."""
    own = [e for e in font_manager.fontManager.ttflist if "mpl-data" in e.fname]
    monkeypatch.setattr(font_manager.fontManager, "ttflist", own)
    monkeypatch.setattr(font_manager, "findSystemFonts", lambda: [])
    search = _figures._fonts_with
    search.cache_clear()
    yield
    search.cache_clear()


@pytest.mark.usefixtures("no_other_fonts")
def test_letters_that_no_font_has_are_boxes(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, capfd: pytest.CaptureFixture[str]
) -> None:
    caplog.set_level(logging.WARNING)
    boxes = drawn(tmp_path / "a.png", "\u25a1\u25a1 lap")
    assert (drawn(tmp_path / "b.png", "日本 lap") == boxes).all()
    assert (drawn(tmp_path / "c.png", "\udce9\udce9 lap") == boxes).all(), "bytes of a name"
    assert not caplog.records
    assert capfd.readouterr() == ("", "")


@pytest.mark.usefixtures("no_other_fonts")
def test_signs_without_a_shape_leave_no_box(tmp_path: Path) -> None:
    plain = drawn(tmp_path / "a.png", "a b")
    for text in ("a\tb", "a\u200d\ufe0f b", "\x07a b"):
        assert (drawn(tmp_path / "b.png", text) == plain).all(), ascii(text)


@pytest.mark.usefixtures("no_other_fonts")
def test_usual_letters_need_no_look_at_other_fonts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_figures, "_fonts_with", None)
    for text in ("Straße, Ærø, Łódź, Москва, Ελλάδα: 5 °", "two\nlines $and_ dollars$"):
        assert drawn(tmp_path / "a.png", text).min() < 100


@pytest.mark.usefixtures("no_other_fonts")
@pytest.mark.parametrize(("known", "weight"), [(True, 400), (False, 400), (True, 500)])
def test_a_font_that_has_them_is_taken(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    known: bool,
    weight: int,
) -> None:
    """Also one that was installed after Matplotlib made its list of fonts, or is of one weight."""
    caplog.set_level(logging.WARNING)
    path = write_font(tmp_path / "made-up.ttf", "日本", weight)
    boxes = drawn(tmp_path / "boxes.png", "日本 lap")
    if known:
        font_manager.fontManager.addfont(str(path))
    else:
        monkeypatch.setattr(font_manager, "findSystemFonts", lambda: [str(path)])
    _figures._fonts_with.cache_clear()
    shown = drawn(tmp_path / "a.png", "日本 lap")
    # The made-up letters are black all over.
    assert (shown < 50).sum() > 2 * (boxes < 50).sum()
    mixed = drawn(tmp_path / "b.png", "日本\u7532 lap")
    assert (mixed < 50).sum() > (shown < 50).sum(), "a box for the one that it has not"
    assert not caplog.records


def test_nothing_is_said_of_the_fonts_of_this_computer(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Some have no letters of the usual weight."""
    caplog.set_level(logging.WARNING)
    _figures._fonts_with.cache_clear()
    drawn(tmp_path / "a.png", "日本 \U00012345 lap")
    assert not caplog.records

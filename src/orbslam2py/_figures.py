# SPDX-License-Identifier: BSD-3-Clause
"""Figures of Matplotlib as files: formats by name, and letters of all scripts."""

from __future__ import annotations

import contextlib
import logging
import unicodedata
from collections.abc import Iterator
from functools import lru_cache
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from orbslam2py._files import atomic_write
from orbslam2py.errors import OutputFileError

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.ft2font import FT2Font
    from matplotlib.text import Text

#: What pictures are written as, by the endings of their names; without one it is PNG.
_FORMATS: dict[str, str] = {
    ".png": "png",
    ".jpg": "jpeg",
    ".jpeg": "jpeg",
    ".webp": "webp",
    ".tif": "tiff",
    ".tiff": "tiff",
    ".svg": "svg",
    ".pdf": "pdf",
}
PICTURE_ENDINGS = tuple(_FORMATS)
#: Lines and letters fray at the usual quality.
_MORE: dict[str, dict[str, Any]] = {"jpeg": {"pil_kwargs": {"quality": 92}}}

#: Stands for a letter that no font has.
_BOX = "\u25a1"
#: Fonts that show every letter, but only that there is one, and fonts of formulas.
_NO_TEXT = ("Last Resort", "STIX", "cm", "KaTeX")
#: Taken first where several have a letter.
_SANS = ("sans", "gothic", "hei")


def check_picture_name(path: Path, option: str = "") -> None:
    """Check that a picture can be written under a name, before it is drawn.

    Parameters
    ----------
    path
        The file.
    option
        Name of the option or argument, for the message.

    Raises
    ------
    OutputFileError
        If the suffix is of no known format of pictures.
    """
    _format_of(path, option)


def write_figure(path: str | PathLike[str], figure: Figure, *, dpi: float | None = None) -> None:
    """Write a figure; the suffix of the name determines the format, PNG without one.

    Letters that are missing in the font of a text are taken from another font of the computer; a
    box replaces letters that no font has.

    Parameters
    ----------
    path
        The file.
    figure
        The figure.
    dpi
        Pixels per inch; by default those of the figure.

    Raises
    ------
    OutputFileError
        If the suffix is of no known format of pictures.
    OSError
        If the file cannot be written.
    """
    from matplotlib.text import Text  # noqa: PLC0415  (large; who draws has loaded it)

    file_format = _format_of(Path(path))
    more = _MORE.get(file_format, {})
    with _no_word_of_fonts(), atomic_write(path, binary=True) as stream:
        for text in figure.findobj(Text, include_self=False):
            assert isinstance(text, Text)
            if not text.get_text().isascii() or not text.get_text().isprintable():
                _spell(text)
        figure.savefig(stream, format=file_format, dpi="figure" if dpi is None else dpi, **more)


def _format_of(path: Path, option: str = "") -> str:
    if path.suffix and path.suffix.lower() not in _FORMATS:
        named = f"{option} {path}" if option else f"{path}"
        raise OutputFileError(
            f"{named} cannot be a picture: those are written as {', '.join(PICTURE_ENDINGS)}; give "
            "it one of these endings"
        )
    return _FORMATS[path.suffix.lower() or ".png"]


@contextlib.contextmanager
def _no_word_of_fonts() -> Iterator[None]:
    """Suppress warnings on the terminal about fonts without letters of the usual weight."""

    def is_of_something_else(record: logging.LogRecord) -> bool:
        return not record.getMessage().startswith("findfont:")

    logger = logging.getLogger("matplotlib.font_manager")
    logger.addFilter(is_of_something_else)
    try:
        yield
    finally:
        logger.removeFilter(is_of_something_else)


def _spell(text: Text) -> None:
    """Give a text the fonts that it needs, and boxes for letters that no font has."""
    from matplotlib import font_manager  # noqa: PLC0415
    from matplotlib.ft2font import FT2Font  # noqa: PLC0415

    usual = FT2Font(font_manager.findfont(text.get_fontproperties()))
    letters = "".join(map(_visible, text.get_text()))
    missing = frozenset(letter for letter in letters if not _has(usual, letter))
    if missing:
        families = _fonts_with(missing)
        text.set_fontfamily([*text.get_fontfamily(), *(name for name, _ in families)])
        known = frozenset[str]().union(*(its_letters for _, its_letters in families))
        nowhere = missing - known
        letters = "".join(_BOX if letter in nowhere else letter for letter in letters)
    text.set_text(letters)


def _visible(letter: str) -> str:
    """Return a letter for drawing: no letters without a shape, and no tabs."""
    if letter == "\n" or letter.isprintable():
        # What only changes the letter before it is left out as well if it is no letter's mark.
        return "" if "\ufe00" <= letter <= "\ufe0f" else letter
    kind = unicodedata.category(letter)
    if letter == "\t" or kind.startswith("Z"):
        return " "
    return "" if kind in ("Cc", "Cf") else letter


def _has(font: FT2Font, letter: str) -> bool:
    return letter == "\n" or font.get_char_index(ord(letter)) != 0


@lru_cache(maxsize=64)
def _fonts_with(letters: frozenset[str]) -> tuple[tuple[str, frozenset[str]], ...]:
    """Return families of fonts, each with the letters that no earlier one has.

    Letters that no font has are left out.
    """
    left = set(letters)
    found: list[tuple[str, frozenset[str]]] = []
    looked_at: set[str] = set()
    for families in (_families, _families_of_new_fonts):
        for family in sorted(families() - looked_at, key=_preference) if left else ():
            looked_at.add(family)
            its_letters = frozenset(_letters_of(family, left))
            if its_letters:
                found.append((family, its_letters))
                left -= its_letters
    return tuple(found)


def _families() -> set[str]:
    from matplotlib import font_manager  # noqa: PLC0415

    names = {entry.name for entry in font_manager.fontManager.ttflist}
    return {name for name in names if not name.startswith(_NO_TEXT)}


def _families_of_new_fonts() -> set[str]:
    """Return all families, with fonts that are newer than Matplotlib's list."""
    from matplotlib import font_manager  # noqa: PLC0415

    manager = font_manager.fontManager
    known = {entry.fname for entry in manager.ttflist}
    for path in font_manager.findSystemFonts():
        if path not in known:
            with contextlib.suppress(OSError, RuntimeError, ValueError):  # of an unknown kind
                manager.addfont(path)
    return _families()


def _preference(family: str) -> tuple[bool, str]:
    return not any(word in family.lower() for word in _SANS), family


def _letters_of(family: str, letters: set[str]) -> set[str]:
    """Return which letters a family has in its regular font."""
    from matplotlib import font_manager  # noqa: PLC0415
    from matplotlib.ft2font import FT2Font  # noqa: PLC0415

    try:
        wanted = font_manager.FontProperties(family=[family])
        font = FT2Font(font_manager.findfont(wanted, fallback_to_default=False))
    except (OSError, RuntimeError, ValueError):  # a file that is gone, or no font that is known
        return set()
    return {letter for letter in letters if font.scalable and _has(font, letter)}

# SPDX-License-Identifier: BSD-3-Clause
"""Safe HTML: all text that is not markup is escaped."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

#: Elements without content, which have no end tag.
_VOID = frozenset(["img", "input", "br"])


class Markup(str):
    """Text that is HTML already."""

    __slots__ = ()


def element(name: str, *content: str | None, **attributes: str | float | bool | None) -> Markup:
    """Make an element.

    Parameters
    ----------
    name
        Of the element.
    content
        Its contents in order: `Markup` unchanged, other text escaped, None left out.
    attributes
        ``class_`` and the like lose the last ``_``; other ``_`` become ``-``. None and False omit
        an attribute, True gives it no value.

    Returns
    -------
    Markup
    """
    said = [f"<{name}"]
    for key, value in attributes.items():
        if value is None or value is False:
            continue
        label = key.rstrip("_").replace("_", "-")
        said.append(f" {label}" if value is True else f' {label}="{escape(str(value))}"')
    said.append(">")
    if name not in _VOID:
        said.append(join(*content))
        said.append(f"</{name}>")
    return Markup("".join(said))


def join(*content: str | None) -> Markup:
    """Join markup and text; text is escaped, None left out."""
    parts = (part for part in content if part is not None)
    return Markup("".join(p if isinstance(p, Markup) else escape(p) for p in parts))


def table(head: Sequence[str], rows: Sequence[Sequence[str]], *, class_: str = "") -> Markup:
    """Make a table with its own scroll bar if it is too wide."""
    cells = [element("th", text, scope="col") for text in head]
    lines = [element("tr", *(element("td", cell) for cell in row)) for row in rows]
    body = join(element("thead", element("tr", *cells)) if head else None, element("tbody", *lines))
    return element("div", element("table", body, class_=class_ or None), class_="wide")


def section(name: str, title: str, *content: Markup | None) -> Markup:
    """A part of the page with a heading that can be linked to."""
    return element("section", element("h2", title), *content, id=name)

# SPDX-License-Identifier: BSD-3-Clause
"""The list of maps: colours, and which of them are shown."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from orbslam2py._arguments import number_of
from orbslam2py._palette import map_colour

if TYPE_CHECKING:
    import viser

_NOTE = (
    "Maps that are not merged have their own world frames: their relative position has no meaning."
)


@dataclass(frozen=True)
class MapLine:
    """The text about a map."""

    number: int
    is_active: bool
    n_keyframes: int
    n_points: int

    @property
    def text(self) -> str:
        """Number, state and size."""
        state = "active" if self.is_active else "rests"
        size = f"{number_of(self.n_keyframes, 'keyframe')}, {number_of(self.n_points, 'point')}"
        return f"map {self.number}, {state}: {size}"


class MapsPanel:
    """A list of the maps with a switch for each; shown only if there are several.

    Parameters
    ----------
    server : viser.ViserServer
        The page.
    on_switch : callable
        Called with the number of a map, and whether to show it.
    """

    def __init__(self, server: viser.ViserServer, on_switch: Callable[[int, bool], None]) -> None:
        self._gui = server.gui
        self._on_switch = on_switch
        self._folder = self._gui.add_folder("Maps", order=-0.5, visible=False)
        with self._folder:
            self._list = self._gui.add_html("")
        self._switches: dict[int, Any] = {}
        self._hidden: set[int] = set()

    def show(self, lines: list[MapLine]) -> None:
        """Show which maps exist, the oldest first."""
        several = len(lines) > 1
        if self._folder.visible != several:
            self._folder.visible = several
        numbers = {line.number for line in lines} if several else set()
        for number in set(self._switches) - numbers:
            self._switches.pop(number).remove()
        for number in sorted(numbers - set(self._switches)):
            self._add_switch(number)
        if several:
            content = _legend(lines)
            if self._list.content != content:
                self._list.content = content

    def _add_switch(self, number: int) -> None:
        with self._folder:
            switch = self._gui.add_checkbox(
                f"Show map {number}", number not in self._hidden, order=float(number + 10)
            )
        self._switches[number] = switch

        def switched(_: object) -> None:
            (self._hidden.discard if switch.value else self._hidden.add)(number)
            self._on_switch(number, switch.value)

        switch.on_update(switched)


def _legend(lines: list[MapLine]) -> str:
    rows = "".join(
        f'<div><span style="display:inline-block;width:0.8em;height:0.8em;border-radius:50%;'
        f'background:rgb{map_colour(line.number)};margin-right:0.4em"></span>'
        f"{'<b>' if line.is_active else ''}{line.text}{'</b>' if line.is_active else ''}</div>"
        for line in lines
    )
    style = "font-size:0.8em;padding:0.4em;line-height:1.6"
    return f'<div style="{style}">{rows}<div style="opacity:0.8">{_NOTE}</div></div>'

# SPDX-License-Identifier: BSD-3-Clause
"""Switches and buttons of the page, and their requests."""

from __future__ import annotations

import html
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol

from orbslam2py import _palette as palette
from orbslam2py._palette import Colour
from orbslam2py.viewer.follow import Follow
from orbslam2py.viewer.point_colours import ColourBy
from orbslam2py.viewer.scene import HIDDEN, LAYERS

if TYPE_CHECKING:
    import viser

#: What each colour means, beside the switches of the layers.
_COLOURS: dict[str, Colour] = {
    "points": palette.POINTS,
    "local": palette.LOCAL_POINTS,
    "keyframes": palette.KEYFRAME,
    "covisibility": palette.COVISIBILITY,
    "tree": palette.SPANNING_TREE,
    "loops": palette.LOOP,
    "camera": palette.CAMERA,
    "path": palette.PATH,
    "online": palette.ONLINE_PATH,
    "truth": palette.TRUTH,
}


class SystemActions(Protocol):
    """Requests of the user to a system. Each returns a message for the page, or None."""

    def set_localization(self, wanted: bool) -> str | None:
        """Switch localization mode."""
        ...

    def reset(self) -> str | None:
        """Begin a new map with the next image."""
        ...

    def optimize(self) -> str | None:
        """Run full bundle adjustment of the whole map now."""
        ...

    def save(self) -> str | None:
        """Write the map to a file."""
        ...


class RunActions(Protocol):
    """Requests of the user to a run; as `orbslam2py.runs.RunControl`."""

    @property
    def paused(self) -> bool:
        """Whether it stands still."""
        ...

    def pause(self) -> None:
        """Let it stand still."""
        ...

    def resume(self) -> None:
        """Let it go on."""
        ...

    def step(self) -> None:
        """Take one frame."""
        ...


class ViewActions(Protocol):
    """Requests of the user for the picture."""

    def show_layer(self, layer: str, visible: bool) -> None:
        """Show or hide a layer."""
        ...

    def follow(self, mode: Follow) -> None:
        """Move the view with the camera, or not."""
        ...

    def set_distance(self, factor: float) -> None:
        """Follow from a larger or smaller distance."""
        ...

    def show_all(self, client: viser.ClientHandle) -> None:
        """Show the whole map in a browser."""
        ...

    def set_point_size(self, factor: float) -> None:
        """Draw points larger or smaller."""
        ...

    def colour_by(self, what: ColourBy) -> None:
        """Choose the colours of points."""
        ...


def add_view_controls(server: viser.ViserServer, view: ViewActions) -> None:
    """Add the controls of the picture."""
    gui = server.gui
    with gui.add_folder("View"):
        follow = gui.add_dropdown(
            "Follow", [str(mode) for mode in Follow], initial_value=str(Follow.BEHIND)
        )
        distance = gui.add_slider("Distance", min=0.2, max=5.0, step=0.1, initial_value=1.0)
        colour = gui.add_dropdown(
            "Colour", [str(what) for what in ColourBy], initial_value=str(ColourBy.IMAGE)
        )
        size = gui.add_slider("Point size", min=0.2, max=5.0, step=0.1, initial_value=1.0)
        everything = gui.add_button("Whole map")
    with gui.add_folder("Layers"):
        switches = {
            layer: gui.add_checkbox(label, layer not in HIDDEN) for layer, label in LAYERS.items()
        }
        gui.add_html(_legend())

    follow.on_update(lambda _: view.follow(Follow(follow.value)))
    distance.on_update(lambda _: view.set_distance(distance.value))
    colour.on_update(lambda _: view.colour_by(ColourBy(colour.value)))
    size.on_update(lambda _: view.set_point_size(size.value))

    @everything.on_click
    def show_all(event: viser.GuiEvent[Any]) -> None:
        switch: Any = follow
        switch.value = str(Follow.FREE)
        if event.client is not None:
            view.show_all(event.client)

    for layer, switch in switches.items():
        switch.on_update(_shower(view, layer, switch))


def _shower(view: ViewActions, layer: str, switch: Any) -> Callable[[object], None]:
    return lambda _: view.show_layer(layer, switch.value)


def _legend() -> str:
    chips = "".join(
        f'<span style="white-space:nowrap;margin-right:0.8em"><span style="display:inline-block;'
        f"width:0.7em;height:0.7em;border-radius:50%;background:rgb{_COLOURS[layer]};"
        f'margin-right:0.3em"></span>{html.escape(label.lower())}</span> '
        for layer, label in LAYERS.items()
    )
    return f'<div style="font-size:0.75em;opacity:0.85;padding:0.4em;line-height:1.6">{chips}</div>'


class SystemControls:
    """Controls of the system: mode, reset, optimize, save.

    Parameters
    ----------
    server : viser.ViserServer
        The page.
    actions : SystemActions
        The requests.
    """

    def __init__(self, server: viser.ViserServer, actions: SystemActions) -> None:
        gui = server.gui
        with gui.add_folder("System", order=-1.0):
            self._localization = gui.add_checkbox(
                "Localization",
                False,
                hint="Poses only: the map does not change.",
            )
            optimize = gui.add_button("Optimize", hint="Refine all keyframes and points together.")
            reset = gui.add_button("Reset", color="red", hint="Begin a new map.")
            save = gui.add_button("Save map", hint="Write it into the folder runs.")
        self._localization.on_update(
            lambda event: _ask(event, lambda: actions.set_localization(self._localization.value))
        )
        optimize.on_click(lambda event: _ask(event, actions.optimize))
        reset.on_click(lambda event: _ask(event, actions.reset))
        save.on_click(lambda event: _ask(event, actions.save))

    def show_localization(self, wanted: bool) -> None:
        """Update the switch after a change from elsewhere."""
        switch: Any = self._localization
        if switch.value != wanted:
            switch.value = wanted


def _ask(event: viser.GuiEvent[Any], action: Callable[[], str | None]) -> None:
    if event.client is None:
        return  # changed by us, not by a person
    told = action()
    if told:
        event.client.add_notification("orbslam2py", told, auto_close_seconds=8.0)


class RunControls:
    """Controls of a recorded run: pause, single steps, stop.

    Parameters
    ----------
    server : viser.ViserServer
        The page.
    run : RunActions, optional
        Without it, the run cannot be paused.
    stop : callable, optional
        Ends it.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        run: RunActions | None,
        stop: Callable[[], None] | None,
    ) -> None:
        gui = server.gui
        self._run = run
        with gui.add_folder("Run", order=-2.0):
            self._pause = gui.add_button("Pause", visible=run is not None)
            step = gui.add_button(
                "Single step", visible=run is not None, hint="Take one image and stand still."
            )
            self._stop = gui.add_button(
                "Stop", color="red", visible=stop is not None, hint="End the run; results are kept."
            )
        self._buttons = (self._pause, step, self._stop)
        self._pause.on_click(lambda _: self._toggle())
        step.on_click(lambda _: self._step())
        if stop is not None:
            self._stop.on_click(lambda _: stop())

    def end(self) -> None:
        """Disable all requests: the run has ended."""
        for button in self._buttons:
            button.disabled = True

    def _toggle(self) -> None:
        assert self._run is not None
        if self._run.paused:
            self._run.resume()
        else:
            self._run.pause()
        self._show()

    def _step(self) -> None:
        assert self._run is not None
        self._run.step()
        self._show()

    def _show(self) -> None:
        assert self._run is not None
        self._pause.label = "Go on" if self._run.paused else "Pause"

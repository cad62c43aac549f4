# SPDX-License-Identifier: BSD-3-Clause
"""Services of a running system: save the map, localize, reset."""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path

from orbslam2py.errors import OrbSlamError
from orbslam2py.ros.transport import NODE, Transport
from orbslam2py.ros.types import SET_BOOL, TRIGGER, message_class, to_cdr
from orbslam2py.slam.system import System

_log = logging.getLogger(__name__)

#: Position of the one number of a request, behind the four bytes of the byte order.
_DATA = 4


def serve(transport: Transport, system: System, map_path: Path) -> None:
    """Answer ``save_map`` and ``reset`` (Trigger) and ``localize`` (SetBool) until the end.

    Parameters
    ----------
    transport
        The connection.
    system
        The system that answers.
    map_path
        File that the map is saved in.
    """

    def save(_: bool) -> str:
        system.save_map(map_path)
        return f"saved in {map_path.resolve()}"

    def reset(_: bool) -> str:
        system.reset()
        return "the next image begins a new map"

    def localize(wanted: bool) -> str:
        system.localization_mode = wanted
        return "the map stays as it is" if wanted else "the map grows"

    services = (("save_map", TRIGGER, save), ("reset", TRIGGER, reset))
    for name, kind, do in (*services, ("localize", SET_BOOL, localize)):
        transport.serve(f"/{NODE}/{name}", kind, _answer(name, kind, do))


def _answer(name: str, kind: str, do: Callable[[bool], str]) -> Callable[[bytes], bytes]:
    def answer(request: bytes) -> bytes:
        wanted = len(request) > _DATA and request[_DATA] != 0
        try:
            done, text = True, do(wanted)
        except OrbSlamError as error:
            done, text = False, str(error)
        _log.info("service %s: %s", name, text)
        return to_cdr(message_class(f"{kind}_Response")(done, text))

    return answer

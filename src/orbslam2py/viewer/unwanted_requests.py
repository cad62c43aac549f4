# SPDX-License-Identifier: BSD-3-Clause
"""Requests of other programs than the page: refused without a log message."""

from __future__ import annotations

import logging
import traceback
from types import TracebackType

_log = logging.getLogger(__name__)

#: Where the library under viser tells, with a traceback, of whatever it could make nothing of.
_LIBRARY = logging.getLogger("websockets.server")
#: What reads the messages of a page: an error that comes out of it is that of who sent one.
_READER = "_message_consumer"


class UnwantedRequests(logging.Filter):
    """Keeps errors about foreign requests out of the log.

    The library closes the connection and continues to serve. Our own errors, for example of a
    button, are logged as usual, and so are messages of other servers in this program.

    Parameters
    ----------
    port
        Of the server.
    """

    def __init__(self, port: int) -> None:
        super().__init__()
        self._port = port
        _LIBRARY.addFilter(self)

    def stop(self) -> None:
        """Log everything again; may be called again."""
        _LIBRARY.removeFilter(self)

    def filter(self, record: logging.LogRecord) -> bool:
        """Return whether a record is logged."""
        if not (self._is_of_server(record) and _is_of_sender(record)):
            return True
        _log.debug("%s", record.getMessage(), exc_info=record.exc_info)
        return False

    def _is_of_server(self, record: logging.LogRecord) -> bool:
        address = getattr(getattr(record, "websocket", None), "local_address", None)
        return isinstance(address, tuple) and address[1:2] == (self._port,)


def _is_of_sender(record: logging.LogRecord) -> bool:
    if record.msg == "opening handshake failed":
        return True
    trace = record.exc_info[2] if record.exc_info else None
    return record.msg == "connection handler failed" and _went_through(trace, _READER)


def _went_through(trace: TracebackType | None, function: str) -> bool:
    return any(frame.f_code.co_name == function for frame, _ in traceback.walk_tb(trace))

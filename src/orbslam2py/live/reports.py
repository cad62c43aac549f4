# SPDX-License-Identifier: BSD-3-Clause
"""Messages of a live source to its user, without endless repetition."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

_log = logging.getLogger(__name__)

#: Seconds between two messages of one kind.
_PAUSE = 10.0
#: Most messages that the report of a run lists.
_MOST_LISTED = 50


@dataclass
class _Kind:
    said: float
    n_unsaid: int = 0


class Reports:
    """Logs warnings about a source, and keeps them for the report of the run.

    Parameters
    ----------
    name
        Name of the source: all messages begin with it.
    monotonic
        Clock for the pauses, seconds.
    """

    def __init__(self, name: str, monotonic: Callable[[], float] = time.monotonic) -> None:
        self._name = name
        self._monotonic = monotonic
        self._kinds: dict[str, _Kind] = {}
        self._listed: list[str] = []
        self._n_unlisted = 0
        self._lock = threading.Lock()

    def warn(self, kind: str, text: str) -> None:
        """Log a warning; of one kind only one in ten seconds, with the number of those between.

        Parameters
        ----------
        kind
            Kind of message that is not repeated during the pause.
        text
            The end of a sentence that begins with the name of the source.
        """
        now = self._monotonic()
        with self._lock:
            before = self._kinds.get(kind)
            if before is not None and now < before.said + _PAUSE:
                before.n_unsaid += 1
                return
            again = f" ({before.n_unsaid} times more)" if before and before.n_unsaid else ""
            self._kinds[kind] = _Kind(now)
            if before is None:
                self._list(f"{self._name} {text}")
        _log.warning("%s %s%s", self._name, text, again)

    def event(self, text: str) -> None:
        """Log a warning that is never left out, such as a lost device."""
        with self._lock:
            self._list(f"{self._name} {text}")
        _log.warning("%s %s", self._name, text)

    def info(self, text: str) -> None:
        """Log a message that is no problem."""
        _log.info("%s %s", self._name, text)

    def listed(self) -> list[str]:
        """Whole sentences for the report: each event, and the first warning of each kind."""
        with self._lock:
            more = self._n_unlisted
            return [*self._listed, *([f"{self._name}: {more} more events"] if more else [])]

    def _list(self, sentence: str) -> None:
        if len(self._listed) < _MOST_LISTED:
            self._listed.append(sentence)
        else:
            self._n_unlisted += 1

# SPDX-License-Identifier: BSD-3-Clause
"""Exceptions of the package.

Every message names the fault and the remedy.
"""

from __future__ import annotations


class OrbSlamError(Exception):
    """Base of all errors of this package."""


class SettingsError(OrbSlamError):
    """A setting is missing, misspelt or out of range."""


class DatasetError(OrbSlamError):
    """A data set or trajectory file is missing, incomplete or malformed."""


class VocabularyError(OrbSlamError):
    """A vocabulary file cannot be read or is inconsistent."""


class MapFileError(OrbSlamError):
    """A map file cannot be read or is inconsistent."""


class OutputFileError(OrbSlamError):
    """An output file cannot be written: a video, a page, settings."""


class ImageError(OrbSlamError):
    """An image is unreadable, empty, of the wrong type or of an unexpected size."""


class StateError(OrbSlamError):
    """A call that is not possible in the present state (wrong sensor, concurrent call)."""


class WorkerError(OrbSlamError):
    """A background worker failed; the original exception is the cause."""

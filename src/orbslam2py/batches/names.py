# SPDX-License-Identifier: BSD-3-Clause
"""Names of the folders of runs.

Batches resume by folder name, so existing names must stay stable.
"""

from __future__ import annotations

import hashlib
import re
import unicodedata
from collections.abc import Iterable
from typing import Any

#: Bytes of a name on the usual file systems, where letters beyond ASCII have several.
_LONGEST = 255
#: Bytes that are kept of longer ones: with fingerprint and the largest seed they are less than 120.
_KEPT = 80
#: Digits of the fingerprints in names.
DIGITS = 12
#: Characters that are allowed in names of files, beside letters and digits.
SIGNS = "_.=+"


def label_of_parts(parts: Iterable[str], values: Iterable[tuple[str, Any]], *, exact: bool) -> str:
    """Join names and values of a run, without empty ones.

    Parameters
    ----------
    parts
        Names.
    values
        Options and parameters by name.
    exact
        Write all digits of numbers, not only six.
    """
    named = [f"{name}={_short(value, exact=exact)}" for name, value in values]
    return "-".join(plain_name(part) for part in (*parts, *named) if part)


def key_of(label: str, seed: int) -> str:
    """Name the folder of a run; a name that is too long ends with a fingerprint."""
    key = f"{label}-seed{seed}"
    if len(key.encode()) <= _LONGEST:
        return key
    fingerprint = hashlib.sha256(label.encode()).hexdigest()[:DIGITS]
    kept = label.encode()[:_KEPT].decode(errors="ignore")  # no half of a letter
    return f"{kept}-{fingerprint}-seed{seed}"


def _short(value: Any, *, exact: bool) -> str:
    if isinstance(value, float):
        return repr(value) if exact else f"{value:g}"
    return str(value).lower()


def plain_name(text: str) -> str:
    """Keep only harmless characters of file names: letters and digits of any script, few signs.

    Letters with accents become one character each, because some file systems do not distinguish
    both forms.
    """
    if not text.isascii():
        text = unicodedata.normalize("NFC", text)
        pairs = zip(f" {text}", text, strict=False)
        text = "".join(letter if _is_harmless(letter, before) else "/" for before, letter in pairs)
        return re.sub("/+", "_", text)
    return re.sub(r"[^A-Za-z0-9_.=+]+", "_", text)


def _is_harmless(letter: str, before: str) -> bool:
    """Return whether a character may follow another one, such as a mark of a letter."""
    if _is_mark(letter):
        return before.isalnum() or _is_mark(before)
    return letter.isalnum() or letter in SIGNS


def _is_mark(letter: str) -> bool:
    return unicodedata.category(letter).startswith("M")

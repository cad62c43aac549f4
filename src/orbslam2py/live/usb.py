# SPDX-License-Identifier: BSD-3-Clause
"""Devices on the USB (Linux): whether one is plugged in that its library does not show."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

_SYSTEM = Path("/sys/bus/usb/devices")
_FILES = Path("/dev/bus/usb")


@dataclass(frozen=True)
class UsbDevice:
    """A device as the system describes it.

    Attributes
    ----------
    product
        Its name.
    file
        Its device file.
    is_allowed
        Whether this user may read and write the file.
    """

    product: str
    file: Path
    is_allowed: bool


def find_usb(vendors: tuple[str, ...], word: str = "") -> list[UsbDevice]:
    """List devices of makers.

    Parameters
    ----------
    vendors
        Numbers of the makers, four hexadecimal digits.
    word
        Text in the name of the product, in lower case.
    """
    found = []
    for folder in sorted(_SYSTEM.glob("*")) if _SYSTEM.is_dir() else []:
        if _text(folder / "idVendor") not in vendors:
            continue
        product = _text(folder / "product")
        if word not in product.lower():
            continue
        bus, number = _text(folder / "busnum"), _text(folder / "devnum")
        if bus.isdecimal() and number.isdecimal():
            file = _FILES / f"{int(bus):03d}" / f"{int(number):03d}"
            found.append(UsbDevice(product, file, os.access(file, os.R_OK | os.W_OK)))
    return found


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        return ""

# SPDX-License-Identifier: BSD-3-Clause
"""Check a finished wheel: its size, what it needs and shows, and the licences of what is inside.

``check_wheel.py WHEEL...`` prints what is inside and ends with 1 if a wheel must not be given away:
a library that is not known, a licence that is not permissive, a licence text that is missing, a
symbol besides the modules' entry points, more than 25 MB.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path
from typing import Any

MAX_BYTES = 25_000_000

#: What every Linux with glibc has; all else must be inside, and named in the manifest.
SYSTEM_LIBRARIES = {
    "ld-linux-x86-64.so.2",
    "libc.so.6",
    "libdl.so.2",
    "libgcc_s.so.1",
    "libm.so.6",
    "libpthread.so.0",
    "librt.so.1",
    "libstdc++.so.6",
}

#: Licences under which a part may be linked into a BSD-3-Clause wheel. GCC's parts may because of
#: their exception, MPL-2.0 because its files are unchanged and to be had from Debian.
PERMISSIVE = {
    "Apache-2.0",
    "BSD-2-Clause",
    "BSD-3-Clause",
    "MIT",
    "MPL-2.0",
    "Zlib",
    "GPL-3.0-or-later WITH GCC-exception-3.1",
}

#: Names that the code of libraries under the GPL or LGPL leaves in a binary.
TRACES = [b"cholmod_", b"SuiteSparse_", b"umfpack_", b"spqr_", b"fftw_", b"libgomp", b"avcodec_"]

#: What must be told in every wheel.
NOTICES = ["LICENSE", "third_party_notes/README.md", "third_party_notes/pybind11.md"]


def problems_of_binary(name: str, data: bytes) -> list[str]:
    """List what is wrong with an extension module."""
    with tempfile.NamedTemporaryFile(suffix=".so") as file:
        file.write(data)
        file.flush()
        readelf = ["readelf", "--wide", "--dynamic", "--dyn-syms", file.name]
        done = subprocess.run(readelf, capture_output=True, text=True, check=False)
    if "NEEDED" not in done.stdout:
        return [f"{name} is no library that needs libc"]
    needed = set(re.findall(r"\(NEEDED\).*\[(.*)\]", done.stdout))
    problems = [f"{name} needs {library}" for library in sorted(needed - SYSTEM_LIBRARIES)]
    rows = [line.split() for line in done.stdout.splitlines() if re.match(r" +\d+: ", line)]
    shown = {row[7] for row in rows if len(row) > 7 and row[4] != "LOCAL" and row[6] != "UND"}
    strangers = sorted(symbol for symbol in shown if not symbol.startswith("PyInit_"))
    if strangers:
        problems.append(f"{name} shows {len(strangers)} symbols, {strangers[0]} first")
    problems += [f"{name} holds traces of {trace.decode()}" for trace in TRACES if trace in data]
    return problems


def problems_of_licences(manifest: list[dict[str, Any]], files: set[str]) -> list[str]:
    """List what is linked in without a known, permissive licence and its text beside it."""
    problems = []
    for part in manifest:
        licences = part["licence"].split(" AND ")
        problems += [
            f"{part['name']} is under {licence}, which is not permissive or not known"
            for licence in licences
            if licence not in PERMISSIVE
        ]
        if not part["texts"]:
            problems.append(f"{part['name']} has no licence text")
        problems += [
            f"the licence text {text} of {part['name']} is missing"
            for text in part["texts"]
            if text not in files
        ]
    return problems


def problems_of(path: Path) -> list[str]:
    """List all that is wrong with a wheel."""
    problems = []
    if path.stat().st_size > MAX_BYTES:
        problems.append(f"{path.stat().st_size / 1e6:.1f} MB, more than {MAX_BYTES / 1e6:.0f}")
    if not re.search(r"-manylinux_2_\d+_x86_64\.whl$", path.name):
        problems.append("not tagged for a manylinux: auditwheel has not repaired it")
    with zipfile.ZipFile(path) as wheel:
        names = wheel.namelist()
        for name in names:
            if re.search(r"\.so(\.\d+)*$", name):
                if not name.startswith("orbslam2py/"):
                    problems.append(f"{name} is not known")
                problems += problems_of_binary(name, wheel.read(name))
        licences = next((n for n in names if n.endswith(".dist-info/METADATA")), "")
        folder = f"{licences.rpartition('/')[0]}/licenses/"
        problems += [f"{text} is missing" for text in NOTICES if folder + text not in names]
        linked = f"{folder}linked/"
        if linked + "manifest.json" not in names:
            return [*problems, "no manifest of what is linked in"]
        manifest = json.loads(wheel.read(linked + "manifest.json"))
        texts = {name.removeprefix(linked) for name in names if name.startswith(linked)}
        problems += problems_of_licences(manifest, texts)
    for part in manifest:
        print(f"  {part['name']} {part['version']}: {part['licence']}")
    return problems


def main() -> None:
    """Check wheels."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("wheels", type=Path, nargs="+")
    failed = False
    for path in parser.parse_args().wheels:
        print(f"{path.name}, {path.stat().st_size / 1e6:.1f} MB")
        problems = problems_of(path)
        failed |= bool(problems)
        for problem in problems:
            print(f"  WRONG: {problem}")
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()

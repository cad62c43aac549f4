# SPDX-License-Identifier: BSD-3-Clause
"""Build what the wheel is linked with, static and hidden, from Debian's source packages.

``build_libraries.py FOLDER`` takes the compiler in FOLDER/sysroot (fetch_toolchain.sh) and fills
FOLDER/libraries. What is built, and how, stands in libraries.toml. A run that was interrupted goes
on where it stood. FOLDER/libraries/notices/manifest.json says what was built from which version,
under which licence. With --only it builds one library, with --toolchain for another processor,
with --native for this machine (scripts/arm/test_arm.sh).
"""

from __future__ import annotations

import argparse
import gzip
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

try:
    import tomllib
except ModuleNotFoundError:  # Python 3.10
    from pip._vendor import tomli as tomllib  # type: ignore[no-redef]

HERE = Path(__file__).parent
PROJECT = HERE.parent.parent.resolve()

#: Nothing is seen from outside; the linker leaves out what is not used.
SECTIONS = {
    "C": "-fvisibility=hidden -ffunction-sections -fdata-sections",
    "CXX": "-fvisibility=hidden -fvisibility-inlines-hidden -ffunction-sections -fdata-sections",
}

COMMON = {
    "CMAKE_BUILD_TYPE": "Release",
    "CMAKE_CXX_FLAGS_RELEASE": "-O2 -DNDEBUG",
    "CMAKE_C_FLAGS_RELEASE": "-O2 -DNDEBUG",
    "CMAKE_POSITION_INDEPENDENT_CODE": "ON",
    "CMAKE_INSTALL_LIBDIR": "lib",
    "BUILD_SHARED_LIBS": "OFF",
}


def fetch_sources(folder: Path, packages: list[str]) -> None:
    """Unpack source packages with Debian's patches; apt checks their signatures.

    It is an apt with a state of its own: the machine's list of mirrors stays as it is.
    """
    complete = folder / "complete"
    if complete.exists() and complete.read_text().split() == packages:
        return
    for part in ("state/lists/partial", "cache/archives/partial"):
        (folder / part).mkdir(parents=True, exist_ok=True)
    mirror = os.environ.get("ORBSLAM2PY_DEBIAN_MIRROR", "http://deb.debian.org/debian")
    mirrors = folder / "debian.sources"
    mirrors.write_text(
        f"Types: deb-src\nURIs: {mirror}\nSuites: bookworm\nComponents: main\n"
        "Signed-By: /usr/share/keyrings/debian-archive-keyring.gpg\n"
    )
    apt = [
        "apt-get",
        "-qq",
        f"-oDir::State={folder}/state",
        "-oDir::State::status=/dev/null",
        f"-oDir::Cache={folder}/cache",
        f"-oDir::Etc::sourcelist={mirrors}",
        "-oDir::Etc::sourceparts=/dev/null",
        *(["-oAPT::Sandbox::User=root"] if os.geteuid() == 0 else []),
    ]
    subprocess.run([*apt, "update"], check=True)
    subprocess.run([*apt, "source", "--only-source", *packages], check=True, cwd=folder)
    complete.write_text("\n".join(packages))


def unpacked(package: str, sources: Path) -> Path:
    """Give the folder of a source package."""
    (folder,) = (path for path in sources.glob(f"{package}-[0-9]*") if path.is_dir())
    return folder


def flags_for(library: dict[str, Any], processor: str) -> dict[str, Any]:
    """Give CMake's settings of a library with the compiler's flags for a processor."""
    settings: dict[str, Any] = dict(library["cmake"])
    if "processors" in library:
        flags = (library["processors"][processor], settings.get("CMAKE_CXX_FLAGS", ""))
        settings["CMAKE_CXX_FLAGS"] = " ".join(filter(None, flags))
    return settings


def build(
    key: str, cmake: dict[str, Any], source: Path, folder: Path, toolchain: Path | None, jobs: int
) -> None:
    """Configure, compile and install one library."""
    sysroot, objects = folder / "sysroot", folder / "objects" / key
    defines = COMMON | {"CMAKE_INSTALL_PREFIX": str(folder / "libraries")}
    for name, value in cmake.items():
        text = {True: "ON", False: "OFF"}.get(value, value)
        defines[name] = text.replace("SYSROOT", str(sysroot)).replace("PROJECT", str(PROJECT))
    for language in ("C", "CXX"):
        flags = f"CMAKE_{language}_FLAGS"
        defines[flags] = f"{SECTIONS[language]} {defines.get(flags, '')}"
        if ccache := shutil.which("ccache"):
            defines[f"CMAKE_{language}_COMPILER_LAUNCHER"] = ccache
    environment = os.environ | {
        "ORBSLAM2PY_SYSROOT": str(sysroot),
        "CCACHE_BASEDIR": str(folder),
        "CCACHE_NOHASHDIR": "1",
    }
    objects.mkdir(parents=True, exist_ok=True)
    configure = ["cmake", "-S", source, "-B", objects, "-GNinja"]
    if toolchain is not None:
        configure += [f"--toolchain={toolchain.resolve()}"]
    configure += [f"-D{name}={value}" for name, value in defines.items()]
    with (folder / f"{key}.log").open("w") as log:
        done = subprocess.run(configure, env=environment, stdout=log, stderr=log, check=False)
    if done.returncode != 0:
        sys.exit(f"{key} cannot be configured.\nSee {log.name}.")
    compile_all = ["cmake", "--build", objects, "-j", str(jobs), "--target", "install"]
    with (folder / f"{key}.log").open("a") as log:
        done = subprocess.run(compile_all, env=environment, stdout=log, stderr=log, check=False)
    if done.returncode != 0:
        sys.exit(f"{key} cannot be built.\nSee {log.name}.")


def version_of(library: dict[str, Any], folder: Path) -> str:
    """Say which version of a Debian package, in source or installed, was used."""
    if "source" in library:
        (description,) = (folder / "sources").glob(f"{library['source']}_*.dsc")
        lines = description.read_text().splitlines()
        return next(line.split()[1] for line in lines if line.startswith("Version:"))
    if "in_sysroot" in library:
        log = folder / "sysroot/usr/share/doc" / library["in_sysroot"] / "changelog.Debian.gz"
        with gzip.open(log, "rt") as lines:
            return next(lines).split("(")[1].split(")")[0]
    query = ["dpkg-query", "-W", "-f=${Version}", library["installed"]]
    return subprocess.run(query, capture_output=True, text=True, check=True).stdout


def write_manifest(libraries: dict[str, dict[str, Any]], folder: Path) -> None:
    """Write manifest.json, and the licence texts beside it."""
    out = folder / "libraries/notices"
    texts = out
    shutil.rmtree(texts, ignore_errors=True)
    texts.mkdir(parents=True)
    manifest = []
    for key, library in libraries.items():
        origin = libraries[library["part_of"]] if "part_of" in library else library
        source = unpacked(origin["source"], folder / "sources") if "source" in origin else Path()
        names = []
        for text in library["licences"]:
            path = text.replace("SOURCE", str(source)).replace("SYSROOT", f"{folder}/sysroot")
            name = f"{key}-{Path(path).name}"
            shutil.copyfile(path, texts / name)
            names.append(name)
        entry = {"name": library["name"], "version": version_of(origin, folder)}
        entry |= {name: library[name] for name in ("licence", "archives")}
        manifest.append(entry | {"texts": names})
    (out / "manifest.json").write_text(json.dumps(manifest, indent=2) + "\n")


def main() -> None:
    """Build all libraries."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    compiler = parser.add_mutually_exclusive_group()
    compiler.add_argument("--toolchain", type=Path, default=HERE / "toolchain.cmake")
    compiler.add_argument("--native", action="store_true", help="with this machine's own compiler")
    parser.add_argument("--processor", default="x86_64", help="whose flags are taken")
    parser.add_argument("--only", metavar="LIBRARY", help="this one, and no manifest")
    arguments = parser.parse_args()
    folder = arguments.folder.resolve()
    libraries = tomllib.loads((HERE / "libraries.toml").read_text())
    built = {key: library for key, library in libraries.items() if "cmake" in library}
    if arguments.only:
        built = {arguments.only: built[arguments.only]}
    sources = folder / "sources"
    fetch_sources(sources, [library["source"] for library in built.values()])
    for key, library in built.items():
        print(f"Building {library['name']}", flush=True)
        cmake = flags_for(library, arguments.processor)
        source = unpacked(library["source"], sources)
        toolchain = None if arguments.native else arguments.toolchain
        build(key, cmake, source, folder, toolchain, arguments.jobs)
    if not arguments.only:
        write_manifest(libraries, folder)


if __name__ == "__main__":
    main()

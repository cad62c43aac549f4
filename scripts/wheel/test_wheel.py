# SPDX-License-Identifier: BSD-3-Clause
"""Install a wheel on a bare machine and use it: a minimal Debian with Python and pip, nothing else.

``test_wheel.py WHEEL --suite bookworm`` makes the tree with mmdebstrap, enters it by chroot, and
runs bare_tree_tests.sh in it. Needs root. Where the machine does not allow it, it says so and ends
with 77.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
from pathlib import Path

from environments import environments

PROJECT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(PROJECT / "scripts"))

from bare_tree import enter, make_tree  # noqa: E402  # a folder above

#: Debian's releases and their Python.
SUITES = {"bookworm": "3.11", "trixie": "3.13"}

#: Other packages with OpenCV, each used in one process with ours. Those without "headless" need
#: libraries of a desktop, which a bare tree has not.
OTHER_OPENCV = [
    "opencv-python-headless==4.10.0.84",
    "opencv-contrib-python-headless==4.11.0.86",
    "opencv-python-headless==5.0.0.93",
]
#: For the Python tests inside.
TEST_PACKAGES = ["pytest", "pytest-benchmark", "pytest-xdist", "hypothesis", "scipy", "rosbags"]


def download(wheel: Path, suite: str, folder: Path) -> None:
    """Fetch beforehand all that pip will install inside: the tree has no network.

    A folder of wheels for each environment, one for the other OpenCVs.
    """
    python = SUITES[suite]
    platforms = [f"manylinux_2_{minor}_x86_64" for minor in (36, 35, 34, 31, 28, 27, 24, 17)]
    platforms += ["manylinux2014_x86_64"]
    pip = [sys.executable, "-m", "pip", "download", "-qq", "--only-binary=:all:"]
    pip += ["--disable-pip-version-check", "--python-version", python]
    pip += [f"--platform={platform}" for platform in platforms]
    shutil.rmtree(folder, ignore_errors=True)
    tried = environments(python)
    for name, constraints in tried.items():
        target = folder / name
        target.mkdir(parents=True)
        (target / "constraints.txt").write_text("\n".join(constraints) + "\n")
        limits = ["--constraint", target / "constraints.txt", "--dest", target]
        subprocess.run([*pip, *limits, wheel, *TEST_PACKAGES], check=True)
    (folder / "environments.txt").write_text("\n".join(tried) + "\n")
    for other in OTHER_OPENCV:
        subprocess.run([*pip, "--no-deps", "--dest", folder / "opencv", other], check=True)
    (folder / "opencv.txt").write_text("\n".join(OTHER_OPENCV) + "\n")


def copy_tests(checkout: Path) -> None:
    """Copy what the tests need, and no package beside them."""
    shutil.rmtree(checkout, ignore_errors=True)
    ignore = shutil.ignore_patterns("__pycache__", "*.so")
    for name in ("tests", "benchmarks", "scripts"):
        shutil.copytree(PROJECT / name, checkout / name, ignore=ignore)
    for name in ("pyproject.toml", "README.md"):
        shutil.copy(PROJECT / name, checkout)


def main() -> None:
    """Test a wheel in a bare tree."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "wheel", type=Path, help="or the folder of several: that of the suite's Python"
    )
    parser.add_argument("--suite", choices=SUITES, default="bookworm")
    parser.add_argument("--folder", type=Path, default=PROJECT / "build/wheel")
    arguments = parser.parse_args()
    wheel = arguments.wheel
    if wheel.is_dir():
        tag = f"cp{SUITES[arguments.suite].replace('.', '')}"
        found = sorted(
            wheel.glob(f"orbslam2py-*-{tag}-*manylinux*.whl"), key=lambda w: w.stat().st_mtime
        )
        if not found:
            python = f"python{SUITES[arguments.suite]}"
            sys.exit(f"{wheel} has no wheel for {tag}.\nBuild it: make wheel PYTHON={python}")
        wheel = found[-1]
    tree = arguments.folder.resolve() / f"bare-{arguments.suite}"
    make_tree(arguments.suite, tree, "python3,python3-pip,python3-venv")
    download(wheel, arguments.suite, tree / "srv/wheels")
    copy_tests(tree / "srv/checkout")
    sys.exit(enter(tree, "sh", "/srv/checkout/scripts/wheel/bare_tree_tests.sh"))


if __name__ == "__main__":
    main()

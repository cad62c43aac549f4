# SPDX-License-Identifier: BSD-3-Clause
"""Compare a wheel with the package as it is installed for development.

``compare_builds.py WHEEL`` unpacks the wheel, runs sequences in the deterministic mode with it and
with the package that this Python has, and compares the paths: at most 1e-6 apart, in
metres and in entries of rotation matrices. Synthetic worlds, and real sequences where the folder
that ORBSLAM2PY_SHARED names has them.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import sysconfig
import tempfile
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

PROJECT = Path(__file__).resolve().parents[2]
TOLERANCE = 1e-6

#: Synthetic worlds and what is asked of them: a loop, depth, a start by one camera.
SYNTHETIC: dict[str, dict[str, Any]] = {
    "corridor stereo": {"speed": 2.8},
    "corridor rgbd": {"frames": 80},
    "corridor mono": {"frames": 120},
}
#: Folders of real sequences.
REAL = [
    "7scenes_redkitchen_head250 rgbd",
    "7scenes_redkitchen_head250 mono",
    "kitti_06_head51_stereo stereo",
    "kitti_03_left_head120 mono",
    "euroc_V1_01_keyframes stereo",
]
SHARED = Path(os.environ.get("ORBSLAM2PY_SHARED", PROJECT.parent / "shared")) / "data/sequences"


def run(case: str, output: Path) -> None:
    """Run a sequence with whichever package is found, and write the poses."""
    import orbslam2py as orb  # noqa: PLC0415  which one is what this is about
    from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence  # noqa: PLC0415

    name, sensor = case.split()
    if case in SYNTHETIC:
        kind = orb.Sensor(sensor)
        options = SyntheticOptions(name, sensor=kind, size=(320, 240), **SYNTHETIC[case])
        sequence: Any = SyntheticSequence(options)
    else:
        sequence = orb.open_sequence(SHARED / name, sensor)
    with orb.System(sequence.settings, sensor, deterministic=True, seed=0) as slam:
        for i, timestamp in enumerate(sequence.timestamps):
            images = sequence.load(i)
            if sensor == "rgbd":
                slam.track_rgbd(images.image, images.depth, timestamp)
            elif sensor == "stereo":
                slam.track_stereo(images.image, images.right, timestamp)
            else:
                slam.track_monocular(images.image, timestamp)
        paths = slam.trajectories()
        poses = np.concatenate([path.T_wc for path in paths])
        lost = np.concatenate([path.lost for path in paths])
        np.savez(
            output,
            poses=poses,
            lost=lost,
            loops=slam.n_loops_closed,
            where=orb.__file__,
            map=slam.map_hash(),
        )


def compare(case: str, folder: Path, unpacked: Path) -> bool:
    """Run a case with both, print how far apart they are, and say whether that is near enough."""
    results = []
    for kind, path in (("wheel", unpacked), ("development", None)):
        output = folder / f"{kind}.npz"
        environment, options = os.environ.copy(), []
        if path is not None:
            # -S: what is installed for development is found before all paths otherwise.
            options = ["-S"]
            environment["PYTHONPATH"] = os.pathsep.join([str(path), sysconfig.get_path("purelib")])
        words = [sys.executable, *options, __file__, "--case", case, "--output", output]
        subprocess.run(words, env=environment, check=True)
        with np.load(output) as arrays:
            results.append({name: arrays[name] for name in arrays})
        assert Path(str(results[-1]["where"])).is_relative_to(unpacked) == (path is not None)
    a, b = results
    if not np.array_equal(a["lost"], b["lost"]) or a["loops"] != b["loops"]:
        print(f"{case}: other images are lost or other loops closed")
        return False
    metres = np.abs(a["poses"][:, :3, 3] - b["poses"][:, :3, 3]).max()
    turned = np.abs(a["poses"][:, :3, :3] - b["poses"][:, :3, :3]).max()
    same = (
        "the same bytes" if a["map"] == b["map"] and metres == turned == 0 else "not the same bytes"
    )
    print(
        f"{case}: {len(a['poses'])} images, {a['loops']} loops, "
        f"at most {metres:.1e} m and {turned:.1e} in rotations apart, {same}",
        flush=True,
    )
    return bool(max(metres, turned) <= TOLERANCE)


def main() -> None:
    """Compare on all cases."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("wheel", type=Path, nargs="?", help="or the folder of several")
    parser.add_argument("--case", help=argparse.SUPPRESS)
    parser.add_argument("--output", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.case:
        run(arguments.case, arguments.output)
        return
    wheel = arguments.wheel
    if wheel.is_dir():
        tag = f"cp{sys.version_info.major}{sys.version_info.minor}"
        found = sorted(wheel.glob(f"*-{tag}-*manylinux*.whl"), key=lambda w: w.stat().st_mtime)
        if not found:
            sys.exit(
                f"{wheel} has no wheel for {tag}.\nBuild it: make wheel PYTHON={sys.executable}"
            )
        wheel = found[-1]
    near = True
    with tempfile.TemporaryDirectory() as text:
        folder = Path(text)
        with zipfile.ZipFile(wheel) as archive:
            archive.extractall(folder / "unpacked")
        for case in [*SYNTHETIC, *REAL]:
            if case in REAL and not (SHARED / case.split()[0]).is_dir():
                print(f"{case}: left out, there is no such folder in {SHARED}")
                continue
            near &= compare(case, folder, folder / "unpacked")
    sys.exit(
        0 if near else f"The wheel's paths are more than {TOLERANCE} apart from those of the build."
    )


if __name__ == "__main__":
    main()

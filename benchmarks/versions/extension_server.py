# SPDX-License-Identifier: BSD-3-Clause
"""One version's extension in a separate process, which carries out commands line by line.

    PYTHONPATH=PACKAGE python extension_server.py PACKAGE IMAGES.npz

It imports nothing but that version's package and NumPy, as the version may be an old one. It first
prints the vector units; then, for each line of the input, the milliseconds of processor time that
this took:

    extract IMAGE N_FEATURES UNIT
    stereo LEFT RIGHT N_FEATURES
"""

import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

# The finder of an installation for development comes before PYTHONPATH.
sys.meta_path = [one for one in sys.meta_path if "editable" not in type(one).__module__]

from orbslam2py import _core as core  # noqa: E402

N_LEVELS, SCALE_FACTOR = 8, 1.2


def main() -> None:
    """Answer until the input ends."""
    package, file = sys.argv[1:]
    if not Path(core.__file__).is_relative_to(package):
        raise SystemExit(f"{core.__file__} was loaded instead of the extension in {package}")
    with np.load(file) as arrays:
        images = dict(arrays)
    # Versions before the portable library knew these two.
    old = ["portable", "avx2"] if core.OrbExtractor().kernel_name == "avx2" else ["portable"]
    print(*(core.vector_units() if hasattr(core, "vector_units") else old), flush=True)
    prepared: dict[str, Callable[[], object]] = {}
    for line in sys.stdin:
        if line not in prepared:
            prepared[line] = prepare(images, *line.split())
            prepared[line]()
        begin = time.thread_time_ns()
        prepared[line]()
        print((time.thread_time_ns() - begin) / 1e6, flush=True)


def prepare(images: dict[str, np.ndarray], verb: str, *words: str) -> Callable[[], object]:
    """What is to be measured, without what comes before it."""
    if verb == "extract":
        image, n_features, unit = words
        extractor = core.OrbExtractor(core.OrbOptions(n_features=int(n_features)), unit)
        return lambda: extractor.extract(images[image])
    left, right, n_features = words
    options = core.OrbOptions(n_features=int(n_features))
    pair = [core.OrbExtractor(options).extract(images[side]) for side in (left, right)]
    scales = core.ScalePyramid(SCALE_FACTOR, N_LEVELS)
    fx, bf = (float(images[left + name]) for name in ("_fx", "_bf"))
    return lambda: core.match_stereo(*pair, scales, bf, fx)


if __name__ == "__main__":
    main()

# SPDX-License-Identifier: BSD-3-Clause
"""Single steps of the reference and ours: extraction, stereo, pose, bundle adjustment, words, fuse.

The C++ verbs are called through the bindings, whose cost (conversion of the arguments, tens of
microseconds) is part of our time.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path

import numpy as np

from benchmarks.harness import reference
from benchmarks.harness.folders import GOLDEN, how_to_build, shared_folder
from benchmarks.harness.reference import Figure
from benchmarks.harness.runs import benchmark_records
from benchmarks.harness.steps import Row
from benchmarks.harness.tables import in_words
from benchmarks.harness.yardstick import Times, Yardstick
from orbslam2py import _core as core
from orbslam2py.vocabulary import load_vocabulary

SCALE_FACTOR, N_LEVELS = 1.2, 8


@cache
def golden(problem: str) -> dict[str, np.ndarray]:
    """The arrays of a golden problem of the tests."""
    return {path.stem: np.load(path) for path in sorted((GOLDEN / problem).glob("*.npy"))}


def inverse_sigma2(levels: np.ndarray) -> np.ndarray:
    """Weight of a keypoint [pixels^-2]."""
    return 1.0 / SCALE_FACTOR ** (2.0 * levels.astype(np.float64))


# ---- extraction and stereo -----------------------------------------------------------------------
def extraction_rows(yardstick: Yardstick) -> Iterator[Row]:
    for image, figure in reference.EXTRACTION.items():
        n_features, _ = reference.YARDSTICK[image]
        options = core.OrbOptions(n_features=n_features)
        for kernels in reversed(core.vector_units()):
            extractor = core.OrbExtractor(options, kernels)
            measured = yardstick.compare(partial(extractor.extract, yardstick.images[image]), image)
            stretch = reference.EXTRACTION_STRETCH * (figure.milliseconds or 0)
            reached = "stretch goal reached" if measured.carried <= stretch else ""
            if kernels == core.OrbExtractor(options).kernel_name:
                yield Row(
                    f"{figure.name} ({kernels})",
                    figure,
                    measured,
                    reached,
                    not yardstick.exact,
                )
            else:
                untargeted = Figure(figure.name, figure.milliseconds, yardstick=image)
                yield Row(f"{figure.name} ({kernels})", untargeted, measured)


@dataclass(frozen=True)
class StereoPair:
    """A rectified pair of images, and what matching needs."""

    left: np.ndarray
    right: np.ndarray
    fx: float
    bf: float
    n_features: int
    recorded: bool  #: not a synthetic one in its place


def stereo_pair(name: str) -> StereoPair:
    """One of the pairs of `reference.STEREO`."""
    shared = shared_folder()
    if shared is not None:
        file = {"euroc": "stereo_euroc", "kitti": "stereo_kitti06"}[name]
        arrays = np.load(shared / "golden" / f"{file}.npz")
    else:
        arrays = golden("stereo_synth")
    fx, _, _, _, bf = arrays["K_bf"]
    n_features = 1200 if name == "euroc" else 2000
    return StereoPair(
        arrays["left"], arrays["right"], float(fx), float(bf), n_features, shared is not None
    )


def stereo_rows(yardstick: Yardstick) -> Iterator[Row]:
    for name, figure in reference.STEREO.items():
        pair = stereo_pair(name)
        options = core.OrbOptions(n_features=pair.n_features)
        first, second = (
            core.OrbExtractor(options).extract(image) for image in (pair.left, pair.right)
        )
        scales = core.ScalePyramid(SCALE_FACTOR, N_LEVELS)
        match = partial(core.match_stereo, first, second, scales, pair.bf, pair.fx)
        measured = yardstick.compare(match)
        matched = int(np.count_nonzero(match()[1] > 0))
        note = f"{len(first)} keypoints, {matched} with depth"
        if not pair.recorded:
            note = "synthetic 640x480 pair instead"
        yield Row(figure.name, figure, measured, note, not yardstick.exact)


# ---- optimisation --------------------------------------------------------------------------------
def _pixels(uv: np.ndarray, right_u: np.ndarray) -> np.ndarray:
    return np.column_stack([uv, np.where(right_u >= 0, right_u, np.nan)]).astype(np.float64)


def _camera(K: np.ndarray) -> core.Camera:
    """A camera with fx, fy, cx, cy, bf; optimisation does not ask its size."""
    fx, fy, cx, cy, bf = K.astype(np.float64).tolist()
    size = {"width": 640, "height": 480}
    return core.Camera(
        core.CameraOptions(fx=fx, fy=fy, cx=cx, cy=cy, **size, bf=bf, depth_ratio=40.0)
    )


def pose_rows(yardstick: Yardstick) -> Iterator[Row]:
    for name, figure in reference.POSE.items():
        arrays = golden(name)
        arguments = (
            core.Pose.from_matrix(arrays["Tcw_init"].astype(np.float64)),
            _camera(arrays["K"]),
            arrays["X"].astype(np.float64),
            _pixels(arrays["uv"], arrays["ur"]),
            inverse_sigma2(arrays["octave"]),
        )
        measured = yardstick.compare(partial(core.optimize_pose, *arguments), repeat=60)
        estimate = core.optimize_pose(*arguments)
        same = np.array_equal(estimate.outlier != 0, arrays["out_outlier"] != 0)
        note = "" if same else "outliers differ from the reference's"
        yield Row(figure.name, figure, measured, note)


@dataclass(frozen=True)
class GoldenBundle:
    """A local window in the form of `solve_bundle`, and which observations the reference keeps."""

    arguments: tuple[object, ...]
    kept: np.ndarray

    @staticmethod
    def load(name: str) -> GoldenBundle:
        arrays = golden(name)
        T_cw = [core.Pose.from_matrix(T) for T in arrays["Tcw_init"].astype(np.float64)]
        first_local = int(arrays["local_from"][0])
        uvr = arrays["obs_uvr"]
        arguments = (
            T_cw,
            [i < first_local or i == 0 for i in range(len(T_cw))],
            _camera(arrays["K"]),
            arrays["X_init"].astype(np.float64),
            arrays["obs_kf"].astype(np.int64),
            arrays["obs_pt"].astype(np.int64),
            _pixels(uvr[:, :2], uvr[:, 2]),
            inverse_sigma2(arrays["obs_octave"]),
        )
        return GoldenBundle(arguments, arrays["out_obs_erased"] == 0)

    def cost(self) -> float:
        """Sum of squared whitened residuals of our solution, over the kept observations."""
        _, _, model, _, camera, point, pixels, weight = self.arguments
        poses, points, _ = core.solve_bundle(*self.arguments)
        matrices = np.stack([pose.matrix for pose in poses])
        seen = matrices[camera, :3, :3] @ points[point][:, :, None]
        there = seen[:, :, 0] + matrices[camera, :3, 3]
        uv = model.project(there)
        projected = np.column_stack([uv, uv[:, 0] - model.bf / there[:, 2]])
        squares = np.nansum((pixels - projected) ** 2, axis=1) * weight
        return float(squares[self.kept].sum())


def bundle_rows(yardstick: Yardstick) -> Iterator[Row]:
    for name, figure in reference.BUNDLE.items():
        bundle = GoldenBundle.load(name)
        measured = yardstick.compare(partial(core.solve_bundle, *bundle.arguments), repeat=20)
        ratio = bundle.cost() / reference.BUNDLE_COST[name]
        limit = reference.BUNDLE_COST_RATIO
        met = in_words(ratio <= limit)
        yield Row(
            figure.name, figure, measured, f"cost {ratio:.5f} of the reference's, {limit}: {met}"
        )


# ---- words ---------------------------------------------------------------------------------------
def words_rows(yardstick: Yardstick, large: core.Vocabulary) -> Iterator[Row]:
    """With the package's vocabulary, and with one as large as the reference's."""
    vocabularies = {"package's vocabulary": load_vocabulary(), "10^6 made-up words": large}
    for n_features, figure in reference.WORDS.items():
        image = yardstick.images["tum_a" if n_features == 1000 else "kitti_a"]
        extractor = core.OrbExtractor(core.OrbOptions(n_features=n_features))
        descriptors = extractor.extract(image).descriptors
        for label, vocabulary in vocabularies.items():
            measured = yardstick.compare(partial(vocabulary.transform, descriptors))
            yield Row(f"{figure.name} ({label})", figure, measured)


# ---- fusing --------------------------------------------------------------------------------------
def fuse_rows(yardstick: Yardstick, build: Path) -> Iterator[Row]:
    """Fusing in a dense made-up map where everything is covisible: the worst case, from C++."""
    if how_to_build(build, "matching_bench") is not None:
        return
    found: dict[str, float] = {}

    def work() -> float:
        for name, record in benchmark_records(build, "matching_bench", "fuse").items():
            found[name.split("/")[1]] = record["median_ms"]
        return max(found.values())

    unit = yardstick.around([work])
    for name, value in found.items():
        measured = replace(unit, ours=Times(value, value))
        yield Row(f"fuse, dense made-up map ({name})", reference.FUSE, measured)

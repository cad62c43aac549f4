# SPDX-License-Identifier: BSD-3-Clause
"""The sequences of a standard data set, each sensor, several seeds, with published figures."""

from orbslam2py.batches.standard_sets.benchmark import BenchmarkResult, benchmark
from orbslam2py.batches.standard_sets.entries import Entry, is_lost
from orbslam2py.batches.standard_sets.find import StandardSet, find_sequences
from orbslam2py.batches.standard_sets.published import Published, published_figures

__all__ = [
    "BenchmarkResult",
    "Entry",
    "Published",
    "StandardSet",
    "benchmark",
    "find_sequences",
    "is_lost",
    "published_figures",
]

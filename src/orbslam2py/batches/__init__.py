# SPDX-License-Identifier: BSD-3-Clause
"""Many sequences, settings and seeds: one command, one table."""

from orbslam2py.batches.batch import BatchResult, batch
from orbslam2py.batches.job import Job
from orbslam2py.batches.jobs import make_jobs, read_jobs
from orbslam2py.batches.standard_sets import BenchmarkResult, Entry, StandardSet, benchmark
from orbslam2py.batches.summary import Group, Spread, summarise

__all__ = [
    "BatchResult",
    "BenchmarkResult",
    "Entry",
    "Group",
    "Job",
    "Spread",
    "StandardSet",
    "batch",
    "benchmark",
    "make_jobs",
    "read_jobs",
    "summarise",
]

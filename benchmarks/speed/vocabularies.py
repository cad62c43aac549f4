# SPDX-License-Identifier: BSD-3-Clause
"""How long vocabularies take to be ready, and with how much memory: in processes of their own.

    python -m benchmarks.speed.vocabularies FILE

opens FILE once and prints milliseconds and megabytes as JSON.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.harness import reference
from benchmarks.harness.arguments import new_parser
from benchmarks.harness.process_memory import peak_mb
from benchmarks.harness.runs import run_module
from benchmarks.harness.steps import Row
from benchmarks.harness.tables import in_words
from benchmarks.harness.yardstick import Yardstick
from orbslam2py import _core as core
from orbslam2py.vocabulary import load_vocabulary, save_vocabulary

BRANCHING, DEPTH = 10, 6


def make_large_vocabulary() -> core.Vocabulary:
    """A complete tree with 10^6 words and random centres: as large as the best-known one."""
    sizes = [BRANCHING**level for level in range(1, DEPTH + 1)]
    parents = [np.zeros(BRANCHING, np.uint32)]
    first = 1
    for size in sizes[:-1]:
        parents.append(np.repeat(np.arange(first, first + size, dtype=np.uint32), BRANCHING))
        first += size
    n_nodes = sum(sizes)
    random = np.random.default_rng(0)
    is_word = np.zeros(n_nodes, np.uint8)
    is_word[-sizes[-1] :] = 1
    return core.Vocabulary.from_table(
        BRANCHING,
        DEPTH,
        core.Scoring.L1,
        core.Weighting.TF_IDF,
        np.concatenate(parents),
        is_word,
        random.integers(0, 256, (n_nodes, 32), dtype=np.uint8),
        np.where(is_word, random.uniform(1, 12, n_nodes), 0.0),
    )


@dataclass(frozen=True)
class VocabularyFiles:
    """The large vocabulary in two formats."""

    binary: Path
    text: Path

    @staticmethod
    def write(vocabulary: core.Vocabulary, folder: Path) -> VocabularyFiles:
        files = VocabularyFiles(folder / "large.bvoc", folder / "large_text.txt")
        save_vocabulary(vocabulary, files.binary)
        save_vocabulary(vocabulary, files.text)
        return files


def vocabulary_rows(yardstick: Yardstick, files: VocabularyFiles) -> Iterator[Row]:
    opened: list[dict[str, float]] = []

    def open_once(path: Path) -> Callable[[], float]:
        def work() -> float:
            opened.append(run_module("benchmarks.speed.vocabularies", str(path)))
            return opened[-1]["ms"]

        return work

    binary = yardstick.around([open_once(files.binary)] * 7)
    note = "open and describe the first 1000 features, file in the page cache"
    yield Row(reference.VOCABULARY_BINARY.name, reference.VOCABULARY_BINARY, binary, note)

    opened.clear()
    text = yardstick.around([open_once(files.text)] * 3)
    peak = max(one["peak_mb"] for one in opened)
    before = max(one["before_mb"] for one in opened)
    theirs, limit = reference.VOCABULARY_TEXT_PEAK_MB
    size = files.text.stat().st_size / 1e6
    note = (
        f"{size:.0f} MB of text; peak of the process {peak:.0f} MB ({before:.0f} before), "
        f"reference {theirs:.0f}, target {limit:.0f}: {in_words(peak <= limit)}"
    )
    yield Row(reference.VOCABULARY_TEXT.name, reference.VOCABULARY_TEXT, text, note)


def main() -> None:
    parser = new_parser(__doc__)
    parser.add_argument("file", type=Path, help="a vocabulary, text or binary")
    arguments = parser.parse_args()
    before = peak_mb()
    descriptors = np.random.default_rng(1).integers(0, 256, (1000, 32), dtype=np.uint8)
    begin = time.perf_counter()
    vocabulary = load_vocabulary(arguments.file, cache=False)
    vocabulary.transform(descriptors)
    elapsed = 1e3 * (time.perf_counter() - begin)
    print(json.dumps({"ms": elapsed, "before_mb": before, "peak_mb": peak_mb()}))


if __name__ == "__main__":
    main()

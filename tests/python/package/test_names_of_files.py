# SPDX-License-Identifier: BSD-3-Clause
"""Names of files as OpenCV and the core need them, whatever the locale."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from orbslam2py import DatasetError
from orbslam2py._files import temporary_beside, utf8_name, utf8_path
from support.files import names_in
from support.vocabularies import TEXT

ASCII = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}

USES_NAMES = r"""
import sys
import numpy as np
from orbslam2py._files import atomic_folder, atomic_write
from orbslam2py.datasets import VideoReader
from orbslam2py.recordings.video_file import VideoFile
from orbslam2py.vocabulary import load_vocabulary, save_vocabulary
assert sys.getfilesystemencoding() == "ascii"
name = sys.argv[1]
assert "\udcc3" in name, "bytes stand for themselves"
video = VideoFile(f"{name}.avi", (320, 240), 25.0)
for shade in range(3):
    video.write(np.full((240, 320, 3), 80 * shade, np.uint8))
video.close()
assert len(VideoReader(f"{name}.avi").scan()) == 3
vocabulary = load_vocabulary(sys.argv[2], cache=False)
save_vocabulary(vocabulary, f"{name}.bvoc", comment=name)
assert load_vocabulary(f"{name}.bvoc").comment == "G\xe4nge"
save_vocabulary(vocabulary, f"{name}.txt")
assert load_vocabulary(f"{name}.txt", cache=False).hash == vocabulary.hash
with atomic_folder(f"{name}-folder"):
    pass
with atomic_write(f"{name}-file") as file:
    file.write(name)
"""


def test_where_the_locale_cannot_spell_a_name(tmp_path: Path) -> None:
    """Its bytes are UTF-8 all the same, and that is what libraries ask for."""
    done = subprocess.run(
        [sys.executable, "-c", USES_NAMES, "Gänge", str(TEXT)],
        cwd=tmp_path,
        env=os.environ | ASCII,
        capture_output=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    endings = ("-file", "-folder", ".avi", ".bvoc", ".txt")
    assert names_in(tmp_path) == [f"Gänge{ending}" for ending in endings]
    assert (tmp_path / "Gänge-file").read_text(encoding="utf-8") == "Gänge"


def test_names_become_utf_8() -> None:
    assert utf8_path(Path("a/Gänge.mp4"), DatasetError) == "a/Gänge.mp4"
    assert utf8_name("Gänge") == "Gänge"
    assert utf8_name("caf\udce9") == "caf\ufffd"
    for path in ("caf\udce9.mp4", "caf\udce9/a.mp4", "a/\ud800.mp4"):
        with pytest.raises(DatasetError, match=r"is not UTF-8.*; rename the file, or the folder"):
            utf8_path(Path(path), DatasetError)


@pytest.mark.parametrize("name", ["a.txt", "\u65e5" * 80, "caf\udce9.bvoc", "\U0001f600" * 60])
def test_hidden_names_are_short_and_beside_the_file(name: str) -> None:
    hidden = temporary_beside(Path("folder") / name, ".old")
    assert hidden.parent == Path("folder")
    assert hidden.name.startswith(f".{utf8_name(name)[:8]}")
    assert hidden.suffix == ".old"
    assert len(os.fsencode(hidden.name)) <= 143, "what encrypted folders allow"
    assert temporary_beside(Path("folder") / name, ".old") != hidden

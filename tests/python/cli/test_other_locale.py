# SPDX-License-Identifier: BSD-3-Clause
"""Outside UTF-8, in folders with spaces and letters beyond ASCII."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ASCII = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}


def command(folder: Path, *arguments: str) -> subprocess.CompletedProcess[bytes]:
    """Run the command in an ASCII locale."""
    return subprocess.run(
        [sys.executable, "-m", "orbslam2py", *arguments],
        cwd=folder,
        env=os.environ | ASCII,
        capture_output=True,
        check=False,
    )


def test_a_run_works_where_the_locale_cannot_spell_the_folder(tmp_path: Path) -> None:
    folder = tmp_path / "Ordner mit Ä 日本"
    folder.mkdir()
    size = ["--frames", "8", "--size", "320x240"]
    made = command(
        folder, "synthesize", "Gänge", "--world", "corridor", "--sensor", "stereo", *size
    )
    assert made.returncode == 0, made.stderr
    done = command(folder, "run", "Gänge", "--sensor", "stereo", "--output", "läuft")
    assert done.returncode == 0, done.stderr + done.stdout
    assert "läuft/report.html".encode() in done.stdout
    page = (folder / "läuft" / "report.html").read_text(encoding="utf-8")
    assert folder.name in page
    assert "Gänge" in page

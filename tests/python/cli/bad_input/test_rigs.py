# SPDX-License-Identifier: BSD-3-Clause
"""Rigs that are none, from the command line: the thing, the remedy, nothing lost."""

from __future__ import annotations

from pathlib import Path

import pytest

from orbslam2py.settings import Settings
from support.camera_files import KALIBR
from support.command_line import CommandLine
from support.rigs import PINHOLE, two_wide_pairs


@pytest.mark.parametrize(
    ("arguments", "messages"),
    [
        (("synthesize", "out", "--sensor", "rig"), ("settings of its cameras", "--rig FILE")),
        (("synthesize", "out", "--rig", "mono.yaml"), ("no rig", "import-camera")),
        (("synthesize", "out", "--rig", "none.yaml"), ("none.yaml", "check the path")),
        (("synthesize", "out", "--rig", "rig.yaml", "--size", "64x64"), ("without size",)),
        (("synthesize", "out", "--rig", "rig.yaml", "--layout", "tum"), ("tum", "euroc")),
        (("demo", "--sensor", "rig"), ("no rig", "synthesize FOLDER --rig SETTINGS")),
        (("run", "folder", "--sensor", "rig"), ("no images of a rig", "cam0, cam1")),
        (("run", "folder", "--settings", "rig.yaml"), ("no images of a rig", "cam0, cam1")),
        (("run", "folder", "--sensor", "rig", "--settings", "mono.yaml"), ("no rig", "Camera2")),
        (("run", "folder", "--sensor", "rig", "--settings", "tum1"), ("tum1", "not for rig")),
        (
            ("import-camera", "one.yaml", "--sensor", "rig", "-o", "out.yaml"),
            ("one camera", "two or more"),
        ),
        (
            ("import-camera", "two.yaml", "--sensor", "rig", "--camera", "0", "-o", "out.yaml"),
            ("leave --camera out",),
        ),
        (
            (
                "settings",
                "new",
                *[
                    "--sensor",
                    "rig",
                    "--fx",
                    "9",
                    "--fy",
                    "9",
                    "--cx",
                    "4",
                    "--cy",
                    "4",
                    "-o",
                    "out.yaml",
                ],
            ),
            ("a rig needs its cameras", "import-camera"),
        ),
    ],
)
def test_what_is_no_rig_is_told(
    command: CommandLine,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: tuple[str, ...],
    messages: tuple[str, ...],
) -> None:
    monkeypatch.chdir(tmp_path)
    two_wide_pairs().save("rig.yaml")
    Settings("mono", PINHOLE).save("mono.yaml")
    Path("two.yaml").write_text(KALIBR)
    Path("one.yaml").write_text(KALIBR.split("cam1:")[0])
    Path("folder").mkdir()
    done = command(*arguments)
    assert done.code == 2, done.err
    for message in messages:
        assert message in " ".join(done.err.split()), done.err
    assert "Traceback" not in done.err
    assert not Path("out").exists()
    assert not Path("out.yaml").exists()

# SPDX-License-Identifier: BSD-3-Clause
"""What users write, by README and guide, is right for a type checker, too."""

from __future__ import annotations

import ast
import dataclasses
import inspect
import re
import subprocess
import sys
from pathlib import Path

import pytest

from orbslam2py.runs import RunOptions
from orbslam2py.settings import Settings
from support.data import CHECKOUT

WRITTEN = """
from pathlib import Path

import numpy as np
import orbslam2py as orb
from orbslam2py.calibration import read_camera_file
from orbslam2py.datasets import open_input
from orbslam2py.runs import RunOptions, SystemOptions

settings = orb.Settings(sensor="mono", camera=orb.CameraSettings(525, 525, 319.5, 239.5))
print(settings.sensor.has_depth, orb.Settings.load("a.yaml", "rgbd").sensor.value)
options = RunOptions("rgbd", SystemOptions(deterministic=True), max_frames=20)
print(options.sensor.has_depth)
for frame in orb.open_sequence("folder", "rgbd"):
    print(frame.index, frame.text, frame.images.image.shape)
orb.batch({"a": Path("folder")})
with orb.System(settings) as slam:
    records = slam.run(open_input("folder"))
    slam.localization_mode = True
print(records[0] == records[1], orb.check_calibration(open_input(0), settings))
print(read_camera_file("a.yaml", "kalibr"))
"""


#: By the sensor users know which images there are, by the reason whether there is a pose.
NONE_IS_KNOWN = "# mypy: no-strict-optional"


def readme() -> str:
    """The Python of the README in one script."""
    text = (CHECKOUT / "README.md").read_text()
    return "\n".join([NONE_IS_KNOWN, *re.findall(r"```python\n(.*?)```", text, re.DOTALL)])


@pytest.mark.watchdog(120)
def test_type_checker_has_nothing_to_say(tmp_path: Path, pytestconfig: pytest.Config) -> None:
    for name, text in {"readme.py": readme(), "written.py": WRITTEN}.items():
        (tmp_path / name).write_text(text)
    command = [sys.executable, "-m", "mypy", "--strict", "--config-file", ""]
    if pytestconfig.cache is not None:  # the next time it takes a tenth as long
        command += ["--cache-dir", str(pytestconfig.cache.mkdir("mypy"))]
    done = subprocess.run(
        [*command, "readme.py", "written.py"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("kind", [Settings, RunOptions])
def test_type_checkers_are_told_all_fields(kind: type) -> None:
    """They are listed once more, as the type of a field is not that of its argument."""
    tree = ast.parse(inspect.getsource(kind))
    (told,) = [node for node in ast.walk(tree) if getattr(node, "name", "") == "__init__"]
    assert isinstance(told, ast.FunctionDef)
    names = [argument.arg for argument in told.args.args[1:]]
    assert names == [field.name for field in dataclasses.fields(kind)]

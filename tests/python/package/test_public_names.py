# SPDX-License-Identifier: BSD-3-Clause
"""What the package offers to those who import it: names, places, and light doors."""

from __future__ import annotations

import ast
import importlib
import inspect
import pkgutil
import re
from pathlib import Path

import pytest

import orbslam2py as orb
from support.data import CHECKOUT
from support.scripts import run_script

NAMES = {
    "Callbacks",
    "CameraModel",
    "CameraSettings",
    "DatasetError",
    "DepthSettings",
    "Effort",
    "Evidence",
    "FrameFeatures",
    "FullAdjustmentRecord",
    "ImageError",
    "ImuCheck",
    "ImuVerdict",
    "InertialState",
    "KeyframeAdded",
    "LoopClosed",
    "MapChangeCause",
    "MapChanged",
    "MapFileError",
    "MapSnapshot",
    "MapStarted",
    "MapSummary",
    "MapsMerged",
    "OrbSettings",
    "OrbSlamError",
    "OutputFileError",
    "PoseMethod",
    "Publisher",
    "Reason",
    "Relocalized",
    "RerunRecorder",
    "Sensor",
    "Settings",
    "SettingsError",
    "StateError",
    "System",
    "TrackingLost",
    "TrackingRecord",
    "TrackingState",
    "Trajectory",
    "Verdict",
    "VideoWriter",
    "Viewer",
    "VocabularyError",
    "WorkerError",
    "__version__",
    "check_calibration",
    "export_colmap",
    "export_g2o",
    "export_nerfstudio",
    "export_points",
    "export_trajectory",
    "load_vocabulary",
    "merge_maps",
    "batch",
    "open_sequence",
    "open_source",
    "optimize_map",
    "run_sequence",
}

#: Names that users import from rooms, as the examples do; a room may offer more.
ROOMS = {
    "calibration": ["Board", "Calibration", "calibrate", "find_views", "read_camera_file"],
    "datasets": ["ImageFolder", "Images", "LiveFrame", "Sequence", "VideoSequence"],
    "live": ["Device", "LiveCamera", "LiveStream", "Request", "Sink", "open_source"],
    "evaluation": ["Alignment", "align", "evaluate_trajectory", "lap_error"],
    "maps": [
        *("MapChanges", "MapFollower", "MapSnapshot"),
        *("export_colmap", "images_of", "with_colours"),
    ],
    "runs": ["RunOptions", "RunResult", "SequenceRunner", "SystemOptions", "run_sequence"],
    "settings": [
        *("AngleOfView", "CameraModel", "CameraSettings", "DepthSettings", "OrbSettings"),
        *("Settings", "builtin_settings"),
    ],
    "synthetic": ["SyntheticOptions", "SyntheticSequence"],
    "pictures": ["MapPicture", "Marks", "Status", "draw_overlay", "draw_top_view"],
    "recordings": ["RerunRecorder", "VideoWriter"],
    "viewer": ["LiveView", "Publisher", "Viewer", "Watcher"],
    "trajectory": [
        *("Trajectory", "associate", "read_euroc", "read_kitti", "read_trajectory", "read_tum"),
        *("write_kitti", "write_tum"),
    ],
    "vocabulary": [
        *("convert_vocabulary", "load_vocabulary", "save_vocabulary", "train_vocabulary"),
        "vocabulary_info",
    ],
}

PACKAGES = [
    "orbslam2py",
    *(f"orbslam2py.{module.name}" for module in pkgutil.iter_modules(orb.__path__) if module.ispkg),
]


# ---- names ---------------------------------------------------------------------------------------
def test_names_of_the_package() -> None:
    assert set(orb.__all__) == NAMES
    assert len(orb.__all__) == len(NAMES)


def test_everything_offered_is_there() -> None:
    for name in orb.__all__:
        assert getattr(orb, name) is not None
        assert name in dir(orb)
    with pytest.raises(AttributeError, match="Slam"):
        _ = orb.Slam  # type: ignore[attr-defined]
    assert not hasattr(orb, "path")


@pytest.mark.parametrize("room", ROOMS)
def test_names_of_rooms(room: str) -> None:
    module = importlib.import_module(f"orbslam2py.{room}")
    assert set(ROOMS[room]) <= set(module.__all__)


def test_names_that_moved_are_still_there() -> None:
    from orbslam2py import datasets, live  # noqa: PLC0415

    assert datasets.LiveCamera is live.LiveCamera
    assert datasets.open_input is live.open_source is orb.open_source


def described(thing: object) -> bool:
    """Whether a class or a function has a docstring that somebody wrote; constants need none."""
    if not (inspect.isclass(thing) or inspect.isroutine(thing)):
        return True
    text = vars(thing).get("__doc__") if inspect.isclass(thing) else thing.__doc__
    return bool(text) and not text.startswith(f"{thing.__name__}(")


@pytest.mark.parametrize("package", PACKAGES)
def test_what_is_offered_exists_and_is_described(package: str) -> None:
    module = importlib.import_module(package)
    assert module.__doc__
    offered = getattr(module, "__all__", [])
    assert len(set(offered)) == len(offered)
    missing = [name for name in offered if not hasattr(module, name)]
    silent = [name for name in offered if not described(getattr(module, name, None))]
    assert (missing, silent) == ([], [])


# ---- the examples --------------------------------------------------------------------------------
def scripts() -> dict[str, str]:
    """The examples, and what the README shows of Python."""
    texts = {path.name: path.read_text() for path in sorted(CHECKOUT.glob("examples/*.py"))}
    shown = re.findall(r"```python\n(.*?)```", (CHECKOUT / "README.md").read_text(), re.DOTALL)
    return {**texts, "README.md": "\n".join(shown)}


SCRIPTS = scripts()


@pytest.mark.parametrize("name", SCRIPTS)
def test_names_in_examples_are_public(name: str) -> None:
    tree = ast.parse(SCRIPTS[name])
    used = 0
    for node in ast.walk(tree):
        match node:
            case ast.ImportFrom(module=str(module)) if module.startswith("orbslam2py"):
                public = importlib.import_module(module).__all__
                assert {alias.name for alias in node.names} <= set(public)
                used += 1
            case ast.Attribute(value=ast.Name(id="orb"), attr=attribute):
                assert attribute in NAMES
                used += 1
    assert used > 0


# ---- light doors ---------------------------------------------------------------------------------
HEAVY = {
    "numpy",
    "cv2",
    "orbslam2py._core",
    "matplotlib",
    "typer",
    "rich",
    "viser",
    "multiprocessing",
}

#: What importing a module may load of these.
LIGHT: dict[str, set[str]] = {
    "orbslam2py": set(),
    "orbslam2py.errors": set(),
    "orbslam2py.cli": set(),
    "orbslam2py.trajectory": {"numpy"},
    "orbslam2py.evaluation": {"numpy"},
}


@pytest.mark.parametrize("module", LIGHT)
def test_doors_are_light(module: str) -> None:
    code = f"import sys, {module}; print(*({HEAVY!r} & sys.modules.keys()))"
    done = run_script(code, timeout=60)
    assert done.returncode == 0, done.stderr
    assert set(done.stdout.split()) <= LIGHT[module]


def test_the_package_is_where_it_was_imported_from() -> None:
    """Scripts of other tests run the same package."""
    done = run_script("import orbslam2py; print(orbslam2py.__file__)", timeout=60)
    assert Path(done.stdout.strip()).samefile(orb.__file__)

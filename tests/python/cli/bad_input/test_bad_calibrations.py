# SPDX-License-Identifier: BSD-3-Clause
"""Settings of other programs that cannot be used, and what comes of following the message."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from orbslam2py import Sensor, Settings
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from support import bags
from support import other_settings as texts
from support.command_line import CommandLine
from support.refused_settings import (
    OURS,
    OURS_DEPTH,
    Case,
    instead,
    refuse_and_follow,
    without,
)
from support.spoilt_runs import run

pytestmark = pytest.mark.watchdog(40)

WHAT_HELPS = "orbslam2py settings new --sensor"


PAIR = texts.PAIR_V1
T_INVERSE = texts.pose_text(np.linalg.inv(texts.T_C1_C2))
T_MIRROR = texts.pose_text(texts.T_C1_C2 * [[1, 1, -1, 1]])

CASES = {
    # ---- other lenses --------------------------------------------------------------------------
    "all around": Case(
        texts.STELLA.replace("perspective", "equirectangular"),
        ("images of all directions (equirectangular)", "Make pinhole images", WHAT_HELPS),
    ),
    "division model": Case(
        texts.STELLA.replace("perspective", "radial_division"),
        ("division model of distortion", WHAT_HELPS),
    ),
    "unknown lens": Case(
        OURS + "Camera.type: Cylinder\n", ("a lens of the model Cylinder", "allowed: PinHole")
    ),
    # ---- keys that must not be read past -------------------------------------------------------
    "unknown key of the camera": Case(
        OURS + "Camera.flavour: 3\n",
        ("unknown key Camera.flavour", "describes the camera", "begin the line with #"),
        without("Camera.flavour"),
        lambda settings: settings.camera.fx == 517.3,
    ),
    "distortion elsewhere": Case(
        OURS + "Lens.k1: -0.28\n",
        ("unknown key Lens.k1; did you mean Camera.k1?",),
        instead("Lens.k1", "Camera.k1"),
        lambda settings: settings.camera.k1 == -0.28,
    ),
    "distortion of a third camera": Case(
        OURS + "Camera3.k1: -0.28\n",
        ("unknown key Camera3.k1, which by its name describes the camera",),
    ),
    "baseline": Case(
        OURS.replace("Camera.fx: 517.3", "Camera.fx: 500") + "ThDepth: 40\nbaseline: 0.12\n",
        ("did you mean Stereo.b (the baseline in metres)?",),
        instead("baseline", "Stereo.b"),
        lambda settings: settings.camera.bf == 0.12 * 500,
        "stereo",
    ),
    "metres per unit": Case(
        OURS_DEPTH.replace("DepthMapFactor: 5000.0", "depth_scale: 0.001"),
        ("did you mean DepthMapFactor: 1000 (units per metre)?",),
        instead("depth_scale: 0.001", "DepthMapFactor: 1000"),
        lambda settings: settings.depth_factor == 1000.0,
        "rgbd",
    ),
    "misspelt group": Case(
        OURS.replace("ORBextractor.nLevels", "ORBextracter.nLevels"),
        ("unknown key ORBextracter.nLevels; did you mean ORBextractor.nLevels?",),
        instead("ORBextracter", "ORBextractor"),
        lambda settings: settings.orb.n_levels == 8,
    ),
    "pose of a fisheye pair": Case(
        OURS_DEPTH + "Tlr: 3\n",
        ("Camera2.fx, Camera2.fy, Camera2.cx, Camera2.cy", "missing: a raw pair needs"),
        sensor="stereo",
    ),
    # ---- two numbers for one thing -------------------------------------------------------------
    "two focal lengths": Case(
        texts.MONO_V1 + "Camera.fx: 400\n",
        ("Camera1.fx is 460.5, and Camera.fx (line ", "which says the same, 400; keep the right"),
        without("Camera.fx"),
        lambda settings: settings.camera.fx == 460.5,
    ),
    "two baselines": Case(
        OURS_DEPTH + "Stereo.b: 0.5\n",
        ("Stereo.b 0.5 m makes Camera.bf 258.65", "is 40.0; keep the right one"),
        without("Camera.bf"),
        lambda settings: settings.camera.bf == 0.5 * 517.3,
        "stereo",
    ),
    "baseline that is no number": Case(
        texts.RECTIFIED_V1.replace("Stereo.b: 0.11", "Stereo.b: wide"),
        ("Stereo.b is wide; give the baseline in metres, above 0",),
        instead("Stereo.b: wide", "Stereo.b: 0.2"),
        lambda settings: settings.camera.bf == 0.2 * 460.5,
        "stereo",
    ),
    "focal length of 0": Case(
        texts.RECTIFIED_V1.replace("Camera1.fx: 460.5", "Camera1.fx: 0"),
        ("a.yaml:8: Camera1.fx is 0; allowed: greater than 0",),
        instead("Camera1.fx: 0", "Camera1.fx: 460.5"),
        lambda settings: settings.camera.bf == 0.11 * 460.5,
        "stereo",
    ),
    "colour order": Case(
        texts.STELLA.replace('color_order: "RGB"', 'color_order: "GBR"'),
        ("Camera.color_order is GBR; allowed: Gray, RGB, RGBA, BGR, BGRA",),
        instead("GBR", "RGBA"),
        lambda settings: settings.camera.rgb,
    ),
    # ---- images of another size ----------------------------------------------------------------
    "smaller images": Case(
        texts.MONO_V1 + "Camera.newWidth: 320\nCamera.newHeight: 240\n",
        (
            "Camera.newWidth is 320 and Camera.width 640",
            "Camera.newHeight is 240",
            "Begin the line with # to track them at the size that the calibration is for",
        ),
        without("Camera.new"),
        lambda settings: (settings.camera.fx, settings.camera.width) == (460.5, 640),
    ),
    "scaled images": Case(
        OURS + "Camera.imageScale: 0.5\n",
        ("Camera.imageScale is 0.5", "orbslam2py tracks them as they come"),
        without("Camera.imageScale"),
        lambda settings: settings.camera.fx == 517.3,
    ),
    # ---- pairs ---------------------------------------------------------------------------------
    "pair without its pose": Case(
        PAIR.replace(texts.pose_text(texts.T_C1_C2), ""),
        ("Stereo.T_c1_c2 missing", "camera 2 to camera 1, in metres"),
        lambda text: text + texts.pose_text(texts.T_C1_C2),
        lambda settings: abs(settings.baseline - 0.110022725) < 1e-8,
        "stereo",
    ),
    "pair without its second camera": Case(
        PAIR.replace("Camera2.fx: 458.0\n", ""),
        ("Camera2.fx missing: a raw pair",),
        sensor="stereo",
    ),
    "pair without a size": Case(
        PAIR.replace("Camera.width: 640\n", ""), ("Camera.width missing: a raw",), sensor="stereo"
    ),
    "second camera that is no camera": Case(
        PAIR.replace("Camera2.fy: 457.0", "Camera2.fy: -1"),
        ("Camera2.fy is -1; allowed: greater than 0",),
        instead("Camera2.fy: -1", "Camera2.fy: 457"),
        lambda settings: (
            settings.rectification is not None and settings.rectification.right.K[1, 1] == 457.0
        ),
        "stereo",
    ),
    "first camera that is no camera": Case(
        PAIR.replace("Camera1.fy: 459.5", "Camera1.fy: wide"),
        ("Error: a.yaml:9: Camera1.fy: 'wide' is not a number; allowed: greater than 0",),
        instead("wide", "459.5"),
        lambda settings: (
            settings.rectification is not None and settings.rectification.left.K[1, 1] == 459.5
        ),
        "stereo",
    ),
    "pose the other way": Case(
        PAIR.replace(texts.pose_text(texts.T_C1_C2), T_INVERSE),
        ("does not put camera 2 to the right of camera 1", "take the inverse"),
        instead(T_INVERSE, texts.pose_text(texts.T_C1_C2)),
        lambda settings: settings.rectification is not None and settings.camera.bf > 0,
        "stereo",
    ),
    "pose that is a mirror": Case(
        PAIR.replace(texts.pose_text(texts.T_C1_C2), T_MIRROR),
        ("Stereo.T_c1_c2 is no rigid transform", "4 x 4 numbers"),
        instead(T_MIRROR, texts.pose_text(texts.T_C1_C2)),
        lambda settings: settings.rectification is not None,
        "stereo",
    ),
    "pose of one place": Case(
        PAIR.replace(texts.pose_text(texts.T_C1_C2), texts.pose_text(np.eye(4))),
        ("Stereo.T_c1_c2", "have the same position"),
        sensor="stereo",
    ),
    "rectified, with two cameras": Case(
        PAIR.replace("PinHole", "Rectified"),
        ("Camera2.fx goes with a raw pair", "write PinHole if they are not"),
        instead("Rectified", "PinHole"),
        lambda settings: settings.rectification is not None,
        "stereo",
    ),
    "rectified in two ways": Case(
        PAIR + "LEFT.width: 640\n",
        ("LEFT.*, RIGHT.* both say how the pair is rectified; keep one",),
        without("LEFT.width"),
        lambda settings: settings.rectification is not None,
        "stereo",
    ),
    "half a rectifier": Case(
        texts.STELLA_STEREO.replace("  D_right", "# D_right"),
        ("StereoRectifier.D_right missing", "needs them all"),
        instead("# D_right", "  D_right"),
        lambda settings: (
            settings.rectification is not None and settings.rectification.right.D[0] == -0.27
        ),
        "stereo",
    ),
    "rectifier that turns nothing": Case(
        texts.STELLA_STEREO.replace("R_left: [1.0", "R_left: [2.0"),
        ("left: R is not a rotation",),
        sensor="stereo",
    ),
    "rectifier without numbers": Case(
        texts.STELLA_STEREO.replace("K_left: [460.5", "K_left: [wide"),
        ("StereoRectifier.K_left: 'wide' is not a number",),
        instead("wide", "460.5"),
        lambda settings: settings.camera.distortion.tolist() == [-0.28, 0.07, 0.0002, 0.0001],
    ),
    "what a pair lacks": Case(
        texts.MONO_V1 + "Stereo.b: 0.11\n",
        ("ThDepth is missing; stereo needs it",),
        lambda text: text + "Stereo.ThDepth: 40\n",
        lambda settings: settings.camera.bf == 0.11 * 460.5,
        "stereo",
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_a_file_is_refused_and_following_the_message_helps(command: CommandLine, name: str) -> None:
    refuse_and_follow(command, CASES[name])


# ---- a run says what is doubtful -----------------------------------------------------------------
def warned(command: CommandLine, folder: Path, *words: str) -> None:
    """One warning on the terminal, and the same in the report."""
    done = run(command, folder, "stereo", "--no-report")
    assert "Traceback" not in done.err
    said = [line for line in done.err.splitlines() if all(word in line for word in words)]
    assert len(said) == 1, done.err
    warnings = json.loads(Path("r/report.json").read_text())["warnings"]
    assert sum(all(word in text for word in words) for text in warnings) == 1, warnings


def test_baseline_in_millimetres_of_kitti(command: CommandLine, stereo: Path) -> None:
    path = stereo / "calib.txt"
    text = path.read_text()
    assert "-20.0" in text
    path.write_text(text.replace("-20.0", "-20000.0"))
    (stereo / "settings.yaml").unlink(missing_ok=True)
    warned(command, stereo, "a baseline of 100 m", "in millimetres?")


def test_baseline_in_millimetres_of_a_file(command: CommandLine, stereo: Path) -> None:
    settings = Settings.from_yaml(
        texts.RECTIFIED_V1.replace("Stereo.b: 0.11", "Stereo.b: 110"), Sensor.STEREO
    )
    settings.save(stereo / "settings.yaml")
    warned(command, stereo, "a baseline of 110 m", "in millimetres?")


def test_baseline_in_millimetres_of_euroc(command: CommandLine, tmp_path: Path) -> None:
    options = SyntheticOptions(world="corridor", sensor="stereo", frames=4, size=(320, 240))
    folder = Path(SyntheticSequence(options).write(tmp_path / "mav", "euroc"))
    path = folder / "mav0/cam1/sensor.yaml"
    text = path.read_text()
    assert "0.0, 0.0, 0.1," in text
    path.write_text(text.replace("0.0, 0.0, 0.1,", "0.0, 0.0, 100.0,"))
    warned(command, folder, "a baseline of 100 m", "in millimetres?")


def test_baseline_in_millimetres_of_a_bag(command: CommandLine, tmp_path: Path) -> None:
    image = np.random.default_rng(3).integers(0, 256, (240, 320)).astype(np.uint8)
    K = np.array([[200.0, 0, 155], [0, 200, 118], [0, 0, 1]])
    messages = []
    for k in range(3):
        for side, bf in (("left", 0.0), ("right", 24000.0)):
            stamp = bags.START + k * 50_000_000
            P = np.column_stack([K, [-bf, 0, 0]])
            info = {"size": (320, 240), "K": K, "D": (0.0,) * 5, "R": np.eye(3), "P": P}
            messages.append(bags.camera_info(f"/{side}/camera_info", stamp, **info))  # type: ignore[arg-type]
            messages.append(bags.raw_image(f"/{side}/image_rect", stamp, image, "mono8"))
    path = bags.write(tmp_path / "b", bags.KINDS[0], messages)
    warned(command, path, "a baseline of 120 m", "in millimetres?")


def test_a_lens_that_cannot_be(command: CommandLine, stereo: Path) -> None:
    text = texts.MONO_V1.replace("Camera1.p1: 0.0002", "Camera1.p1: -0.25")
    Path("a.yaml").write_text(text.replace("640", "320").replace("480", "240"))
    done = command(
        *("run", stereo / "image_0", "--sensor", "mono", "--settings", "a.yaml"),
        *("--output", "r", "--no-report"),
    )
    assert done.err.count("tangential distortion p1 -0.25") == 1, done.err
    warnings = json.loads(Path("r/report.json").read_text())["warnings"]
    assert any("k3, k4 of a fisheye lens" in text for text in warnings)

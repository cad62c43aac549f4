# SPDX-License-Identifier: BSD-3-Clause
"""Settings of fisheye lenses that cannot be used, and what comes of following the message."""

from __future__ import annotations

from pathlib import Path

import pytest

from support import fisheye_cameras as fisheyes
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
from support.spoilt_runs import expect_refused, run

pytestmark = pytest.mark.watchdog(40)

FOUR = "Camera.k1: -0.01\nCamera.k2: 0.05\nCamera.k3: -0.04\nCamera.k4: 0.01\n"
FISHEYE = (
    "belongs to a fisheye calibration (Kannala-Brandt, k1 to k4)",
    "if it is a rational distortion, add k5 and k6 (0 if there are none)",
)

CASES = {
    "four radial": Case(
        OURS + FOUR,
        ("Camera.k4 without k5 and k6", *FISHEYE, "add the line Camera.type: KannalaBrandt8"),
        lambda text: text + "Camera.type: KannalaBrandt8\n",
        lambda settings: settings.camera.lens == (-0.01, 0.05, -0.04, 0.01),
    ),
    "four radial of six": Case(
        OURS + FOUR,
        ("Camera.k4 without k5 and k6", *FISHEYE),
        lambda text: text + "Camera.k5: 0\nCamera.k6: 0\n",
        lambda settings: settings.camera.k4 == 0.01 and not settings.camera.is_fisheye,
    ),
    "four radial, p1 and p2 of 0": Case(
        OURS + FOUR + "Camera.p1: 0\nCamera.p2: 0\n",
        ("Camera.k4 without k5", *FISHEYE),
        lambda text: text + "Camera.type: KannalaBrandt8\n",
        lambda settings: settings.camera.lens == (-0.01, 0.05, -0.04, 0.01),
    ),
    "fourth radial of 0": Case(
        OURS + FOUR.replace("k4: 0.01", "k4: 0"), ("Camera.k4 without k5 and k6", *FISHEYE)
    ),
    "four radial of a PinHole": Case(
        texts.MONO_V1.replace("Camera1.p1: 0.0002\nCamera1.p2", "Camera1.k3: 0.1\nCamera1.k4"),
        ("Camera1.k4 without", *FISHEYE, "write KannalaBrandt8 in place of PinHole"),
        instead("PinHole", "KannalaBrandt8"),
        lambda settings: settings.camera.lens == (-0.28, 0.07, 0.1, 0.0001),
    ),
    "coefficients of a pinhole": Case(
        texts.MONO_V1.replace("PinHole", "KannalaBrandt8"),
        (
            "Camera1.p1 is 0.0002, and the lens of Camera.type KannalaBrandt8 has Camera.k1, ",
            "needs Camera.k1, Camera.k2, Camera.k3, Camera.k4; add Camera.k3, Camera.k4",
            "name the model to which all coefficients belong",
        ),
        instead("KannalaBrandt8", "PinHole"),
        lambda settings: settings.camera.p1 == 0.0002,
    ),
    "five numbers": Case(
        fisheyes.MONO + "Camera1.k5: 0.1\n",
        ("Camera1.k5 is 0.1, and the lens of Camera.type KannalaBrandt8 has Camera.k1",),
        without("Camera1.k5"),
        lambda settings: settings.camera.lens == fisheyes.KB,
    ),
    "no fourth": Case(
        fisheyes.MONO.replace("Camera1.k4: -0.001\n", ""),
        ("a.yaml:3: Camera.type KannalaBrandt8 needs Camera.k1,", "Camera.k4; add Camera.k4"),
        lambda text: text + "Camera1.k4: -0.001\n",
        lambda settings: settings.camera.lens == fisheyes.KB,
    ),
    "no number": Case(
        fisheyes.MONO.replace("k4: -0.001", "k4: some"), ("'some' is not a number", "give a finite")
    ),
    "alpha": Case(
        fisheyes.orb_slam3(texts.MONO_V1, {"xi": -0.2, "alpha": 1.4}, "DoubleSphere"),
        ("a.yaml:3: camera model double_sphere: alpha is 1.4; give a number from 0 to 1",),
        instead("1.4", "0.6"),
        lambda settings: settings.camera.lens == (-0.2, 0.6),
    ),
    "a lens without its model": Case(
        OURS + "Camera.xi: -0.2\nCamera.alpha: 0.6\n",
        ("Camera.xi belongs to a fisheye lens", "give Camera.type: DoubleSphere or Mei"),
        lambda text: text + "Camera.type: DoubleSphere\n",
        lambda settings: settings.camera.lens == (-0.2, 0.6),
    ),
    "a lens of another model": Case(
        texts.MONO_V1 + "Camera1.omega: 0.9\n",
        ("Camera1.omega belongs to a fisheye lens, and Camera.type PinHole has no such",),
        without("Camera1.omega"),
        lambda settings: not settings.camera.is_fisheye,
    ),
    "a misspelt parameter": Case(
        OURS + "Camera.type: FOV\nCamera.omga: 0.9\n",
        ("unknown key Camera.omga; did you mean Camera.omega?", "FOV needs Camera.omega; add"),
        instead("omga", "omega"),
        lambda settings: settings.camera.lens == (0.9,),
    ),
    "two models": Case(
        fisheyes.MONO.replace("KannalaBrandt8", "PinHole") + "Camera.bFishEye: 1\n",
        ("Camera.bFishEye 1 contradicts Camera.type PinHole; keep the one that is right",),
        instead("PinHole", "KannalaBrandt8"),
        lambda settings: settings.camera.lens == fisheyes.KB,
    ),
    "Camera.bFishEye": Case(
        OURS + "Camera.bFishEye: 1\n",
        ("Camera.bFishEye 1 needs Camera.k1, Camera.k2, Camera.k3, Camera.k4; add Camera.k1",),
        lambda text: text + FOUR,
        lambda settings: settings.camera.lens == (-0.01, 0.05, -0.04, 0.01),
    ),
    "right camera of a pinhole in a fisheye pair": Case(
        fisheyes.PAIR,
        ("Camera2.k3, Camera2.k4 missing: a raw pair needs Camera1.* and Camera2.*",),
        lambda text: text.replace("Camera2.p1: -0.0001", "Camera2.k3: 0.1").replace(
            "Camera2.p2: 0.0003", "Camera2.k4: 0.0"
        ),
        lambda settings: settings.right is None and settings.rectification is not None,
        sensor="stereo",
    ),
    "tangential distortion of a right fisheye": Case(
        fisheyes.PAIR + "Camera2.k3: 0.1\nCamera2.k4: 0.0\n",
        ("Camera2.p", "the lens kannala_brandt has k1, k2, k3, k4 alone; name the model"),
        sensor="stereo",
    ),
    "left fisheye without a right one": Case(
        fisheyes.MONO + "Camera.bf: 40\nThDepth: 40\n",
        ("Camera.type KannalaBrandt8: a stereo pair", "Camera2.fx", "--sensor mono"),
        sensor="stereo",
    ),
    "five coefficients of a rectified fisheye": Case(
        texts.STELLA_STEREO.replace('  model: "perspective"\n  K_', '  model: "fisheye"\n  K_'),
        ("left: a kannala_brandt camera has 4 lens parameters, got 5; give k1, k2, k3, k4",),
        sensor="stereo",
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_a_lens_is_refused_and_following_the_message_helps(command: CommandLine, name: str) -> None:
    refuse_and_follow(command, CASES[name])


def test_a_fisheye_is_refused_by_a_run(command: CommandLine, stereo: Path) -> None:
    (stereo / "settings.yaml").write_text(OURS_DEPTH + FOUR)
    expect_refused(run(command, stereo, "stereo"), "settings.yaml", *FISHEYE)

# SPDX-License-Identifier: BSD-3-Clause
"""Being lost is told: how often, how long, why, and what helps."""

from __future__ import annotations

import logging
from types import SimpleNamespace
from typing import Any

import pytest

from orbslam2py import Reason, run_sequence
from orbslam2py.runs import RunOptions, SystemOptions
from orbslam2py.runs.losses import find_losses, last_loss_warning, losses_report
from orbslam2py.runs.remedies import what_helps, why_nothing_was_tracked
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from support.made_up_rows import rows_of

pytestmark = pytest.mark.watchdog(20)


def figures(letters: str) -> dict[str, Any]:
    return losses_report(rows_of(letters))


def test_never_lost() -> None:
    for letters in ("", "nnkkk", "kkdkskk", "nnnn", "kkkss"):
        told = figures(letters)
        assert (told["lost"], told["lost_frames"], told["lost_seconds"]) == (0, 0, 0.0)
        assert (told["lost_at_end"], told["lost_reasons"], told["losses"]) == (False, {}, [])


def test_how_often_and_how_long() -> None:
    told = figures("nkkrlllkkilkk")
    assert told["lost"] == 2
    assert told["lost_frames"] == 6
    assert told["lost_seconds"] == pytest.approx(0.6)
    assert told["longest_loss_seconds"] == pytest.approx(0.4)
    assert told["lost_at_end"] is False
    assert told["lost_reasons"] == {
        "not found in the map": 4,
        "too few matches with the reference keyframe": 1,
        "too few inliers in the local map": 1,
    }
    assert [(loss["frame"], loss["frames"]) for loss in told["losses"]] == [(3, 4), (9, 2)]
    assert told["losses"][1] == {
        "map": 0,
        "frame": 9,
        "timestamp": 0.9,
        "frames": 2,
        "seconds": pytest.approx(0.2),
        "reason": "too few inliers in the local map",
        "found_again": True,
    }


def test_a_new_map_ends_a_loss_only_when_it_has_begun() -> None:
    told = figures("kkrnnnkk")
    assert (told["lost"], told["lost_frames"]) == (1, 4)
    assert told["longest_loss_seconds"] == pytest.approx(0.4)
    assert told["lost_reasons"] == {"too few matches with the reference keyframe": 1}


def test_frames_that_nobody_looked_at_are_not_counted() -> None:
    told = figures("kkrdslkk")
    assert (told["lost"], told["lost_frames"]) == (1, 2)
    assert told["lost_seconds"] == pytest.approx(0.4)


@pytest.mark.parametrize("letters", ["kkkrlll", "kkkrnnn", "kkkrllls"])
def test_lost_at_the_end(letters: str) -> None:
    told = figures(letters)
    assert told["lost_at_end"] is True
    assert told["losses"][0]["found_again"] is False
    assert told["lost_seconds"] == pytest.approx(0.3)
    warning = last_loss_warning(find_losses(rows_of(letters)))
    assert warning is not None
    assert "lost at the end" in warning
    assert "from frame 3 on (4 frames, 0.3 s)" in warning
    assert "too few matches with the reference keyframe" in warning
    assert f"what helps: {what_helps(Reason.FEW_MATCHES_REFERENCE)}" in warning


def test_found_again_is_no_warning() -> None:
    assert last_loss_warning(find_losses(rows_of("kkrlk"))) is None
    assert last_loss_warning([]) is None


def test_every_reason_has_a_remedy() -> None:
    for reason in Reason:
        assert bool(what_helps(reason)) == (reason is not Reason.NONE), reason
    assert "--realtime" in what_helps("dropped to keep up with real time")
    assert what_helps("image 5 is empty") == ""


@pytest.mark.parametrize(
    ("letters", "reason"),
    [
        ("fmfmfmfmn", "too few matches with the first view (4 of 9 frames)"),
        ("fmfmnnnn", "too few keypoints (4 of 8 frames)"),
        ("mmmn", "too few matches with the first view (3 of 4 frames)"),
        ("f", "first of two views taken; waiting for the camera to move (1 of 1 frame)"),
        ("ssssnn", "image 0 is empty (and 3 more frames skipped)"),
        ("s", "image 0 is empty"),
    ],
)
def test_why_nothing_was_tracked_is_the_commonest_reason(letters: str, reason: str) -> None:
    told = why_nothing_was_tracked(rows_of(letters))
    assert told.split("; what helps: ")[0] == reason
    assert ("what helps" in told) == ("s" not in letters)


def test_a_doubted_calibration_comes_before_every_other_remedy() -> None:
    told = why_nothing_was_tracked(rows_of("nnn"), calibration_is_doubted=True)
    assert told.startswith("most likely because of the calibration, see the warning above")
    assert "calibration" not in why_nothing_was_tracked(rows_of("nnn"))


def test_one_frame_is_one() -> None:
    assert "of 1 frame)" in why_nothing_was_tracked(rows_of("n"))


def test_no_frames() -> None:
    assert why_nothing_was_tracked([]) == "no frames"


class Dark(SyntheticSequence):
    """The light goes out."""

    def load(self, index: int, /):  # type: ignore[no-untyped-def]
        images = super().load(index)
        if index >= 12:
            images.image[:] = 0
        return images


def test_a_run_that_ends_lost_warns(caplog: pytest.LogCaptureFixture) -> None:
    sequence = Dark(SyntheticOptions(world="corridor", sensor="rgbd", size=(320, 240), frames=15))
    options = RunOptions("rgbd", SystemOptions(deterministic=True))
    with caplog.at_level(logging.WARNING, "orbslam2py"):
        done = run_sequence(sequence, options)
    assert done.report["lost_at_end"] is True
    assert done.report["lost"] == 1
    (message,) = [r.getMessage() for r in caplog.records if "lost" in r.getMessage()]
    assert "what helps: " in message
    assert SimpleNamespace(**done.report["losses"][0]).frame == 12

# SPDX-License-Identifier: BSD-3-Clause
"""Losses of tracking: when, how long, and why."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from orbslam2py._arguments import number_of
from orbslam2py.runs.remedies import what_helps
from orbslam2py.runs.result import FrameRow
from orbslam2py.slam.records import TrackingRecord, TrackingState


@dataclass(frozen=True)
class Loss:
    """Frames without a pose, from the loss to the next frame with a pose."""

    map_index: int
    """The map that was lost."""
    index: int
    """Index in the sequence of the first frame without a pose."""
    timestamp: float
    """Of that frame [s]."""
    reason: str
    """Why this frame has no pose."""
    n_frames: int
    """Number of frames without a pose, also while another map was starting."""
    seconds: float
    """Time from the first of them to the next pose, or to the last frame if there was none."""
    found_again: bool
    """Whether a later frame had a pose, in the same map or in a new one."""


def find_losses(rows: Iterable[FrameRow]) -> list[Loss]:
    """Find every loss of tracking, in the order of the frames."""
    losses: list[Loss] = []
    first: FrameRow | None = None
    waiting: list[TrackingRecord] = []
    for row in rows:
        record = row.record
        if record is None:
            continue
        if record.state is TrackingState.OK:
            if first is not None:
                losses.append(_loss(first, waiting, record))
            first, waiting = None, []
        elif first is not None or record.state is TrackingState.LOST:
            first = first or row
            waiting.append(record)
    if first is not None:
        losses.append(_loss(first, waiting, None))
    return losses


def _loss(first: FrameRow, waiting: list[TrackingRecord], found: TrackingRecord | None) -> Loss:
    begin = waiting[0]
    return Loss(
        map_index=begin.map_index,
        index=first.index,
        timestamp=begin.timestamp,
        reason=first.reason,
        n_frames=len(waiting),
        seconds=(found or waiting[-1]).timestamp - begin.timestamp,
        found_again=found is not None,
    )


def losses_report(rows: Sequence[FrameRow]) -> dict[str, Any]:
    """Make the entries of report.json about losses."""
    losses = find_losses(rows)
    reasons = Counter(
        row.reason
        for row in rows
        if row.record is not None and row.record.state is TrackingState.LOST
    )
    return {
        "lost": len(losses),
        "lost_frames": sum(loss.n_frames for loss in losses),
        "lost_seconds": round(sum(loss.seconds for loss in losses), 6),
        "longest_loss_seconds": round(max((loss.seconds for loss in losses), default=0.0), 6),
        "lost_at_end": bool(losses) and not losses[-1].found_again,
        "lost_reasons": dict(reasons.most_common()),
        "losses": [loss_entry(loss) for loss in losses],
    }


def loss_entry(loss: Loss) -> dict[str, Any]:
    """Make the entry of report.json about one loss."""
    return {
        "map": loss.map_index,
        "frame": loss.index,
        "timestamp": loss.timestamp,
        "frames": loss.n_frames,
        "seconds": round(loss.seconds, 6),
        "reason": loss.reason,
        "found_again": loss.found_again,
    }


def last_loss_warning(losses: Sequence[Loss]) -> str | None:
    """Return a message if tracking was lost at the end, with reason and remedy; else None."""
    if not losses or losses[-1].found_again:
        return None
    loss = losses[-1]
    frames = number_of(loss.n_frames, "frame")
    text = (
        f"lost at the end: no pose from frame {loss.index} on ({frames}, "
        f"{loss.seconds:.1f} s), because of {loss.reason}"
    )
    remedy = what_helps(loss.reason)
    return f"{text}; what helps: {remedy}" if remedy else text

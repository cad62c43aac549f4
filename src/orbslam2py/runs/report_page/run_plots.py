# SPDX-License-Identifier: BSD-3-Clause
"""The plots of one run over time: error, states, inliers, keyframes, times."""

from __future__ import annotations

from collections import Counter

import numpy as np
import numpy.typing as npt

from orbslam2py._arrays import FloatArray
from orbslam2py.runs.report_page.explained import STAGES
from orbslam2py.runs.report_page.markup import Markup, element
from orbslam2py.runs.report_page.plot import Line, Mark, Span, TimePlot, strip
from orbslam2py.runs.report_page.round_numbers import short
from orbslam2py.runs.report_page.run_folder import Frames
from orbslam2py.runs.report_page.story import Story, positions_of

#: Class and name of every state, in the order of the legend.
STATES = {
    "OK": ("ok", "tracked"),
    "WEAK": ("weak", "tracked with weak evidence"),
    "LOST": ("lost", "lost"),
    "NOT_INITIALIZED": ("waiting", "no map yet"),
    "DROPPED": ("dropped", "dropped"),
    "SKIPPED": ("skipped", "skipped"),
}
_EVENTS = {
    "loop": "loop closed",
    "relocalised": "found again",
    "map": "another map",
    "merge": "maps became one",
}

#: A few frames that took longest do not squeeze the others.
_SHOWN_PART = 0.995


def error_plot(story: Story) -> TimePlot | None:
    """Return the distance to the ground truth; None without one."""
    if not story.has_truth:
        return None
    seconds = story.run.frames.seconds
    places = [moment.position for moment in story.worst]
    peaks = np.array(places, np.int64)
    rmse = float(story.run.report["ate_rmse_m"])
    return TimePlot(
        "plot-error",
        "Distance to the ground truth",
        story.run.unit,
        [
            Line("error", seconds, story.errors, "s-error"),
            Line("RMSE", np.array([0.0, story.duration]), np.array([rmse, rmse]), "s-level"),
            Line("worst places", seconds[peaks], story.errors[peaks], "s-worst", "dots"),
        ],
        story.duration,
        spans=untracked(story),
        marks=loop_marks(story),
    )


def state_strip(story: Story) -> Markup:
    """Return states over time, with keyframes and events below them."""
    frames = story.run.frames
    seconds = frames.seconds
    there = Counter(_shown_states(frames).tolist())
    legend = [
        (look, f"{name}: {there[state]}")
        for state, (look, name) in STATES.items()
        if there[state] or state == "OK"
    ]
    kinds = {event.kind for event in story.events}
    legend += [(f"m-{kind}", name) for kind, name in _EVENTS.items() if kind in kinds]
    marks = [
        Mark(float(seconds[event.position]), f"m-{event.kind}", event.text)
        for event in story.events
        if event.kind in _EVENTS
    ]
    return strip(
        "plot-states",
        "State of tracking",
        state_spans(frames),
        seconds[frames.is_keyframe],
        marks,
        story.duration,
        legend,
    )


def inliers_plot(story: Story) -> TimePlot:
    """Return the inliers of the pose."""
    frames = story.run.frames
    inliers = np.where(frames.state == "OK", frames.inliers, np.nan)
    return TimePlot(
        "plot-inliers",
        "Inliers",
        "keypoints that agree with the pose",
        [Line("", frames.seconds, inliers, "s-inliers")],
        story.duration,
        spans=untracked(story),
        marks=loop_marks(story),
    )


def found_plot(story: Story) -> TimePlot | None:
    """Return the visibility ratio; None if it was not counted."""
    frames = story.run.frames
    if not np.isfinite(frames.found).any():
        return None
    weak = frames.is_weak & frames.has_pose
    lines = [Line("", frames.seconds, 100 * frames.found, "s-inliers")]
    if weak.any():
        dots = Line("weak", frames.seconds[weak], 100 * frames.found[weak], "s-worst", "dots")
        lines.append(dots)
    return TimePlot(
        "plot-found",
        "Points found",
        "% of the map points that should be in view",
        lines,
        story.duration,
        spans=untracked(story),
        marks=loop_marks(story),
    )


def keyframes_plot(story: Story) -> TimePlot:
    """Return the number of keyframes created until each moment, and how many of these remain."""
    run = story.run
    seconds = run.frames.seconds
    ends = np.array([0.0, story.duration])
    made = np.sort(seconds[run.frames.is_keyframe])
    left = np.sort(seconds[positions_of(run, run.keyframes)])
    lines = [
        Line(name, *_count(times, ends), look, "steps")
        for name, times, look in (("made", made, "s-made"), ("left at the end", left, "s-left"))
    ]
    return TimePlot(
        "plot-keyframes", "Keyframes", "since the beginning", lines, story.duration,
        marks=loop_marks(story),
    )  # fmt: skip


def times_plot(story: Story) -> TimePlot | None:
    """Return the times of the stages, stacked; None without any."""
    frames = story.run.frames
    stages = {name: frames.milliseconds.get(name) for name in STAGES}
    known = {name: np.nan_to_num(ms) for name, ms in stages.items() if ms is not None}
    known = {name: ms for name, ms in known.items() if ms.any()}
    if not known:
        return None
    total = np.sum(list(known.values()), axis=0)
    sums = np.cumsum(list(known.values()), axis=0)
    names = list(known)
    lines = [
        Line(names[k], frames.seconds, sums[k],
             f"stage{list(STAGES).index(names[k])}", "area")
        for k in reversed(range(len(names)))
    ]  # fmt: skip
    top = 1.15 * float(np.quantile(total, _SHOWN_PART))
    above = int(np.sum(total > top))
    note = ""
    if above:
        frames_text = "1 frame is" if above == 1 else f"{above} frames are"
        note = f"{frames_text} above the upper edge; the longest took {short(total.max())} ms."
    return TimePlot(
        "plot-times", "Time per stage of tracking", "ms", lines, story.duration,
        top=top if above else None, note=note,
    )  # fmt: skip


def untracked(story: Story) -> list[Span]:
    """Return the periods without a pose, for the background of a plot."""
    return [
        Span(span.begin, span.end, f"back {span.look}", span.title)
        for span in state_spans(story.run.frames)
        if span.look not in ("ok", "weak", "dropped")
    ]


def loop_marks(story: Story) -> list[Mark]:
    """Return the moments at which the map moved: loop closures and merges."""
    seconds = story.run.frames.seconds
    return [
        Mark(float(seconds[event.position]), f"m-{event.kind}", event.text)
        for event in story.events
        if event.kind in ("loop", "merge")
    ]


def state_spans(frames: Frames) -> list[Span]:
    """Return the periods of frames in one state, each up to the next."""
    if not len(frames):
        return []
    seconds = frames.seconds
    step = float(np.median(np.diff(seconds))) if len(seconds) > 1 else 1.0
    states = _shown_states(frames)
    starts = np.flatnonzero(np.append(True, states[1:] != states[:-1]))
    ends = np.append(starts[1:], len(frames))
    after = np.append(seconds, seconds[-1] + step)
    spans = []
    for begin, end in zip(starts.tolist(), ends.tolist(), strict=True):
        look, name = STATES.get(str(states[begin]), ("skipped", str(states[begin])))
        reasons = Counter(reason for reason in frames.reason[begin:end] if reason)
        why = "".join(f"; {reason} ({count})" for reason, count in reasons.most_common(3))
        title = f"{name}: frames {frames.index[begin]} to {frames.index[end - 1]}{why}"
        spans.append(Span(float(seconds[begin]), float(after[end]), look, title))
    return spans


def _shown_states(frames: Frames) -> npt.NDArray[np.str_]:
    """Return the states, with a separate state for weak evidence."""
    shown: npt.NDArray[np.str_] = np.where(frames.is_weak & frames.has_pose, "WEAK", frames.state)
    return shown


def _count(times: FloatArray, ends: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return a staircase with a step of one at each time, between the two `ends`."""
    x = np.concatenate([ends[:1], times, ends[1:]])
    y = np.concatenate([[0], np.arange(1, len(times) + 1), [len(times)]]).astype(float)
    return x, y


def reasons_rows(frames: Frames, help_of: dict[str, str]) -> list[list[str | Markup]]:
    """Return the reasons of frames without a pose: numbers and remedies."""
    counts = Counter(
        (str(state), reason)
        for state, reason in zip(frames.state, frames.reason, strict=True)
        if reason
    )
    rows: list[list[str | Markup]] = []
    for (state, reason), count in counts.most_common(20):
        look, name = STATES.get(state, ("skipped", state))
        label = element("span", element("i", class_=look), name, class_="key")
        rows.append([label, reason, str(count), help_of.get(reason, "")])
    return rows

# SPDX-License-Identifier: BSD-3-Clause
"""Time from the exposure of a live image to its pose, by stage."""

from __future__ import annotations

from orbslam2py.datasets.base import FrameTimes

#: Stages of the latency in their order, with descriptions.
LATENCY_STAGES = {
    "latency.transport": "from the middle of the exposure until the image is in this computer",
    "latency.pairing": "waiting for the other image of the same moment",
    "latency.queue": "waiting for the frame before, and for samples of the IMU",
    "latency.prepare": "rectifying and converting",
    "latency.track": "tracking",
    "latency.total": "all of them; from the arrival if the camera does not give the exposure",
}


def latency_of(times: FrameTimes, tracked: float) -> dict[str, float]:
    """Return milliseconds by stage.

    Parameters
    ----------
    times
        When the frame passed its stages.
    tracked
        When its pose was known, on the clock of ``time.monotonic()``.
    """
    begin = times.arrival if times.exposure is None else times.exposure
    seconds = {
        "latency.pairing": times.complete - times.arrival,
        "latency.queue": times.taken - times.complete,
        "latency.prepare": times.ready - times.taken,
        "latency.track": tracked - times.ready,
        "latency.total": tracked - begin,
    }
    if times.exposure is not None:
        seconds = {"latency.transport": times.arrival - times.exposure, **seconds}
    return {stage: 1e3 * value for stage, value in seconds.items()}


def latency_words(latency: dict[str, float]) -> str:
    """Say the latency of a frame in one line."""
    parts = [
        f"{latency[stage]:.0f} {stage.removeprefix('latency.')}"
        for stage in LATENCY_STAGES
        if stage in latency and stage != "latency.total"
    ]
    return f"latency {latency['latency.total']:.0f} ms: {', '.join(parts)}"

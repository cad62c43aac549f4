# SPDX-License-Identifier: BSD-3-Clause
"""A self-contained page: text, drawings, style, script, images."""

from __future__ import annotations

import base64
import hashlib
import re
from enum import Enum
from pathlib import Path
from typing import Any

from orbslam2py._version import __version__
from orbslam2py.runs.report_page import sections
from orbslam2py.runs.report_page.explained import compared_over, is_of_last_map_only
from orbslam2py.runs.report_page.imu_section import imu_section
from orbslam2py.runs.report_page.maps_section import maps_section
from orbslam2py.runs.report_page.markup import Markup, element, join, section, table
from orbslam2py.runs.report_page.path_section import path_section
from orbslam2py.runs.report_page.round_numbers import NONE
from orbslam2py.runs.report_page.run_folder import RunFolder
from orbslam2py.runs.report_page.scene import script_data
from orbslam2py.runs.report_page.story import Story

_FOLDER = Path(__file__).parents[2] / "data" / "report_page"
#: Beginning of the page's head about the program; the version follows.
_MADE_BY = '<meta name="generator" content="orbslam2py '
#: Part of the head about the contents; those of earlier versions are recognised by their titles.
_IS_OF = '<meta name="orbslam2py-page" content="'
#: Bytes in which these come.
_HEAD = 4096


class PageKind(str, Enum):
    """The kind of a page."""

    RUN = "run"
    COMPARISON = "comparison"
    BENCHMARK = "benchmark"

    def __str__(self) -> str:
        return self.value


_OLD_TITLES = (
    (re.compile(r"<title>\d+ runs: "), PageKind.COMPARISON),
    (re.compile(r": benchmark - orbslam2py</title>"), PageKind.BENCHMARK),
)


def run_page(run: RunFolder) -> str:
    """Make the page of a run."""
    story = Story.of(run)
    report = run.report
    parts = {
        "path": path_section(story),
        "error": sections.error_section(story),
        "tracking": sections.tracking_section(story),
        "imu": imu_section(story),
        "times": sections.time_section(story),
        "images": sections.images_section(story),
        "maps": maps_section(story),
        "figures": sections.figures_section(story),
        "repeat": repeat_section(report),
    }
    titles = {"error": "Error", "figures": "All figures", "imu": "IMU"}
    links = [(name, titles.get(name, name.capitalize())) for name, part in parts.items() if part]
    told = f"{report.get('sensor')}, {report.get('layout')}"
    when = report.get("started")
    subtitle = (
        f"{told}{f', {_date(str(when))}' if when else ''}, orbslam2py {report.get('version')}"
    )
    body = join(
        _error(report), _warnings(report), _notes(report), sections.tiles(story), *parts.values()
    )
    return whole_page(run.name, subtitle, links, body, script_data(story), kind=PageKind.RUN)


def kind_of_page(path: Path) -> PageKind | None:
    """Return the kind of a page of this package, of any version; None for other files."""
    try:
        with path.open("rb") as stream:
            head = stream.read(_HEAD).decode(errors="replace")
    except OSError:
        return None
    if _MADE_BY not in head:
        return None
    told = head.partition(_IS_OF)[2].partition('"')[0]
    if told in {kind.value for kind in PageKind}:
        return PageKind(told)
    return next((kind for title, kind in _OLD_TITLES if title.search(head)), PageKind.RUN)


def whole_page(
    title: str,
    subtitle: str,
    links: list[tuple[str, str]],
    body: Markup,
    data: Markup,
    *,
    kind: PageKind = PageKind.BENCHMARK,
) -> str:
    """Put header, style, script and data around the parts of a page.

    The content security policy of the page forbids all loading, and all scripts except the page's
    own.
    """
    style, script = (
        (_FOLDER / name).read_text(encoding="utf-8") for name in ("page.css", "page.js")
    )
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    policy = f"default-src 'none'; script-src 'sha256-{digest}'; "
    policy += "style-src 'unsafe-inline'; img-src data:"
    head = join(
        Markup('<meta charset="utf-8">'),
        Markup(f'<meta http-equiv="Content-Security-Policy" content="{policy}">'),
        Markup('<meta name="viewport" content="width=device-width, initial-scale=1">'),
        Markup('<meta name="color-scheme" content="light dark">'),
        Markup(f'{_MADE_BY}{__version__}">'),
        Markup(f'{_IS_OF}{kind}">'),
        Markup('<link rel="icon" href="data:,">'),
        element("title", f"{title} - orbslam2py"),
        Markup(f"<style>{style}</style>"),
    )
    switch = element("button", "Dark or light", type="button", id="theme", hidden=True)
    navigation = element("nav", *(element("a", text, href=f"#{name}") for name, text in links),
                         aria_label="Parts of the page")  # fmt: skip
    header = element(
        "header", element("div", element("h1", title), element("p", subtitle)), switch, navigation
    )
    cursor = element("aside", id="cursor", hidden=True, aria_live="polite")
    footer = element("footer", f"Made by orbslam2py {__version__}. The page loads nothing.")
    content = join(header, element("main", body), footer, cursor, data)
    return (
        f'<!doctype html>\n<html lang="en">\n<head>{head}</head>\n'
        f"<body>{content}\n<script>{script}</script></body>\n</html>\n"
    )


def repeat_section(report: dict[str, Any]) -> Markup:
    """Return all that is needed to repeat the run: command, options, machine, settings."""
    command = report.get("command")
    if command:
        told = join(
            element("pre", element("code", command)),
            element("p", f"in the folder {report.get('command_folder')}", class_="note"),
        )
    else:
        told = element("p", "The run was started from Python: no command was given.")
    options = {
        "sensor": report.get("sensor"),
        "deterministic": report.get("deterministic"),
        "realtime": report.get("realtime"),
        "seed": report.get("seed"),
        **report.get("options", {}),
    }
    rows: list[list[str | Markup]] = [
        [name.replace("_", " "), _said(value)] for name, value in options.items()
    ]
    machine: list[list[str | Markup]] = [
        [name.replace("_gb", " [GB]"), _said(value)]
        for name, value in report.get("machine", {}).items()
    ]
    return section(
        "repeat",
        "Repeat",
        told,
        element(
            "div",
            element("div", element("h3", "Options"), table([], rows)),
            element("div", element("h3", "Machine"), table([], machine)) if machine else None,
            class_="pair tables",
        ),
        element("details", element("summary", "Settings of the camera and the features"),
                element("pre", element("code", str(report.get("settings", ""))))),
    )  # fmt: skip


def _date(text: str) -> str:
    """Return an ISO date for readers, to the minute."""
    day, _, time = text.partition("T")
    return f"{day} {time[:5]}" if time else day


def _said(value: object) -> str:
    if value is None:
        return NONE
    if isinstance(value, bool):
        return "yes" if value else "no"
    return str(value)


def _error(report: dict[str, Any]) -> Markup | None:
    """Return why the run ended early: the page covers only the part before."""
    told = report.get("error")
    if told is None:
        return None
    return element(
        "div",
        element("p", element("b", "Error")),
        element("p", f"The run failed after {_seen(report)}: {told}"),
        class_="warning serious",
        role="alert",
    )


def _seen(report: dict[str, Any]) -> str:
    return f"{report.get('seen_frames')} of {report.get('frames')} frames"


def _warnings(report: dict[str, Any]) -> Markup | None:
    """Return the warnings about the result, as the command printed them."""
    told = report.get("warnings")
    if not told:
        return None
    title = "Warning" if len(told) == 1 else f"{len(told)} warnings"
    return element(
        "div",
        element("p", element("b", title)),
        *(element("p", text[:1].upper() + text[1:]) for text in map(str, told)),
        class_="warning serious",
        role="alert",
    )


def _notes(report: dict[str, Any]) -> Markup | None:
    """Return notes for the top of the page."""
    said = []
    warnings = report.get("warnings") or []
    if not report.get("tracked"):
        likely = ", most likely for what the warning says" if warnings else ""
        said.append(f"No frame has a pose{likely}: see Tracking for the reasons, and what helps.")
    elif report.get("lost_at_end") and not warnings:
        said.append("Tracking was lost at the end of the run.")
    if report.get("ate_rmse_m") is not None and is_of_last_map_only(report):
        said.append(f"The errors are {compared_over(report)}: other maps are not in them.")
    if report.get("interrupted"):
        said.append(f"The run was interrupted after {_seen(report)}.")
    metric = (report.get("imu") or {}).get("metric", False)
    own_unit = report.get("sensor") == "mono" and not metric
    if own_unit and report.get("tracked") and not report.get("ate_scale"):
        said.append(
            "Lengths are in the map's own units: a single camera cannot measure metres, and "
            "there is no ground truth."
        )
    if not said:
        return None
    return element("div", *(element("p", text) for text in said), class_="warning", role="note")

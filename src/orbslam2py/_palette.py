# SPDX-License-Identifier: BSD-3-Clause
"""Colours of everything that is drawn, as (red, green, blue).

People with any kind of colour blindness can distinguish them (after Okabe and Ito, "Color universal
design", 2008, brighter for a dark background); the most important ones also differ in shape.
"""

from __future__ import annotations

#: Red, green, blue, 0 to 255 each.
Colour = tuple[int, int, int]

GROUND: Colour = (15, 18, 23)
PANEL: Colour = (24, 28, 35)
FRAME: Colour = (52, 58, 68)
TEXT: Colour = (232, 236, 241)
FAINT_TEXT: Colour = (150, 158, 170)
HALO: Colour = (8, 10, 12)

#: Keypoints that are matched to the map, and the state in which there are such.
MAPPED: Colour = (40, 224, 176)
#: Keypoints of visual odometry, matched to the frame before only.
VISUAL_ODOMETRY: Colour = (255, 170, 30)
#: Keypoints that are matched to nothing.
UNMATCHED: Colour = (150, 150, 158)
#: Between the two views in which a single camera starts, and the state of waiting for a start.
STARTING: Colour = (245, 228, 80)
LOST: Colour = (244, 92, 44)
#: Images that were not looked at.
NOT_TRACKED: Colour = (96, 103, 114)

POINTS: Colour = (214, 196, 160)
COVISIBILITY: Colour = (58, 92, 118)
KEYFRAME: Colour = (110, 186, 240)
PATH: Colour = (240, 243, 247)
#: The path as it was when the images came.
ONLINE_PATH: Colour = (178, 150, 214)
#: Points of the local map, which the present image is matched with.
LOCAL_POINTS: Colour = (255, 122, 72)
SPANNING_TREE: Colour = (86, 180, 233)
CAMERA: Colour = MAPPED
LOOP: Colour = (238, 140, 200)
TRUTH: Colour = (120, 150, 40)
NOW: Colour = (255, 255, 255)

#: Several maps, by their numbers; the first one looks like one that is alone.
MAPS: tuple[Colour, ...] = (
    KEYFRAME,
    (240, 160, 40),
    (64, 200, 140),
    (226, 130, 190),
    (240, 228, 66),
    (178, 150, 255),
)

#: Stages of tracking, in plots.
STAGE_COLOURS: dict[str, Colour] = {
    "extract": (86, 180, 233),
    "stereo": (0, 158, 115),
    "predict": (240, 228, 66),
    "local_map": (230, 159, 0),
    "keyframe": (204, 121, 167),
}

# ---- on white, as on paper ----------------------------------------------------------------------
PAPER_TEXT: Colour = (34, 34, 34)
PAPER_FAINT_TEXT: Colour = (85, 85, 85)
PAPER_LINE: Colour = (154, 154, 154)
PAPER_GRID: Colour = (238, 238, 238)
PAPER_PATH: Colour = (31, 95, 168)
PAPER_TRUTH: Colour = (143, 206, 126)
PAPER_POINTS: Colour = (201, 185, 154)
#: Loops, and what is left unexplained.
PAPER_LOOP: Colour = (200, 68, 44)
#: Times without a pose, and of maps that were given up.
PAPER_UNTRACKED: Colour = (246, 207, 198)
#: Several maps, by their numbers.
PAPER_MAPS: tuple[Colour, ...] = (
    PAPER_PATH,
    (216, 126, 0),
    (0, 132, 100),
    (166, 74, 138),
    (128, 108, 10),
    (104, 82, 190),
)
#: From no error to the largest: a part of matplotlib's plasma, seen well on white.
PAPER_ERRORS: tuple[Colour, ...] = (
    (42, 5, 147),
    (125, 3, 168),
    (195, 61, 128),
    (238, 127, 78),
    (249, 154, 62),
)


def map_colour(number: int) -> Colour:
    """Return the colour of one of several maps, on a dark background; colours repeat after six."""
    return MAPS[number % len(MAPS)]


def paper_map_colour(number: int) -> Colour:
    """Return the colour of one of several maps, on white."""
    return PAPER_MAPS[number % len(PAPER_MAPS)]


def lighter(colour: Colour, by: float) -> Colour:
    """Return a colour mixed with white: 0 is the colour, 1 is white."""
    red, green, blue = (round(255 * by + value * (1 - by)) for value in colour)
    return red, green, blue


def hexadecimal(colour: Colour) -> str:
    """A colour as ``#rrggbb``, for matplotlib and pages."""
    return "#{:02x}{:02x}{:02x}".format(*colour)

# SPDX-License-Identifier: BSD-3-Clause
"""The tables of a map file; ``docs/reference/map_file.md`` describes them to other programs."""

from __future__ import annotations

from typing import NamedTuple

#: Identifies map files among SQLite files: "ORBm" in ASCII.
APPLICATION_ID = 0x4F52426D
#: Version of the format that is written; later ones are refused. Version 1 had no words, and
#: version 2 no rational lens (k4 to k6), version 3 no fisheye lenses, version 4 no rigs, version 5
#: neither states of an IMU nor patches.
FORMAT_VERSION = 6
#: Begins a line of the settings' text, after which come the roots of maps that were given metres.
#: Other programs treat it as a comment, and drop it when they write a file.
IN_METRES = "# Maps in metres, by their roots:"
#: The same for the roots of maps whose third axis is up, by an IMU.
UPRIGHT = "# Upright maps, by their roots:"
#: A row of `map_points` and of `observations` holds the points of this number of ids.
IDS_PER_PAGE = 256
#: A row of `patches` holds those of this number of ids, fewer because each has a kilobyte.
PATCHES_PER_PAGE = 32
#: Numbers of a patch: 24 x 24.
PATCH_SIZE = 576
#: Frames in a row of `frames`.
FRAMES_PER_ROW = 256


class Blob(NamedTuple):
    """A column of items in little-endian order, row by row."""

    column: str
    field: str
    """Name of the array in its group of `MapContents`."""
    dtype: str
    width: int = 0
    """Items per row, for arrays (n, width); 0 for arrays (n,)."""
    optional: bool = False
    """NULL if the array is empty."""
    sparse: bool = False
    """NULL also in single rows, which are zeros in the array."""
    all_or_none: bool = False
    """NULL also in single rows; then the array is empty, because it needs values of all rows."""


KEYPOINTS = (
    Blob("positions", "keypoints", "<f4", 2),
    Blob("raw_positions", "raw_keypoints", "<f4", 2, optional=True),
    Blob("octaves", "octave", "|u1"),
    Blob("angles", "angle", "<f4"),
    Blob("responses", "response", "<f4"),
    Blob("descriptors", "descriptors", "|u1", 32),
    Blob("depths", "depth", "<f4"),
    Blob("right_columns", "right_u", "<f4"),
    Blob("colours", "colours", "|u1", 3, optional=True, sparse=True),
    Blob("words", "words", "<u4", optional=True, all_or_none=True),
)
MAP_POINTS = (
    Blob("ids", "ids", "<i8"),
    Blob("positions", "positions", "<f8", 3),
    Blob("mean_directions", "mean_directions", "<f8", 3),
    Blob("min_distances", "min_distance", "<f8"),
    Blob("max_distances", "max_distance", "<f8"),
    Blob("descriptors", "descriptors", "|u1", 32),
    Blob("times_visible", "n_visible", "<i4"),
    Blob("times_found", "n_found", "<i4"),
    Blob("reference_keyframes", "reference_keyframe", "<i8"),
    Blob("first_keyframes", "first_keyframe", "<i8"),
    Blob("first_frames", "first_frame", "<i8"),
)
OBSERVATIONS = (
    Blob("points", "point", "<i8"),
    Blob("keyframes", "keyframe", "<i8"),
    Blob("keypoints", "keypoint", "<i4"),
)
COVISIBILITY = (
    Blob("others", "b", "<i8"),
    Blob("weights", "weight", "<i4"),
)
FRAMES = (
    Blob("timestamps", "timestamps", "<f8"),
    Blob("ids", "ids", "<i8"),
    Blob("keyframes", "keyframes", "<i8"),
    Blob("poses", "T_cr", "<f8", 7),
    Blob("lost", "lost", "|u1"),
)
#: Patches of points, since version 6.
PATCHES = (
    Blob("points", "point", "<i8"),
    Blob("keyframes", "keyframe", "<i8"),
    Blob("cameras", "camera", "<i8"),
    Blob("levels", "level", "|u1"),
    Blob("raw_positions", "pixel", "<f4", 2),
    Blob("fractions", "fraction", "<f4", 2),
    Blob("grey_values", "values", "<u2", PATCH_SIZE),
)
#: Aligned sightings, since version 6.
ALIGNED = (
    Blob("keypoints", "keypoint", "<i4"),
    Blob("points", "point", "<i8"),
    Blob("positions", "position", "<f4", 2),
    Blob("right_columns", "right_u", "<f4"),
    Blob("variances", "variance", "<f4"),
    Blob("right_variances", "right_variance", "<f4"),
    Blob("is_reference", "reference", "|u1"),
)
#: Of an IMU, since version 6; rows ``[t, gyro, accelerometer]``.
IMU_SAMPLES = (Blob("samples", "samples", "<f8", 7),)


class Table(NamedTuple):
    """A table: the columns of its key, its numbers and texts, its blobs."""

    name: str
    keys: tuple[str, ...]
    values: tuple[str, ...] = ()
    blobs: tuple[Blob, ...] = ()

    @property
    def columns(self) -> tuple[str, ...]:
        """Return the names of all columns, in their order; the count comes before blobs."""
        count = ("count",) if self.blobs else ()
        return (
            *self.keys,
            *self.values,
            *count,
            *(blob.column for blob in self.blobs),
            "checksum",
        )


#: Further coefficients of a camera since version 3.
RATIONAL_LENS = ("k4", "k5", "k6")
#: Of a fisheye lens since version 4: name of the camera model, its parameters as float64 (16,),
#: zeros after the last one; the last three are the centre of the right camera of a fisheye pair
#: [m]. A pinhole has an empty name.
FISHEYE_LENS = ("model", "lens")
#: Of a camera of a rig since version 5: how it is mounted, float64 (12,); see `Cameras.mount`.
RIG_MOUNT = ("mount",)
#: A pose as 7 float64: unit quaternion x, y, z, w, then the translation. A blob, because SQLite
#: does not keep the sign of a zero in a REAL column.
POSE = "pose"
TABLES = {
    table.name: table
    for table in (
        Table("map", ("id",), ("next_keyframe", "next_point")),
        Table("settings", ("id",), ("sensor", "yaml")),
        Table("vocabulary", ("id",), ("name", "hash", "comment")),
        Table("runs", ("id",), ("program", "started", "seed", "options")),
        Table(
            "cameras",
            ("id",),
            (
                *("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", *RATIONAL_LENS),
                *("bf", "depth_ratio", "width", "height", "scale_factor", "n_levels"),
                *FISHEYE_LENS,
                *RIG_MOUNT,
            ),
        ),
        Table(
            "keyframes",
            ("id",),
            (
                *("frame", "timestamp", "camera", POSE, "scale", "parent"),
                *("provisional_parent", "processed"),
            ),
        ),
        Table("keypoints", ("keyframe",), (), KEYPOINTS),
        Table("images", ("keyframe",), ("jpeg",)),
        Table("removed_keyframes", ("id",), ("parent", POSE, "scale", "parent_scale")),
        Table("map_points", ("page",), (), MAP_POINTS),
        Table("observations", ("page",), (), OBSERVATIONS),
        Table("covisibility", ("keyframe",), (), COVISIBILITY),
        Table("loop_edges", ("a", "b")),
        # Blobs of float64 (3,) and (6,), for the reason that a pose is one.
        Table("imu_states", ("keyframe",), ("velocity", "scale", "bias"), IMU_SAMPLES),
        Table("patches", ("page",), (), PATCHES),
        Table("aligned", ("keyframe",), (), ALIGNED),
        Table("alignment_noise", ("id",), ("factor", "measured")),
        Table("frames", ("run", "part"), (), FRAMES),
    )
}

#: The first version with a table that version 1 did not have.
_SINCE = {"imu_states": 6, "patches": 6, "aligned": 6, "alignment_noise": 6}


def tables_of(version: int) -> dict[str, Table]:
    """The tables of a version of the format."""
    older: dict[str, Table] = {}
    if version < 5:
        later: tuple[str, ...] = RIG_MOUNT
        later += FISHEYE_LENS if version < 4 else ()
        later += RATIONAL_LENS if version < 3 else ()
        cameras = TABLES["cameras"]
        values = tuple(value for value in cameras.values if value not in later)
        older["cameras"] = cameras._replace(values=values)
    if version < 2:
        older["keypoints"] = Table("keypoints", ("keyframe",), (), KEYPOINTS[:-1])
    tables = {**TABLES, **older}
    return {name: table for name, table in tables.items() if version >= _SINCE.get(name, 1)}


def _blob_columns(blobs: tuple[Blob, ...]) -> str:
    columns = ["count INTEGER NOT NULL CHECK (count >= 0),"]
    columns += [f"{blob.column} BLOB{'' if blob.optional else ' NOT NULL'}," for blob in blobs]
    return "\n  ".join(columns)


def create_script(version: int = FORMAT_VERSION) -> str:
    """Return the SQL that makes the tables of a version of the format.

    Rows have checksums; `totals` has the number of rows and the sum of checksums.
    """
    tables = tables_of(version)
    keypoints = _blob_columns(tables["keypoints"].blobs)
    lens = [name for name in tables["cameras"].values if name in RATIONAL_LENS]
    rational_lens = "".join(f"  {name} REAL NOT NULL,\n" for name in lens)
    fisheye = "  model TEXT NOT NULL,\n  lens BLOB NOT NULL,\n" if version >= 4 else ""
    fisheye += "  mount BLOB NOT NULL,\n" if version >= 5 else ""
    script = _CREATE.format(
        version=version, keypoints=keypoints, rational_lens=rational_lens, fisheye_lens=fisheye
    )
    return script + "".join(_CREATE_LATER[name] for name in tables if name in _CREATE_LATER)


#: Bytes at the beginning of a file that say whose SQLite file it is.
HEADER_SIZE = 100


def application_of(header: bytes) -> int | None:
    """Return the application id of an SQLite file; None if it is no SQLite file."""
    if len(header) < HEADER_SIZE or not header.startswith(b"SQLite format 3\x00"):
        return None
    return int.from_bytes(header[68:72], "big")


_CREATE_LATER = {
    "imu_states": f"""
CREATE TABLE imu_states (
  keyframe INTEGER PRIMARY KEY
    REFERENCES keyframes ON DELETE CASCADE DEFERRABLE INITIALLY DEFERRED,
  velocity BLOB NOT NULL,
  scale REAL NOT NULL,
  bias BLOB NOT NULL,
  {_blob_columns(IMU_SAMPLES)}
  checksum INTEGER NOT NULL
) STRICT;
""",
    "patches": f"""
CREATE TABLE patches (
  page INTEGER PRIMARY KEY,
  {_blob_columns(PATCHES)}
  checksum INTEGER NOT NULL
) STRICT;
""",
    "aligned": f"""
CREATE TABLE aligned (
  keyframe INTEGER PRIMARY KEY
    REFERENCES keyframes ON DELETE CASCADE DEFERRABLE INITIALLY DEFERRED,
  {_blob_columns(ALIGNED)}
  checksum INTEGER NOT NULL
) STRICT;
""",
    "alignment_noise": """
CREATE TABLE alignment_noise (
  id INTEGER PRIMARY KEY,
  factor REAL NOT NULL,
  measured INTEGER NOT NULL,
  checksum INTEGER NOT NULL
) STRICT;
""",
}
_CREATE = f"""
PRAGMA application_id = {APPLICATION_ID};
PRAGMA user_version = {{version}};

CREATE TABLE map (
  id INTEGER PRIMARY KEY CHECK (id = 1),
  next_keyframe INTEGER NOT NULL,
  next_point INTEGER NOT NULL,
  checksum INTEGER NOT NULL
) STRICT;

CREATE TABLE settings (
  id INTEGER PRIMARY KEY CHECK (id = 1),
  sensor TEXT NOT NULL,
  yaml TEXT NOT NULL,
  checksum INTEGER NOT NULL
) STRICT;

CREATE TABLE vocabulary (
  id INTEGER PRIMARY KEY CHECK (id = 1),
  name TEXT NOT NULL,
  hash TEXT NOT NULL,
  comment TEXT NOT NULL,
  checksum INTEGER NOT NULL
) STRICT;

CREATE TABLE runs (
  id INTEGER PRIMARY KEY,
  program TEXT NOT NULL,
  started TEXT NOT NULL,
  seed INTEGER NOT NULL,
  options TEXT NOT NULL,
  checksum INTEGER NOT NULL
) STRICT;

CREATE TABLE cameras (
  id INTEGER PRIMARY KEY,
  fx REAL NOT NULL,
  fy REAL NOT NULL,
  cx REAL NOT NULL,
  cy REAL NOT NULL,
  k1 REAL NOT NULL,
  k2 REAL NOT NULL,
  p1 REAL NOT NULL,
  p2 REAL NOT NULL,
  k3 REAL NOT NULL,
{{rational_lens}}  bf REAL NOT NULL,
  depth_ratio REAL NOT NULL,
  width INTEGER NOT NULL,
  height INTEGER NOT NULL,
  scale_factor REAL NOT NULL,
  n_levels INTEGER NOT NULL,
{{fisheye_lens}}  checksum INTEGER NOT NULL
) STRICT;

CREATE TABLE keyframes (
  id INTEGER PRIMARY KEY,
  frame INTEGER NOT NULL,
  timestamp REAL NOT NULL,
  camera INTEGER NOT NULL REFERENCES cameras DEFERRABLE INITIALLY DEFERRED,
  pose BLOB NOT NULL,
  scale REAL NOT NULL,
  parent INTEGER REFERENCES keyframes DEFERRABLE INITIALLY DEFERRED,
  provisional_parent INTEGER NOT NULL,
  processed INTEGER NOT NULL,
  checksum INTEGER NOT NULL
) STRICT;

CREATE VIEW spanning_tree AS
  SELECT id AS child, parent FROM keyframes WHERE parent IS NOT NULL;

CREATE TABLE keypoints (
  keyframe INTEGER PRIMARY KEY
    REFERENCES keyframes ON DELETE CASCADE DEFERRABLE INITIALLY DEFERRED,
  {{keypoints}}
  checksum INTEGER NOT NULL
) STRICT;

CREATE TABLE images (
  keyframe INTEGER PRIMARY KEY
    REFERENCES keyframes ON DELETE CASCADE DEFERRABLE INITIALLY DEFERRED,
  jpeg BLOB NOT NULL,
  checksum INTEGER NOT NULL
) STRICT;

CREATE TABLE removed_keyframes (
  id INTEGER PRIMARY KEY,
  parent INTEGER NOT NULL,
  pose BLOB NOT NULL,
  scale REAL NOT NULL,
  parent_scale REAL NOT NULL,
  checksum INTEGER NOT NULL
) STRICT;

CREATE TABLE map_points (
  page INTEGER PRIMARY KEY,
  {_blob_columns(MAP_POINTS)}
  checksum INTEGER NOT NULL
) STRICT;

CREATE TABLE observations (
  page INTEGER PRIMARY KEY
    REFERENCES map_points ON DELETE CASCADE DEFERRABLE INITIALLY DEFERRED,
  {_blob_columns(OBSERVATIONS)}
  checksum INTEGER NOT NULL
) STRICT;

CREATE TABLE covisibility (
  keyframe INTEGER PRIMARY KEY
    REFERENCES keyframes ON DELETE CASCADE DEFERRABLE INITIALLY DEFERRED,
  {_blob_columns(COVISIBILITY)}
  checksum INTEGER NOT NULL
) STRICT;

CREATE TABLE loop_edges (
  a INTEGER NOT NULL REFERENCES keyframes DEFERRABLE INITIALLY DEFERRED,
  b INTEGER NOT NULL REFERENCES keyframes DEFERRABLE INITIALLY DEFERRED,
  checksum INTEGER NOT NULL,
  PRIMARY KEY (a, b)
) STRICT, WITHOUT ROWID;

CREATE TABLE frames (
  run INTEGER NOT NULL REFERENCES runs DEFERRABLE INITIALLY DEFERRED,
  part INTEGER NOT NULL,
  {_blob_columns(FRAMES)}
  checksum INTEGER NOT NULL,
  PRIMARY KEY (run, part)
) STRICT, WITHOUT ROWID;

CREATE TABLE totals (
  name TEXT PRIMARY KEY,
  rows INTEGER NOT NULL,
  checksum INTEGER NOT NULL
) STRICT, WITHOUT ROWID;
"""

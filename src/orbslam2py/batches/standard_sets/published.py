# SPDX-License-Identifier: BSD-3-Clause
"""Published figures, from ``data/published/figures.yaml``, each with its source."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import yaml

from orbslam2py.batches.standard_sets.find import StandardSet

_FILE = Path(__file__).parents[2] / "data" / "published" / "figures.yaml"
#: Names under which folders hold whole sequences; the group is the name in the papers' tables.
_NAMES = {
    StandardSet.TUM: re.compile(r"(?:rgbd_dataset_)?(freiburg\d_\w+)"),
    StandardSet.KITTI: re.compile(r"(\d\d)"),
    StandardSet.EUROC: re.compile(r"((?:MH|V1|V2)_\d\d)(?:_(?:easy|medium|difficult))?"),
    StandardSet.TUM_VI: re.compile(r"(?:dataset-)?([a-z]+\d)(?:_(?:512|1024)_16)?"),
}


@dataclass(frozen=True)
class Published:
    """A published figure of a system on a sequence.

    Attributes
    ----------
    system
        ORB-SLAM2 or ORB-SLAM3.
    source
        The paper and the table.
    ate_rmse_m, t_rel_percent, r_rel_deg_per_100m
        As in reports; None if the table has none.
    is_lost
        Whether the paper marks the sequence as lost.
    """

    system: str
    source: str
    ate_rmse_m: float | None = None
    t_rel_percent: float | None = None
    r_rel_deg_per_100m: float | None = None
    is_lost: bool = False


def published_figures(
    kind: StandardSet | str, sequence: str, sensor: str, *, imu: bool = False
) -> list[Published]:
    """Return the published results of a sequence; nothing where no figure is given.

    Parameters
    ----------
    kind
        The data set.
    sequence
        Name of the sequence's folder.
    sensor
        ``mono``, ``stereo`` or ``rgbd``.
    imu
        Whether an IMU was used beside it.

    Returns
    -------
    list of Published
        One a system.
    """
    kind = StandardSet.of(kind)
    named = _NAMES[kind].fullmatch(Path(sequence).name)
    if named is None:
        return []
    found = []
    for table in _tables()["tables"]:
        if (table["set"], table["sensor"], table.get("imu", False)) != (kind.value, sensor, imu):
            continue
        figures = table["figures"].get(named[1])
        source = f"{_tables()['papers'][table['system']]}, {table['table']}"
        if figures == "lost":
            found.append(Published(table["system"], source, is_lost=True))
        elif figures is not None:
            found.append(Published(table["system"], source, **figures))
    return found


@cache
def _tables() -> dict[str, Any]:
    tables: dict[str, Any] = yaml.safe_load(_FILE.read_text(encoding="utf-8"))
    return tables

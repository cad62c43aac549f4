# SPDX-License-Identifier: BSD-3-Clause
"""Whether a saved map can be used with a camera and visual words."""

from __future__ import annotations

from collections.abc import Iterator

from orbslam2py.errors import MapFileError, SettingsError
from orbslam2py.maps.saved_map import SavedMap, VocabularyIdentity
from orbslam2py.settings.keys import KEYS
from orbslam2py.settings.sensor import Sensor
from orbslam2py.settings.settings import Settings

#: Values of the settings that may change from run to run: the rate of the images, the order of
#: their colours, how many features are taken and from which contrast on.
_FREE = {"Camera.fps", "Camera.RGB", "ORBextractor.nFeatures"} | {
    "ORBextractor.iniThFAST",
    "ORBextractor.minThFAST",
    "ThDepth",
    "DepthMapFactor",
}


def check_sensor(saved: SavedMap, sensor: Sensor) -> None:
    """Raise `SettingsError` unless the map was made with this kind of sensor."""
    if saved.sensor is not sensor:
        raise SettingsError(
            f"the map {saved.source} was made for sensor '{saved.sensor}', not for '{sensor}'; "
            f"open the images for '{saved.sensor}'"
        )


def check_camera(saved: SavedMap, settings: Settings) -> None:
    """Raise `SettingsError`, saying what differs, unless the map was made with this camera."""
    differences = list(_differences(saved.settings, settings))
    if differences:
        raise SettingsError(
            f"the map {saved.source} was made with another camera: {'; '.join(differences)}; "
            "leave the settings out to take those of the map, or allow another setup "
            "(--allow-other-setup, allow_other_setup=True)"
        )


def check_vocabulary(saved: SavedMap, present: VocabularyIdentity) -> None:
    """Raise `MapFileError` unless the map was made with these visual words."""
    made_with = saved.vocabulary
    if made_with.hash != present.hash:
        raise MapFileError(
            f"the map {saved.source} was made with the vocabulary {made_with.name or 'in memory'} "
            f"({made_with.hash}), not with {present.name or 'the one given'} ({present.hash}); "
            "give that vocabulary, or allow another setup "
            "(--allow-other-setup, allow_other_setup=True)"
        )


def _differences(saved: Settings, present: Settings) -> Iterator[str]:
    for key in KEYS:
        if key.group not in ("camera", "orb") or key.name in _FREE:
            continue
        before = getattr(getattr(saved, key.group), key.field)
        now = getattr(getattr(present, key.group), key.field)
        if before != now and present.sensor in key.sensors:
            # As it is written in the file: 0 or 1, not False or True.
            now, before = (int(v) if key.kind is bool else v for v in (now, before))
            yield f"{key.name} is {now}, in the map {before}"

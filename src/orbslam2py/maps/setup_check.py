# SPDX-License-Identifier: BSD-3-Clause
"""Whether a saved map fits a camera and a vocabulary."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from orbslam2py import _core as core
from orbslam2py.errors import MapFileError, SettingsError
from orbslam2py.maps.map_file import MapFile
from orbslam2py.maps.saved_map import SavedMap, VocabularyIdentity, saved_of
from orbslam2py.settings.keys import KEYS
from orbslam2py.settings.sensor import Sensor
from orbslam2py.settings.settings import Settings

#: What else a map that is loaded may be given.
_ALLOW = ", or allow another setup (--allow-other-setup, allow_other_setup=True)"
#: Values of the settings that may change from run to run: the rate of the images, the order of
#: their colours, how many features are taken and from which contrast on.
_FREE = {"Camera.fps", "Camera.RGB", "ORBextractor.nFeatures"} | {
    "ORBextractor.iniThFAST",
    "ORBextractor.minThFAST",
    "ThDepth",
    "DepthMapFactor",
}


def check_sensor(saved: SavedMap | MapFile, sensor: Sensor) -> None:
    """Raise `SettingsError` unless the map was made with this kind of sensor."""
    if saved.sensor is not sensor:
        raise SettingsError(
            f"the map {saved.source} was made for sensor '{saved.sensor}', not for '{sensor}'; "
            f"open the images for '{saved.sensor}'"
        )


def check_made_alike(files: Sequence[SavedMap | MapFile]) -> None:
    """Raise `SettingsError`, naming both, unless maps were made with one sensor and one camera.

    Any other object, such as a path, raises `MapFileError`.
    """
    for saved in files:
        if not isinstance(saved, MapFile):
            saved_of(saved, "one of the maps")
    for saved in files[1:]:
        first = files[0]
        name, other = first.source or "in memory", saved.source or "in memory"
        if saved.sensor is not first.sensor:
            raise SettingsError(
                f"the map {name} was made for sensor '{first.sensor}', but {other} "
                f"for '{saved.sensor}', and only maps of the same kind of sensor can become one; "
                f"give maps of one sensor, or make {other} anew of images for "
                f"'{first.sensor}' (run --sensor {first.sensor} --save)"
            )
        differences = list(_differences(first.settings, saved.settings, "in the first"))
        if differences:
            raise SettingsError(
                f"the maps {name} and {other} were made with different cameras: "
                f"{'; '.join(differences)}; give maps of one camera, or make {other} anew "
                "with the settings of the first"
            )


def check_camera(saved: SavedMap | MapFile, settings: Settings) -> None:
    """Raise `SettingsError` with the differences, unless the map was made with this camera."""
    differences = list(_differences(saved.settings, settings))
    if differences:
        raise SettingsError(
            f"the map {saved.source} was made with another camera: {'; '.join(differences)}; "
            f"leave the settings out to take those of the map{_ALLOW}"
        )


def check_vocabulary(
    saved: SavedMap | MapFile, vocabulary: core.Vocabulary, name: str, *, may_differ: bool = True
) -> None:
    """Raise `MapFileError` unless the map was made with these visual words.

    With `may_differ` the message says how to allow a difference.
    """
    made_with = saved.vocabulary
    if not made_with.is_of(vocabulary):
        present = VocabularyIdentity.of(vocabulary, name)
        raise MapFileError(
            f"the map {saved.source} was made with the vocabulary {made_with.name or 'in memory'} "
            f"({made_with.hash}), not with {present.name or 'the one given'} ({present.hash}); "
            f"give that vocabulary{_ALLOW if may_differ else ''}"
        )


def _differences(saved: Settings, present: Settings, where: str = "in the map") -> Iterator[str]:
    for key in KEYS:
        if key.group not in ("camera", "orb") or key.name in _FREE:
            continue
        before = getattr(getattr(saved, key.group), key.field)
        now = getattr(getattr(present, key.group), key.field)
        if before != now and (present.sensor in key.sensors or present.rig is not None):
            # In the notation of the file: 0 or 1, not False or True.
            now, before = (int(v) if key.kind is bool else v for v in (now, before))
            yield f"{key.name} is {now}, {where} {before}"
    if present.rig != saved.rig:
        yield f"cameras or extrinsics of the rig are other ones than {where}"

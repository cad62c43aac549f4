# SPDX-License-Identifier: BSD-3-Clause
"""The configuration: names with a dot reach every threshold, and what was changed is kept."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import pytest

import orbslam2py as orb
from orbslam2py.cli.config import descriptions
from orbslam2py.errors import SettingsError
from orbslam2py.slam.config import PRESETS, Config, all_values, read_change, value_of
from orbslam2py.slam.options import SystemOptions


def test_every_value_is_reached_by_its_name() -> None:
    for name, value in all_values(Config()):
        other: Any = not value if isinstance(value, bool) else value + 1
        changed = Config().with_changes({name: other})
        assert value_of(changed, name) == other
        assert changed.changes() == {name: other}


def test_there_are_no_more_values_than_a_person_can_look_through() -> None:
    """Sizes of buffers, patience and limits inside a step are constants beside the code."""
    assert len(list(all_values(Config()))) <= 100


def test_every_value_says_what_it_means() -> None:
    meanings = descriptions()
    assert {name for name, _ in all_values(Config())} == set(meanings)
    assert all(meanings.values())


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("tracking.map_match", "did you mean tracking.map_matches?"),
        ("map_matches", "did you mean tracking.map_matches?"),
        ("initialization.watched_frames", "did you mean "),
        ("", "orbslam2py config"),
        ("nothing.like.it", "orbslam2py config"),
    ],
)
def test_unknown_names_are_refused_with_the_nearest(name: str, hint: str) -> None:
    with pytest.raises(SettingsError, match="has no value") as caught:
        Config().with_changes({name: 1})
    assert hint in str(caught.value)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("tracking.map_matches", 1.5),
        ("tracking.map_matches", True),
        ("tracking.map_matches", "many"),
        ("tracking.map_matches", -1),
        ("tracking.map_matches", 10**400),
        ("tracking.motion_model_window", float("nan")),
        ("acceptance.search_again", 1),
        ("acceptance.search_again", None),
    ],
)
def test_values_of_another_kind_are_refused(name: str, value: object) -> None:
    with pytest.raises(SettingsError, match=name):
        Config().with_changes({name: value})


def test_changes_are_read_as_they_are_typed() -> None:
    assert read_change("tracking.map_matches=12") == ("tracking.map_matches", 12)
    assert read_change("tracking.motion_model_window = 9.5")[1] == 9.5
    assert read_change("acceptance.search_again=false")[1] is False
    for text in ("tracking.map_matches", "=3", "tracking.map_matches="):
        with pytest.raises(SettingsError, match="NAME=VALUE"):
            read_change(text)


def test_presets_are_changes_of_the_configuration() -> None:
    assert set(PRESETS) == {str(effort) for effort in orb.Effort}
    fast = SystemOptions(effort=orb.Effort.FAST).full_config
    assert fast.changes() == PRESETS["fast"]
    own = SystemOptions(effort=orb.Effort.FAST, config={"keyframes.spacing_with_depth": 2})
    assert own.full_config.keyframes.spacing_with_depth == 2, "one's own change wins"
    assert own.config == {"keyframes.spacing_with_depth": 2}


def test_a_whole_configuration_is_taken_by_what_differs() -> None:
    config = Config().with_changes({"loops.gap": 3})
    assert SystemOptions(config=config).config == {"loops.gap": 3}
    with pytest.raises(SettingsError, match="give a dictionary"):
        SystemOptions(config=["loops.gap=3"])  # type: ignore[arg-type]


def test_the_system_works_with_the_changed_value() -> None:
    with orb.System("tum1", "rgbd", config={"tracking.small_map": 7}) as slam:
        assert slam.pipeline.tracking._search.limits.small_map == 7
        assert slam.options.config == {"tracking.small_map": 7}


def test_sections_are_what_the_command_lists() -> None:
    sections = {name.partition(".")[0] for name, _ in all_values(Config())}
    assert sections == {field.name for field in fields(Config)}

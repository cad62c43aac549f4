# SPDX-License-Identifier: BSD-3-Clause
"""Job files: what they ask for, and what is wrong with them."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

import orbslam2py as orb
from orbslam2py.batches import make_jobs, read_jobs
from orbslam2py.batches.sweep import read_sweep, with_parameters
from orbslam2py.errors import SettingsError
from orbslam2py.settings import Sensor, Settings, builtin_settings


@pytest.fixture
def places(tmp_path: Path) -> Path:
    for name in ("a/01", "a/02", "b/02"):
        (tmp_path / name).mkdir(parents=True)
    return tmp_path


def test_product(places: Path) -> None:
    document = {
        "sequences": ["a/*"],
        "sensors": ["mono", "stereo"],
        "options": {"deterministic": [True, False], "max_frames": 30, "effort": "fast"},
        "seeds": [3, 5],
    }
    jobs = make_jobs(document, places)
    assert len(jobs) == 2 * 2 * 2 * 2
    assert jobs[0].key == "01-mono-deterministic=true-effort=fast-max_frames=30-seed3"
    assert jobs[0].setting == jobs[1].setting
    assert len({job.key for job in jobs}) == len({job.fingerprint for job in jobs}) == 16
    options = jobs[0].run_options(orb.Sensor.MONOCULAR)
    assert (options.system.deterministic, options.system.seed, options.max_frames) == (True, 3, 30)
    assert options.system.effort is orb.Effort.FAST


def test_file(places: Path) -> None:
    path = places / "jobs.yaml"
    path.write_text(
        "sequences: [a/01, {path: b/02, name: other, sensor: mono}]\nseeds: 2\noutput: out\n"
    )
    jobs, output = read_jobs(path)
    assert [job.key for job in jobs] == [
        *("01-seed0", "01-seed1"),
        *("other-mono-seed0", "other-mono-seed1"),
    ]
    assert jobs[0].path == str(places / "a/01")
    assert output == places / "out"


@pytest.mark.parametrize(
    ("document", "message"),
    [
        ({}, "there are no sequences"),
        ({"sequence": ["a/01"]}, "unknown key 'sequence'; did you mean sequences?"),
        ({"sequences": ["c/*"]}, r"nothing matches .*c/\*; correct the pattern"),
        ({"sequences": ["c/01"]}, "c/01 does not exist"),
        ({"sequences": ["*/02"]}, "two runs would have the folder 02-seed0: .*names of their own"),
        ({"sequences": ["a/01", "a/01"]}, "a/01 twice"),
        ({"sequences": [{"name": "x"}]}, "a sequence has no path"),
        ({"sequences": [{"path": "a/*", "name": "x"}]}, "2 sequences match .* all to be called x"),
        ({"sequences": [{"path": "a/01", "cam": 1}]}, "unknown key of a sequence 'cam'"),
        ({"sequences": ["a/01"], "sensors": ["lidar"]}, "lidar"),
        ({"sequences": ["a/01"], "seeds": 0}, "seeds is 0; give how many"),
        ({"sequences": ["a/01"], "seeds": [1, 1]}, "list of different seeds"),
        ({"sequences": ["a/01"], "seeds": ["x"]}, "a seed is 'x'"),
        ({"sequences": ["a/01"], "options": {"strid": 2}}, "unknown option 'strid'.* stride?"),
        ({"sequences": ["a/01"], "options": [1]}, "options are a list"),
        ({"sequences": ["a/01"], "options": {"max_frames": 0}}, "max_frames .* is 0; give"),
        ({"sequences": ["a/01"], "options": {"final_adjustment": "no"}}, "final_adj.* is 'no'"),
        (
            {"sequences": ["a/01"], "options": {"deterministic": True, "realtime": True}},
            "--deterministic and --realtime exclude each other",
        ),
        ({"sequences": ["a/01"], "settings": [3]}, "settings is 3; give a path"),
        (
            {"sequences": ["a/01"], "settings": [builtin_settings("tum1", orb.Sensor.RGBD)]},
            r"settings are a Settings object.*; save it .* and give the path",
        ),
        ({"sequences": ["a/01"], "options": {"deterministic": "no"}}, "deterministic is 'no'"),
        (
            {"sequences": ["a/01"], "options": {"effort": "slow"}},
            "effort is 'slow'.* fast, light, normal",
        ),
        ({"sequences": ["a/01"], "sweep": {"ThDepth": ["x"]}}, "^sweep: a value of ThDepth is 'x'"),
    ],
)
def test_wrong_jobs(places: Path, document: dict[str, Any], message: str) -> None:
    with pytest.raises((orb.SettingsError, orb.DatasetError), match=message):
        make_jobs(document, places)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({}, "sweep is empty; give 'KEY: [VALUE, ...]'"),
        (None, "sweep is empty; give"),
        ([1], "sweep is a list; give 'KEY: [VALUE, ...]'"),
        ({"random": 2, "seed": 1}, "sweep is without a key; give 'KEY: [VALUE, ...]'"),
        ({"random": "x", "ThDepth": [30]}, "random is 'x'; give how many draws"),
        ({"nFeatures": [1]}, "'nFeatures' is no key of the settings; did you mean ORBextractor.nF"),
        ({"fx": [1]}, "'fx' is no key of the settings; did you mean Camera.fx?"),
        ({"Blah": [1]}, "'Blah' is no key of the settings; see 'orbslam2py settings show tum1'"),
        ({"ThDepth": []}, "ThDepth has no values; give a list of numbers"),
        ({"ThDepth": "x"}, "a value of ThDepth is 'x'; give numbers"),
        ({"ThDepth": [30, "x"]}, "a value of ThDepth is 'x'; give numbers"),
        ({"ThDepth": [30, -5]}, "ThDepth is -5; allowed: greater than 0"),
        ({"ThDepth": [float("nan")]}, "ThDepth is not finite; allowed: greater than 0"),
        ({"ThDepth": [30, 40, 30.0]}, "ThDepth has the value 30.0 twice; leave one out"),
        (
            {"ORBextractor.nFeatures": [500.5]},
            "ORBextractor.nFeatures is 500.5, but must be a whole number: 1 to 1e+06",
        ),
        ({"ThDepth": {"from": 1, "to": 9}}, "ThDepth has a range; add 'random: N' for N draws"),
        (
            {"random": 3, "ThDepth": {"from": 9, "to": 1}},
            "ThDepth goes from 9.0 to 1.0; 'from' must be less than 'to'",
        ),
        (
            {"random": 3, "ThDepth": {"from": 1}},
            "ThDepth has no 'to'; give numbers 'from' and 'to'",
        ),
        ({"random": 3, "ThDepth": {"from": 1, "to": "x"}}, "ThDepth goes to 'x'; give numbers"),
        (
            {"random": 3, "ThDepth": {"from": -1, "to": 9}},
            "ThDepth goes from -1; allowed: greater than 0",
        ),
        ({"random": 3, "ThDepth": {"from": 1, "to": float("inf")}}, "ThDepth goes to inf; allowed"),
        (
            {"random": 3, "ThDepth": {"from": 1, "too": 9}},
            "ThDepth has an unknown key 'too'; there are from, to, log",
        ),
        (
            {"random": 3, "ThDepth": {"from": 1, "to": 9, "log": "maybe"}},
            "log of ThDepth is 'maybe'; give True or False",
        ),
        (
            {"random": 5, "ThDepth": [30, 40]},
            "of 5 random draws only 2 could be different; draw fewer, or give more values",
        ),
        ({"ThDepth": [10**400]}, "ThDepth is 1000000"),
        ({"random": 2, "ThDepth": {"from": 1, "to": 10**400}}, "ThDepth goes to 1000000"),
    ],
)
def test_wrong_sweeps(values: Any, message: str) -> None:
    """The key, the value and the remedy are named, before a run is made with it."""
    with pytest.raises(orb.SettingsError, match=re.escape(message)):
        read_sweep(values)


@pytest.mark.parametrize(
    ("text", "message"),
    [("a: [", "is no YAML"), ("3\n", "holds no named values"), ("seqs: 1\n", "jobs.yaml: unknown")],
)
def test_wrong_files(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "jobs.yaml"
    with pytest.raises(orb.SettingsError, match="cannot open job file"):
        read_jobs(path)
    path.write_text(text)
    with pytest.raises(orb.SettingsError, match=message):
        read_jobs(path)


def test_grid() -> None:
    sweep = read_sweep({"ORBextractor.nFeatures": [500, 1000], "ThDepth": [30, 40]})
    points = list(sweep.points())
    assert len(points) == 4
    assert points[0] == (("ORBextractor.nFeatures", 500), ("ThDepth", 30))


def test_draws_of_few_values_differ() -> None:
    whole = {"from": 500, "to": 599}
    points = list(read_sweep({"random": 95, "ORBextractor.nFeatures": whole}).points())
    assert len(set(points)) == len(points) == 95
    every = read_sweep({"random": 4, "ThDepth": [30, 40], "ORBextractor.nLevels": [6, 8]})
    assert len(set(every.points())) == 4


def test_random_draws() -> None:
    """The same in every run; whole numbers where the key has such; within the range."""
    values = {
        "random": 50,
        "seed": 4,
        "ORBextractor.nFeatures": {"from": 200, "to": 4000, "log": True},
        "ThDepth": [30, 40],
    }
    points = list(read_sweep(values).points())
    assert points == list(read_sweep(values).points())
    features = [dict(point)["ORBextractor.nFeatures"] for point in points]
    assert all(isinstance(value, int) and 200 <= value <= 4000 for value in features)
    assert sum(value < 900 for value in features) > 12  # even in the logarithm
    assert {dict(point)["ThDepth"] for point in points} == {30, 40}


def test_parameters_go_into_the_settings() -> None:
    settings: Settings = builtin_settings("tum1", orb.Sensor.RGBD)
    changed = with_parameters(settings, (("ORBextractor.nFeatures", 700), ("ThDepth", 25.0)))
    assert changed.orb.n_features == 700
    assert changed.depth is not None
    assert changed.depth.close_factor == 25
    assert changed.camera == settings.camera
    mono = builtin_settings("tum1", orb.Sensor.MONOCULAR)
    with pytest.raises(orb.SettingsError, match="ThDepth is not used by mono"):
        with_parameters(mono, (("ThDepth", 25.0),))


@pytest.mark.parametrize(
    ("given", "thresholds"),
    [
        ((("ORBextractor.iniThFAST", 5), ("ORBextractor.minThFAST", 3)), (5, 3)),
        ((("ORBextractor.minThFAST", 30), ("ORBextractor.iniThFAST", 40.0)), (40, 30)),
    ],
)
def test_keys_that_are_only_allowed_together(
    given: tuple[tuple[str, float], ...], thresholds: tuple[int, int]
) -> None:
    """Each of them alone is on the wrong side of what the other has been."""
    settings = builtin_settings("tum1", orb.Sensor.RGBD)
    changed = with_parameters(settings, (*given, ("ThDepth", 25.0), ("Camera.fx", 500.0)))
    assert (changed.orb.ini_th_fast, changed.orb.min_th_fast) == thresholds
    assert changed.depth is not None
    assert (changed.depth.close_factor, changed.camera.fx) == (25, 500)
    assert changed.orb.n_features == settings.orb.n_features
    with pytest.raises(orb.SettingsError, match="iniThFAST"):
        with_parameters(settings, (("ORBextractor.iniThFAST", 5), ("ORBextractor.minThFAST", 6)))


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"seeds": 1_000_000_000}, "1000000000 runs or more; make batches of at most 100000"),
        ({"seeds": 60_000, "options": {"stride": [1, 2]}}, "120000 runs or more"),
        ({"options": {"max_frames": []}}, "option max_frames has no value"),
        ({"settings": ["nothing"]}, "settings 'nothing' are no file"),
        ({"options": {"max_frames": 0}}, "max-frames"),
        ({"options": {"check_calibration": 3}}, "check_calibration is 3"),
    ],
)
def test_what_would_fail_in_every_run_is_told_first(
    tmp_path: Path, more: dict[str, Any], said: str
) -> None:
    (tmp_path / "lab").mkdir()
    with pytest.raises((orb.SettingsError, orb.DatasetError), match=said):
        orb.batch({"sequences": [str(tmp_path / "lab")], **more}, tmp_path / "out", workers=0)
    assert not (tmp_path / "out").exists()


def test_values_of_the_configuration_are_options_and_are_swept(places: Path) -> None:
    jobs = make_jobs(
        {
            "sequences": [str(places / "a")],
            "sensors": ["mono"],
            "options": {"tracking.map_matches": [8, 12], "effort": "fast"},
            "sweep": {"keyframes.share": [0.5, 0.7], "ORBextractor.nFeatures": [500]},
        }
    )
    configs = [job.run_options(Sensor.MONOCULAR).system.config for job in jobs]
    assert [tuple(config.values()) for config in configs] == [
        *((8, 0.5), (8, 0.7)),
        *((12, 0.5), (12, 0.7)),
    ]
    assert "tracking.map_matches=8" in jobs[0].key
    assert "keyframes.share=0.5" in jobs[0].key
    changed = with_parameters(builtin_settings("tum1", Sensor.MONOCULAR), jobs[0].parameters)
    assert changed.orb.n_features == 500


@pytest.mark.parametrize(
    ("document", "message"),
    [
        ({"options": {"tracking.map_match": 8}}, "did you mean tracking.map_matches"),
        ({"options": {"tracking.map_matches": "many"}}, "give a number from 0 on"),
        ({"options": {"acceptance.search_again": 0}}, "give true or false"),
        ({"sweep": {"keyframes.shares": [1]}}, "did you mean keyframes.share"),
        ({"sweep": {"keyframes.share": [-1]}}, "allowed: a number from 0 on"),
    ],
)
def test_wrong_values_of_the_configuration(
    places: Path, document: dict[str, Any], message: str
) -> None:
    with pytest.raises(SettingsError, match=message):
        make_jobs({"sequences": [str(places / "a")], **document})

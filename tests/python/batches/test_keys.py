# SPDX-License-Identifier: BSD-3-Clause
"""Names of the folders of runs: no two alike, none too long, and those of earlier batches kept."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

import orbslam2py as orb
from orbslam2py.batches import Job, make_jobs
from orbslam2py.settings import builtin_settings
from support.batches import make_sequences, table

#: What names of files may have at most, in bytes.
LONGEST = 255


@pytest.fixture
def places(tmp_path: Path) -> Path:
    for name in ("seq", "other", "x/seq"):
        (tmp_path / name).mkdir(parents=True)
    settings = builtin_settings("tum1", orb.Sensor.RGBD)
    cameras = ("a/camera.yaml", "b/camera.yaml", "b/camera.yml", "c/lens.yaml")
    for name in (*cameras, "a b.yaml", "a_b.yaml", "a_camera.yaml", "mono.yaml"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        settings.save(tmp_path / name)
    return tmp_path


def keys(places: Path, **document: Any) -> list[str]:
    jobs = make_jobs({"sequences": ["seq"], **document}, places)
    assert len({job.key for job in jobs}) == len({job.setting for job in jobs}) == len(jobs)
    return [job.key for job in jobs]


# ---- alike ---------------------------------------------------------------------------------------
def test_values_that_differ_in_the_seventh_digit(places: Path) -> None:
    sweep = {"Camera.fx": [517.3061, 517.3064, 520.123456]}
    assert keys(places, sweep=sweep) == [
        "seq-Camera.fx=517.3061-seed0",
        "seq-Camera.fx=517.3064-seed0",
        "seq-Camera.fx=520.123-seed0",  # as it has always been called
    ]


def test_options_that_differ_in_the_seventh_digit(places: Path) -> None:
    options = {"full_adjustment_time_limit": [2.0000001, 2.0000002]}
    assert keys(places, options=options) == [
        "seq-full_adjustment_time_limit=2.0000001-seed0",
        "seq-full_adjustment_time_limit=2.0000002-seed0",
    ]


@pytest.mark.parametrize(
    ("files", "names"),
    [
        (["a/camera.yaml", "b/camera.yaml"], ["a_camera", "b_camera"]),
        (["a/camera.yaml", "b/camera.yaml", "c/lens.yaml"], ["a_camera", "b_camera", "lens"]),
        (["b/camera.yaml", "b/camera.yml"], ["camera.yaml", "camera.yml"]),
        (["a/camera.yaml", "c/lens.yaml"], ["camera", "lens"]),
    ],
)
def test_settings_of_one_name(places: Path, files: list[str], names: list[str]) -> None:
    assert keys(places, settings=files) == [f"seq-{name}-seed0" for name in names]


def test_settings_whose_names_become_the_same(places: Path) -> None:
    """No letter is left that differs, however much of the paths is told; a fingerprint does."""
    for key in keys(places, settings=["a b.yaml", "a_b.yaml"]):
        assert re.fullmatch(r"seq-a_b-[0-9a-f]{12}-seed0", key)


def test_settings_of_one_name_for_sequences_of_their_own(places: Path) -> None:
    """Nothing clashes: the names are those of always."""
    entries = [
        {"path": name, "settings": f"{folder}/camera.yaml"}
        for name, folder in (("seq", "a"), ("other", "b"))
    ]
    assert keys(places, sequences=entries) == ["seq-camera-seed0", "other-camera-seed0"]


def test_a_name_made_longer_is_no_other_ones(places: Path) -> None:
    files = ["a/camera.yaml", "b/camera.yaml", "a_camera.yaml"]
    assert keys(places, settings=files)[2] == "seq-a_camera-seed0"


def test_a_sensor_and_settings_that_are_called_as_it_is(places: Path) -> None:
    entries = [{"path": "seq", "sensor": "mono"}, {"path": "seq", "settings": "mono.yaml"}]
    assert all(key.startswith("seq-mono-") for key in keys(places, sequences=entries))


@pytest.mark.parametrize(
    ("document", "message"),
    [
        ({"sequences": ["seq", "x/seq"]}, "/seq and .*/x/seq; give the sequences names of their"),
        (
            {"sequences": [{"path": "seq", "topics": topics} for topics in ("/left", "/right")]},
            "/seq with the topics /left and /right; give the sequences names of their own",
        ),
        (
            {"sequences": [{"path": "seq", "name": name} for name in ("one!", "one?")]},
            "the names 'one!' and 'one[?]' are one in names of folders; give names that differ in "
            "letters, digits, or one of _ . = [+]",
        ),
        (  # disks that make one spelling of both would have one folder for them
            {"sequences": [{"path": "seq", "name": name} for name in ("\u00e9", "e\u0301")]},
            "the names '\u00e9' and 'e\u0301' are one in names of folders",
        ),
        (
            {"sequences": ["seq", "seq"]},
            "/seq twice with the same settings and options; leave one out, or give the sequences",
        ),
        ({"sequences": ["seq"], "options": {"stride": [2, 2]}}, "leave one out"),
    ],
)
def test_what_clashes_is_named(places: Path, document: dict[str, Any], message: str) -> None:
    with pytest.raises(orb.SettingsError, match=f"two runs would have the folder .*{message}"):
        make_jobs(document, places)


# ---- of any script -------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("日本", "日本"),
        ("Zürich Süd", "Zürich_Süd"),
        ("Zu\u0308rich", "Zürich"),
        ("हिन्दी", "हिन्दी"),  # signs of vowels are no letters to Unicode, but of the word
        ("прогон №٣", "прогон_٣"),
        ("a/b\\c:d*e?f\x00\n\u202eg\u2215\uff0fh", "a_b_c_d_e_f_g_h"),
        ("\u2600\ufe0fcaf\udce9", "_caf_"),
        ("plain a-b__c=+.", "plain_a_b__c=+."),
    ],
)
def test_letters_of_any_script(places: Path, name: str, told: str) -> None:
    assert keys(places, sequences=[{"path": "seq", "name": name}]) == [f"{told}-seed0"]


def test_names_of_any_script_tell_runs_apart(places: Path) -> None:
    entries = [{"path": "seq", "name": name} for name in ("раз", "два", "日本")]
    assert keys(places, sequences=entries) == ["раз-seed0", "два-seed0", "日本-seed0"]


def test_names_that_the_file_system_cannot_spell(
    places: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As in an ASCII locale, where every run would fail with it."""
    monkeypatch.setattr("os.fsencode", lambda text: text.encode("ascii", "surrogateescape"))
    monkeypatch.setattr("sys.getfilesystemencoding", lambda: "ascii")
    assert keys(places, sequences=[{"path": "seq", "name": "plain"}]) == ["plain-seed0"]
    said = "日本-seed0 cannot be the name of a folder where names are in ascii; .* or set LC_ALL"
    with pytest.raises(orb.SettingsError, match=said):
        keys(places, sequences=["seq", {"path": "seq", "name": "日本"}])


# ---- too long ------------------------------------------------------------------------------------
WIDE = {
    **{f"Camera.{name}": [500.25, 501.25] for name in ("fx", "fy", "cx", "cy")},
    **{f"Camera.{name}": [-0.1234] for name in ("k1", "k2", "k3", "p1", "p2")},
    **{"ORBextractor.nFeatures": [1000], "ORBextractor.scaleFactor": [1.234]},
    **{"ORBextractor.nLevels": [8], "ORBextractor.iniThFAST": [20], "ORBextractor.minThFAST": [7]},
}


def test_wide_sweeps(places: Path) -> None:
    jobs = make_jobs({"sequences": ["seq"], "sweep": WIDE, "seeds": [0, 2**64 - 1]}, places)
    assert len({job.key for job in jobs}) == len(jobs) == 32
    assert len({job.setting for job in jobs}) == 16
    for job in jobs:
        assert len(job.setting) > LONGEST  # the table tells all of it
        assert len(job.key) <= 120
        assert job.key.startswith("seq-Camera.cx=50")
        assert job.key.endswith(f"-seed{job.seed}")
        assert job.key.removesuffix(f"-seed{job.seed}") in {
            other.key.removesuffix(f"-seed{other.seed}")
            for other in jobs
            if other.seed != job.seed and other.parameters == job.parameters
        }


def test_names_that_fit_are_kept(places: Path) -> None:
    """Batches of before are gone on with."""
    name = "n" * (LONGEST - len("-seed0"))
    document = {"sequences": [{"path": "seq", "name": name}]}
    assert [job.key for job in make_jobs(document, places)] == [f"{name}-seed0"]
    (longer,) = make_jobs({"sequences": [{"path": "seq", "name": f"{name}n"}]}, places)
    assert len(longer.key) <= 120


@pytest.mark.parametrize(("letter", "size"), [("é", 2), ("日", 3), ("𐍈", 4)])
def test_bytes_count(places: Path, letter: str, size: int) -> None:
    """A letter has several bytes, and none is cut in two."""
    fits = letter * ((LONGEST - len("-seed0")) // size)
    (key,) = keys(places, sequences=[{"path": "seq", "name": fits}])
    assert key == f"{fits}-seed0"
    (key,) = keys(places, sequences=[{"path": "seq", "name": fits + letter}])
    assert re.fullmatch(rf"{letter}{{{80 // size}}}-[0-9a-f]{{12}}-seed0", key)
    assert len(key.encode()) <= 120


def test_fingerprints_are_those_of_always() -> None:
    job = Job("/data/seq", "seq", "rgbd", None, None, (("stride", 2),), (("ThDepth", 30.5),), 3)
    assert job.fingerprint == "c8af9e9f12b088d6"
    assert job.key == "seq-rgbd-stride=2-ThDepth=30.5-seed3"


def test_a_wide_sweep_is_run(tmp_path: Path) -> None:
    folder = make_sequences(tmp_path / "made")
    sweep = {
        **{name: [1e-4] for name in ("Camera.k1", "Camera.k2", "Camera.k3", "Camera.p1")},
        **{"Camera.p2": [1.234e-4], "ORBextractor.nFeatures": [700], "ThDepth": [33.25]},
        **{"ORBextractor.scaleFactor": [1.25], "ORBextractor.nLevels": [6]},
        **{"ORBextractor.iniThFAST": [18], "ORBextractor.minThFAST": [6]},
    }
    name = "a_sequence_with_a_name_that_tells_where_and_when_it_was_recorded_and_by_whom"
    document = {
        "sequences": [{"path": str(folder / "one"), "name": name}],
        "sweep": sweep,
        "options": {"max_frames": 3, "deterministic": True},
    }
    done = orb.batch(document, tmp_path / "out", workers=0)
    assert (len(done.rows), done.n_failed) == (1, 0), done.rows
    (row,) = table(tmp_path / "out")
    assert len(row["setting"]) > LONGEST
    assert [float(row[f"sweep.{key}"]) for key in sweep] == [float(v) for (v,) in sweep.values()]
    assert (tmp_path / "out/runs" / row["run"] / "report.json").is_file()
    again = orb.batch(document, tmp_path / "out", workers=0, resume=True)
    assert again.rows[0]["job_seconds"] == done.rows[0]["job_seconds"]

# SPDX-License-Identifier: BSD-3-Clause
"""Files that no command replaces: inputs, other people's work, results of another run."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from orbslam2py import Sensor
from support.command_line import RUN_FILES, CommandLine, refused
from support.files import names_in
from support.made_up_saved import map_file
from support.small_sequences import sequence

pytestmark = [pytest.mark.watchdog(60), pytest.mark.page]

N = 12
MINE = "my own work\n"


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return sequence(Sensor.RGBD, N).write(tmp_path_factory.mktemp("sequences") / "rgbd")


@pytest.fixture
def rgbd(original: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(original, tmp_path / "lap"))


@pytest.fixture
def finished(command: CommandLine, rgbd: Path) -> Path:
    done = command("run", rgbd, "--deterministic", "--output", "r", "--quiet")
    assert done.code == 0, done.err
    return Path("r")


def _raise(kind: type[BaseException]) -> Callable[..., None]:
    def raise_it(*_: object, **__: object) -> None:
        raise kind

    return raise_it


# ---- videos and recordings -----------------------------------------------------------------------
@pytest.mark.parametrize("what", ["run", "demo"])
def test_a_video_is_replaced_with_force_only(command: CommandLine, rgbd: Path, what: str) -> None:
    video = Path("a.mp4")
    video.write_text(MINE)
    arguments = (what, rgbd) if what == "run" else (what, "--frames", "10")
    arguments = (*arguments, "--output", "r", "--video", video)
    refused(command(*arguments), "a.mp4 exists; use --force")
    assert video.read_text() == MINE
    assert not Path("r").exists()
    done = command(*arguments, "--force", "--quiet")
    assert done.code == 0, done.err
    assert video.stat().st_size > 1000


def test_the_video_that_is_read_is_not_replaced_even_so(command: CommandLine, rgbd: Path) -> None:
    assert command("run", rgbd, "--output", "r", "--video", "a.mp4", "--quiet").code == 0
    before = Path("a.mp4").read_bytes()
    run = ("run", "a.mp4", "--sensor", "mono", "--settings", "tum1", "--force", "--quiet")
    refused(
        command(*run, "--output", "again", "--video", "./a.mp4"),
        "--video a.mp4 is what is read; give another name",
    )
    assert Path("a.mp4").read_bytes() == before


def test_a_video_in_the_folder_of_the_results(command: CommandLine, rgbd: Path) -> None:
    arguments = ("run", rgbd, "--output", "new/r", "--video", "new/r/a.mp4", "--quiet")
    done = command(*arguments)
    assert done.code == 0, done.err
    assert names_in(Path("new/r")) == sorted({*RUN_FILES, "a.mp4"})
    refused(command(*arguments), "new/r/a.mp4 exists; use --force")
    done = command(*arguments, "--force")
    assert done.code == 0, done.err
    assert names_in(Path("new/r")) == sorted({*RUN_FILES, "a.mp4"})


def test_that_folder_is_not_left_behind_by_a_run_that_does_not_begin(
    command: CommandLine, rgbd: Path
) -> None:
    Path("map.orbmap").write_text(MINE)
    files = ("--output", "r", "--video", "r/a.mp4", "--save", "map.orbmap")
    refused(command("run", rgbd, *files), "map.orbmap")
    assert names_in(Path()) == ["lap", "map.orbmap"]
    Path("mine").mkdir()
    refused(command("run", rgbd, "--output", "mine", "--video", "mine/a.xyz"), "mine/a.xyz")
    assert names_in(Path()) == ["lap", "map.orbmap", "mine"]


def test_two_outputs_of_one_name(command: CommandLine, rgbd: Path) -> None:
    files = ("--output", "r", "--video", "a.mp4", "--save", "./a.mp4")
    refused(command("run", rgbd, *files), "--video and --save both write a.mp4")
    refused(
        command("run", rgbd, "--output", "r", "--save", "r/trajectory_map0.txt"),
        "r/trajectory_map0.txt is the name of one of the run's results",
    )
    assert names_in(Path()) == ["lap"]
    assert command("run", rgbd, "--output", "r", "--save", "r/a.orbmap", "--quiet").code == 0
    assert names_in(Path("r")) == sorted({*RUN_FILES, "a.orbmap"})


# ---- folders -------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", ["settings.yaml", "keyframes.txt", "points.ply"])
def test_what_is_only_called_as_a_result_is_kept(
    command: CommandLine, rgbd: Path, name: str
) -> None:
    folder = Path("r")
    folder.mkdir()
    (folder / name).write_text(MINE)
    arguments = ("run", rgbd, "--output", folder, "--force")
    refused(command(*arguments), f"r holds {name}", "give another --output")
    assert names_in(folder) == [name]
    assert (folder / name).read_text() == MINE


def test_a_run_that_was_killed_is_replaced(
    command: CommandLine, rgbd: Path, finished: Path
) -> None:
    """Its folder holds the settings of the run before, and no results."""

    class Killed(BaseException):
        """No handler takes it."""

    arguments = ("run", rgbd, "--output", finished, "--quiet", "--force", "--sensor", "mono")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("orbslam2py.runs.runner.SequenceRunner.run", _raise(Killed))
        with pytest.raises(Killed):
            command(*arguments)
    assert names_in(finished) == ["frames.csv", "settings.yaml"]
    # A camera that stands in one place begins no map, which is no error of the folder.
    assert command(*arguments).code in (0, 4)
    assert "report.json" in names_in(finished)


def test_a_first_run_that_was_killed_needs_no_force(command: CommandLine, rgbd: Path) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("orbslam2py.runs.runner.SequenceRunner.run", _raise(SystemExit))
        command("run", rgbd, "--output", "r", "--quiet")
    assert names_in(Path("r")) == ["frames.csv"]
    done = command("run", rgbd, "--output", "r", "--quiet")
    assert done.code == 0, done.err
    refused(command("run", rgbd, "--output", "r", "--quiet"), "r is not empty")


def test_results_that_a_full_disk_cut_short_are_replaced(
    command: CommandLine, rgbd: Path, finished: Path
) -> None:
    """What marks the folder was there before the disk was full."""
    mark = (finished / "frames.csv").read_text().splitlines(keepends=True)[0]
    (finished / "frames.csv").write_text(mark)
    (finished / "report.json").unlink()
    done = command("run", rgbd, "--output", finished, "--quiet", "--force")
    assert done.code == 0, done.err
    assert len((finished / "frames.csv").read_text().splitlines()) == N + 1


@pytest.mark.parametrize("name", ["frames.csv", "report.json"])
def test_files_of_others_do_not_make_a_folder_that_of_a_run(
    command: CommandLine, rgbd: Path, name: str
) -> None:
    Path("data").mkdir()
    for mine in (name, "points.ply"):
        Path("data", mine).write_text(MINE)
    refused(command("run", rgbd, "--output", "data", "--force"), "data holds points.ply")
    assert names_in(Path("data")) == sorted([name, "points.ply"])


def test_the_demo_replaces_no_other_run(command: CommandLine, finished: Path) -> None:
    before = (finished / "report.json").read_bytes()
    arguments = ("demo", "--frames", "10", "--output", finished, "--quiet")
    refused(command(*arguments), "r is not empty", "--force to overwrite")
    assert (finished / "report.json").read_bytes() == before
    assert command(*arguments, "--force").code == 0
    assert (finished / "report.json").read_bytes() != before


def test_a_sequence_with_other_work_in_it_is_kept(command: CommandLine, tmp_path: Path) -> None:
    arguments = ("synthesize", "s", "--frames", "3", "--sensor", "rgbd", "--quiet")
    assert command(*arguments).code == 0
    assert command(*arguments, "--force").code == 0
    assert command(*arguments, "--force", "--layout", "mcap").code == 0, "another layout"
    assert command(*arguments, "--force").code == 0
    (tmp_path / "s" / "notes.txt").write_text(MINE)
    refused(command(*arguments, "--force"), "s/notes.txt is what was not written by this command")
    assert (tmp_path / "s" / "notes.txt").read_text() == MINE
    (tmp_path / "s" / "notes.txt").unlink()
    (tmp_path / "s" / "depth" / "notes.txt").write_text(MINE)
    refused(command(*arguments, "--force"), "s/depth is or holds what was not written")
    (tmp_path / "s" / "depth" / "notes.txt").unlink()
    for folder in ("s", "s/rgb"):
        (tmp_path / folder / ".DS_Store").touch()
    assert command(*arguments, "--force").code == 0
    (tmp_path / "s" / "synthetic.json").write_text("{}")
    refused(command(*arguments, "--force"), "synthetic.json does not say what else was written")
    assert names_in(tmp_path) == ["s"]


# ---- pages and figures ---------------------------------------------------------------------------
def test_pages_replace_pages_only(command: CommandLine, finished: Path) -> None:
    table = (finished / "frames.csv").read_bytes()
    refused(
        command("report", finished, "-o", finished / "frames.csv"),
        "r/frames.csv exists and is no page of this program",
    )
    refused(
        command("compare", finished, finished, "-o", finished / "frames.csv"),
        "r/frames.csv exists and is no page of this program",
    )
    assert (finished / "frames.csv").read_bytes() == table
    for name in ("a.html", "b.html"):
        Path(name).touch()
    for _ in range(2):
        assert command("report", finished, "-o", "a.html").code == 0
        assert command("compare", finished, finished, "-o", "b.html").code == 0


@pytest.mark.parametrize("version", ["this", "earlier"])
def test_pages_of_another_kind_are_other_files(
    command: CommandLine, finished: Path, version: str
) -> None:
    page = finished / "report.html"
    assert command("compare", finished, finished, "-o", "both.html").code == 0
    if version == "earlier":  # when a page did not say of what it is
        for path in (page, Path("both.html")):
            text = path.read_text()
            assert text.count('<meta name="orbslam2py-page"') == 1
            path.write_text(re.sub('<meta name="orbslam2py-page" content="[a-z]*">', "", text))
    before = page.read_bytes(), Path("both.html").read_bytes()
    refused(
        command("compare", finished, finished, "-o", page),
        "r/report.html exists and is the page of one run, so it is kept; give the page another "
        "name with --output",
    )
    refused(
        command("report", finished, "-o", "both.html"),
        "both.html exists and is the page of several runs, so it is kept",
    )
    assert (page.read_bytes(), Path("both.html").read_bytes()) == before
    assert command("report", finished).code == 0
    assert command("compare", finished, finished, "-o", "both.html").code == 0


def test_figures_replace_figures_only(command: CommandLine, finished: Path, rgbd: Path) -> None:
    report = (finished / "report.json").read_bytes()
    arguments = ("evaluate", finished / "trajectory.txt", rgbd, "--json")
    refused(
        command(*arguments, finished / "report.json"),
        "r/report.json exists and does not hold figures",
    )
    assert (finished / "report.json").read_bytes() == report
    Path("list.json").write_text("[1, 2]")
    refused(
        command(*arguments, "list.json"),
        "list.json exists and does not hold figures of this command",
    )
    assert command(*arguments, "list.json", "--force").code == 0
    Path("figures.json").touch()
    for _ in range(2):
        done = command(*arguments, "figures.json")
        assert done.code == 0, done.err
    assert json.loads(Path("figures.json").read_text())["ate_rmse_m"] < 0.1


def test_a_calibration_writes_two_files(command: CommandLine) -> None:
    Path("board.mp4").write_text(MINE)
    board = ("calibrate", "board.mp4", "--board", "9x6", "--square", "0.02", "--force")
    refused(
        command(*board, "-o", "x.png", "--plot", "x.png"), "--output and --plot both write x.png"
    )
    refused(command(*board, "-o", "board.mp4"), "--output board.mp4 is what is read")
    assert Path("board.mp4").read_text() == MINE


# ---- what is read --------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("arguments", "option"),
    [
        (("info", "m.orbmap", "--picture", "m.orbmap"), "--picture"),
        (("export", "ply", "m.orbmap", "./m.orbmap"), "the output"),
        (("export", "tum", "m.orbmap", "m.orbmap"), "the output"),
        (("export", "g2o", "m.orbmap", "m.orbmap"), "the output"),
    ],
)
def test_a_map_is_not_replaced_by_what_is_made_of_it(
    command: CommandLine, tmp_path: Path, arguments: tuple[str, ...], option: str
) -> None:
    before = map_file(tmp_path, name="m.orbmap").read_bytes()
    refused(command("map", *arguments, "--force"), option, "m.orbmap is what is read")
    assert Path("m.orbmap").read_bytes() == before


def test_a_trajectory_is_not_replaced_by_its_figures(
    command: CommandLine, finished: Path, rgbd: Path
) -> None:
    path = finished / "trajectory.txt"
    before = path.read_bytes()
    refused(
        command("evaluate", path, rgbd, "--json", path, "--force"),
        "--json r/trajectory.txt is what is read",
    )
    assert path.read_bytes() == before


def test_calibrations_do_not_replace_what_they_are_made_of(
    command: CommandLine, tmp_path: Path
) -> None:
    Path("board").mkdir()
    Path("board/00.png").write_text(MINE)
    board = ("calibrate", "board", "--board", "9x6", "--square", "0.02", "--force", "-o", "s.yaml")
    refused(command(*board, "--plot", "board/00.png"), "--plot board/00.png is what is read")
    assert Path("board/00.png").read_text() == MINE
    calib = sequence(Sensor.STEREO, 2).write(tmp_path / "drive") / "calib.txt"
    before = calib.read_bytes()
    refused(command("import-camera", calib, "-o", calib, "--force"), "calib.txt is what is read")
    assert calib.read_bytes() == before


# ---- arguments that are empty, readers that have gone --------------------------------------------
@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("run", "lap", "--output", ""), "what follows --output is empty"),
        (("run", "lap", "--output="), "--output is empty"),
        (("run", "lap", "--mask", ""), "what follows --mask is empty"),
        (("run", ""), "an argument is empty"),
        (("run", "--force", ""), "what follows --force is empty"),
        (("map", "info", ""), "an argument is empty"),
        (("synthesize", ""), "an argument is empty"),
    ],
)
def test_an_empty_argument_is_not_the_present_folder(
    command: CommandLine, rgbd: Path, arguments: tuple[str, ...], named: str
) -> None:
    refused(command(*arguments), named, "give a value, or leave it out")
    assert names_in(Path()) == ["lap"]


def test_files_are_written_though_nobody_reads_what_is_printed(tmp_path: Path) -> None:
    map_file(tmp_path, name="m.orbmap")
    asked = f"{sys.executable} -m orbslam2py map info m.orbmap --picture p.png"
    done = subprocess.run(
        ["bash", "-c", f"set -o pipefail; {asked} | true"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "p.png").stat().st_size > 1000

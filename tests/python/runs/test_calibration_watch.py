# SPDX-License-Identifier: BSD-3-Clause
"""A run tells once that the calibration does not fit, and why; the right one is not told."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import asdict, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

import orbslam2py as orb
from orbslam2py import Sensor, Settings, run_sequence
from orbslam2py.datasets import Images
from orbslam2py.runs import RunOptions, SystemOptions, check_calibration
from orbslam2py.runs.calibration_watch import N_IMAGES, CalibrationWatch
from orbslam2py.settings import Misfit, OrbSettings, builtin_settings
from orbslam2py.settings.sensor import WITHOUT_RIG
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence

pytestmark = pytest.mark.watchdog(120)


@lru_cache
def world(sensor: Sensor) -> SyntheticSequence:
    """The camera looks around in the room, which tells its focal length."""
    options = SyntheticOptions(world="room", sensor=sensor, frames=N_IMAGES, size=(320, 240))
    return SyntheticSequence(options)


@lru_cache
def images(sensor: Sensor) -> list[Images]:
    return [world(sensor).load(i) for i in range(N_IMAGES)]


def scaled(settings: Settings, factor: float) -> Settings:
    camera = settings.camera
    return replace(settings, camera=replace(camera, fx=factor * camera.fx, fy=factor * camera.fy))


@lru_cache
def seen_with(sensor: Sensor, factor: float) -> Misfit | None:
    """What the images say about a focal length that is so many times the right one."""
    return watched(scaled(world(sensor).settings, factor), images(sensor))


def watched(settings: Settings, shown: list[Images], **more: object) -> Misfit | None:
    watch = CalibrationWatch(settings, settings.sensor, **more)  # type: ignore[arg-type]
    for one in shown:
        watch.look(one)
    return watch.finish()


class Recording:
    """Images and settings that need not belong together."""

    name, layout = "made up", "images"

    def __init__(self, settings: Settings, shown: list[Images]) -> None:
        self.settings, self.sensor, self._images = settings, settings.sensor, shown
        self.timestamps = np.arange(len(shown)) / 20

    def __len__(self) -> int:
        return len(self._images)

    def load(self, index: int, /) -> Images:
        return self._images[index]

    def timestamp_text(self, index: int, /) -> str:
        return f"{self.timestamps[index]:.3f}"

    def ground_truth(self) -> None:
        return None


def misfits(log: pytest.LogCaptureFixture) -> list[str]:
    messages = [record.getMessage() for record in log.records]
    return [text for text in messages if "calibration does not fit" in text]


# ---- what the images say -------------------------------------------------------------------------
@pytest.mark.parametrize("sensor", WITHOUT_RIG)
def test_the_right_calibration_is_not_told(sensor: Sensor) -> None:
    assert seen_with(sensor, 1.0) is None


@pytest.mark.parametrize(
    ("sensor", "factor"),
    [
        (Sensor.MONOCULAR, 0.65),
        (Sensor.MONOCULAR, 1.5),
        (Sensor.STEREO, 1.5),
        (Sensor.RGBD, 0.65),
    ],
)
def test_a_wrong_focal_length_is_told_with_the_right_one(sensor: Sensor, factor: float) -> None:
    misfit = seen_with(sensor, factor)
    assert misfit is not None
    assert "a wrong focal length" in misfit.cause
    found = float(misfit.seen.split("fx of about ")[1].split()[0])
    assert found == pytest.approx(world(sensor).settings.camera.fx, rel=0.05)


@pytest.mark.parametrize("sensor", [Sensor.STEREO, Sensor.RGBD])
def test_a_wrong_principal_point_is_told(sensor: Sensor) -> None:
    settings = world(sensor).settings
    aside = replace(settings, camera=replace(settings.camera, cx=settings.camera.cx + 48))
    misfit = watched(aside, images(sensor))
    assert misfit is not None
    assert "principal point of about (1" in misfit.seen


def pairs(change: str) -> list[Images]:
    shown = []
    for one in images(Sensor.STEREO)[:20]:
        assert one.right is not None
        shown.append(
            Images(one.right, one.image)
            if change == "exchanged"
            else Images(one.image, np.roll(one.right, 4, axis=0))
        )
    return shown


def test_a_pair_whose_rows_disagree_is_told() -> None:
    misfit = watched(world(Sensor.STEREO).settings, pairs("shifted"))
    assert misfit is not None
    assert "differ by 4.0 pixels" in misfit.seen
    assert "not rectified" in misfit.cause


def test_an_exchanged_pair_is_told() -> None:
    misfit = watched(world(Sensor.STEREO).settings, pairs("exchanged"))
    assert misfit is not None
    assert "farther right in the right image" in misfit.seen
    assert "exchange left and right" in misfit.remedy


def test_what_comes_with_the_images_is_compared_first() -> None:
    known = world(Sensor.RGBD).settings
    misfit = watched(scaled(known, 1.02), images(Sensor.RGBD)[:1], known=known)
    assert misfit is not None
    assert "what comes with the images" in misfit.seen
    assert watched(known, images(Sensor.RGBD)[:1], known=known) is None


def test_a_still_camera_a_dark_room_and_no_images_say_nothing() -> None:
    wrong = scaled(world(Sensor.MONOCULAR).settings, 0.65)
    still = images(Sensor.MONOCULAR)[:1] * N_IMAGES
    dark = [Images(np.zeros_like(one.image)) for one in still]
    assert watched(wrong, still) is None
    assert watched(wrong, dark) is None
    assert watched(wrong, []) is None


def test_nothing_is_looked_at_after_the_first_images() -> None:
    watch = CalibrationWatch(world(Sensor.MONOCULAR).settings, Sensor.MONOCULAR)
    for one in images(Sensor.MONOCULAR):
        watch.look(one)
    gains = watch.gains
    assert gains is not None
    watch.look(Images(np.zeros((3, 5), np.uint8)))
    assert watch.gains is gains


def test_the_background_says_the_same() -> None:
    wrong = scaled(world(Sensor.RGBD).settings, 0.65)
    shown = images(Sensor.RGBD)
    assert watched(wrong, shown, in_background=True) == seen_with(Sensor.RGBD, 0.65)


# ---- runs ----------------------------------------------------------------------------------------
def run(settings: Settings, shown: list[Images], **options: bool) -> orb.runs.FinishedRun:  # type: ignore[name-defined]
    how = RunOptions(settings.sensor, SystemOptions(deterministic=True, **options))  # type: ignore[arg-type]
    return run_sequence(Recording(settings, shown), how)


def test_a_run_tells_once_and_goes_on(caplog: pytest.LogCaptureFixture) -> None:
    wrong = scaled(world(Sensor.RGBD).settings, 0.65)
    finished = run(wrong, images(Sensor.RGBD))
    (told,) = misfits(caplog)
    assert told in finished.report["warnings"]
    assert finished.result.n_tracked == N_IMAGES


def test_a_wrong_size_is_told_once(caplog: pytest.LogCaptureFixture) -> None:
    settings = replace(builtin_settings("euroc", Sensor.MONOCULAR))
    finished = run(settings, images(Sensor.MONOCULAR)[:3])
    assert misfits(caplog) == finished.report["warnings"][:1]
    assert "settings of euroc" in misfits(caplog)[0]


def test_it_is_told_when_nothing_can_be_tracked(caplog: pytest.LogCaptureFixture) -> None:
    """With 60 features no map begins; the watch does not need one."""
    wrong = replace(scaled(world(Sensor.MONOCULAR).settings, 0.65), orb=OrbSettings(n_features=30))
    finished = run(wrong, images(Sensor.MONOCULAR))
    assert finished.result.n_tracked == 0
    assert finished.result.calibration_warnings == misfits(caplog)
    assert len(misfits(caplog)) == 1


def test_depth_that_does_not_fit_is_in_the_report(caplog: pytest.LogCaptureFixture) -> None:
    right = world(Sensor.RGBD).settings
    assert right.depth is not None
    wrong = replace(right, depth=replace(right.depth, raw_per_metre=1.0))
    finished = run(wrong, images(Sensor.RGBD)[:6])
    (told,) = [line for line in finished.report["warnings"] if "DepthMapFactor" in line]
    assert told in [record.getMessage() for record in caplog.records]
    assert told in finished.result.calibration_warnings


def test_a_right_run_has_no_warning(caplog: pytest.LogCaptureFixture) -> None:
    finished = run(world(Sensor.RGBD).settings, images(Sensor.RGBD))
    assert finished.report["warnings"] == []
    assert not misfits(caplog)


def test_the_check_changes_no_byte_and_can_be_left_out(caplog: pytest.LogCaptureFixture) -> None:
    wrong = scaled(world(Sensor.RGBD).settings, 0.65)
    shown = images(Sensor.RGBD)[:30]
    with_check, without = run(wrong, shown), run(wrong, shown, check_calibration=False)
    assert without.report["warnings"] == []
    poses = [one.result.trajectories[0].T_wc for one in (with_check, without)]
    assert poses[0].tobytes() == poses[1].tobytes()
    points = [one.result.snapshot.point_positions for one in (with_check, without)]
    assert points[0].tobytes() == points[1].tobytes()
    assert len(misfits(caplog)) == len(with_check.report["warnings"])


def test_doubts_about_the_file_beside_the_images_are_told_once(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    options = SyntheticOptions(world="room", sensor="mono", frames=2, size=(320, 240))
    folder = SyntheticSequence(options).write(tmp_path / "room", "tum")
    path = folder / "settings.yaml"
    path.write_text(path.read_text().replace("nFeatures: 1000", "nFeatures: 150"))
    finished = run_sequence(orb.open_sequence(folder, "mono"))
    assert finished.report["warnings"] == ["ORBextractor.nFeatures 150 is very few"]
    assert sum("is very few" in record.getMessage() for record in caplog.records) == 1


# ---- systems, and without either -----------------------------------------------------------------
def test_a_system_tells_at_its_first_image(caplog: pytest.LogCaptureFixture) -> None:
    settings = builtin_settings("kitti03", Sensor.MONOCULAR)
    for check in (True, False):
        with orb.System(settings, "mono", check_calibration=check) as slam:
            for i, one in enumerate(images(Sensor.MONOCULAR)[:3]):
                slam.track_monocular(one.image, i / 20)
    assert len(misfits(caplog)) == 1
    assert asdict(slam.options)["check_calibration"] is False


def test_check_calibration_takes_sequences_and_frames(caplog: pytest.LogCaptureFixture) -> None:
    right = world(Sensor.RGBD).settings
    assert check_calibration(Recording(right, images(Sensor.RGBD)[:20])) is None
    wrong = scaled(right, 0.65)
    misfit = orb.check_calibration(Recording(wrong, images(Sensor.RGBD)))
    assert misfit is not None
    assert misfits(caplog) == [str(misfit)]
    assert misfit == seen_with(Sensor.RGBD, 0.65)

    class Frame:
        timestamp = 0.0

        def __init__(self, shown: Images) -> None:
            self.images = shown

    def frames() -> Iterator[Frame]:
        return (Frame(one) for one in images(Sensor.RGBD))

    assert check_calibration(frames(), wrong) == misfit


def test_check_calibration_takes_what_a_system_takes_for_settings(tmp_path: Path) -> None:
    right = world(Sensor.RGBD).settings
    right.save(tmp_path / "camera.yaml")
    recording = Recording(right, images(Sensor.RGBD)[:3])
    assert check_calibration(recording, tmp_path / "camera.yaml") is None
    assert check_calibration(recording, "tum1") == check_calibration(
        recording, builtin_settings("tum1", Sensor.RGBD)
    )
    with pytest.raises(orb.SettingsError, match="settings are 3; give Settings, a file"):
        check_calibration(recording, 3)  # type: ignore[arg-type]


def test_check_calibration_of_frames_needs_settings() -> None:
    frames = itertools.islice(world(Sensor.RGBD), 3)
    with pytest.raises(orb.SettingsError, match="an islice has no settings; give them"):
        check_calibration(frames)
    with pytest.raises(
        orb.SettingsError, match=r"name its sensor.*Settings.load\('tum1', sensor\)"
    ):
        check_calibration(frames, "tum1")


@pytest.mark.parametrize("unknown", [np.nan, np.inf, -np.inf])
def test_depth_that_is_not_known_does_not_count(unknown: float) -> None:
    """Beyond the sensor's reach cameras tell 0, NaN or infinity, as their makers like."""
    settings = world(Sensor.RGBD).settings
    gains = []
    for filled in (0.0, unknown):
        watch = CalibrationWatch(settings, Sensor.RGBD)
        for one in images(Sensor.RGBD):
            assert one.depth is not None
            depth = one.depth.astype(np.float32)
            depth[(depth > np.median(depth)) | (depth == 0)] = filled
            watch.look(replace(one, depth=depth))
        watch.finish()
        gains.append(watch.gains)
    first, second = gains
    assert first is not None
    assert second is not None
    assert (first.n_points, first.residual) == (second.n_points, second.residual)

# SPDX-License-Identifier: BSD-3-Clause
"""Synthetic sequences as folders in the layouts of TUM RGB-D, KITTI odometry, EuRoC, or bags."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from orbslam2py._arrays import FloatArray, IntArray
from orbslam2py._files import atomic_folder, failing_as
from orbslam2py.datasets import ImuSamples, Layout, Sequence
from orbslam2py.errors import DatasetError, SettingsError
from orbslam2py.settings import CameraSettings, ImuSettings, Sensor
from orbslam2py.synthetic.bag_files import BAG_LAYOUTS, BagContents, write_bag
from orbslam2py.synthetic.imu import write_euroc_imu, write_imu
from orbslam2py.synthetic.lens_pair import lens_pair_of
from orbslam2py.synthetic.options import SyntheticOptions
from orbslam2py.trajectory import Trajectory
from orbslam2py.trajectory.rotations import quaternions_from_rotations

Progress = Callable[[int, int], None]

#: Holds the options; marks folders that may be replaced.
MARKER = "synthetic.json"
#: In it: names in the folder, and how many files each of them holds, by which files of others are
#: distinguished from its own.
_ENTRIES = "entries"
#: What programs that show folders leave in them.
_NOBODYS = (".DS_Store", "Thumbs.db", "desktop.ini")

_SENSORS = {
    Layout.TUM: (Sensor.MONOCULAR, Sensor.RGBD),
    Layout.KITTI: (Sensor.MONOCULAR, Sensor.STEREO),
    Layout.EUROC: (Sensor.MONOCULAR, Sensor.STEREO, Sensor.RIG),
    **dict.fromkeys(map(Layout, BAG_LAYOUTS), (Sensor.MONOCULAR, Sensor.STEREO, Sensor.RGBD)),
}


class WritableSequence(Sequence, Protocol):
    """The data of a sequence, besides its images, that a data set needs.

    Attributes
    ----------
    options
        The options.
    camera
        The camera; both cameras of a pair are equal.
    baseline
        Distance of the cameras of a pair [m].
    nanoseconds
        Time stamps, int64 (n,).
    """

    @property
    def options(self) -> SyntheticOptions: ...  # noqa: D102
    @property
    def camera(self) -> CameraSettings: ...  # noqa: D102
    @property
    def baseline(self) -> float: ...  # noqa: D102
    @property
    def nanoseconds(self) -> IntArray: ...  # noqa: D102

    def imu(self) -> ImuSamples | None:
        """Make the samples of the IMU; None if there is none."""
        ...

    def imu_settings(self) -> ImuSettings | None:
        """Return the settings of the IMU; None if there is none."""
        ...

    def ground_truth(self) -> Trajectory:
        """Return the true pose of every frame."""
        ...


def choose_layout(layout: Layout | str | None, sensor: Sensor) -> Layout:
    """Return the layout, or the usual one of the sensor if it is None.

    Raises
    ------
    SettingsError
        If there is no such layout, or it does not support the sensor.
    """
    if layout is None:
        return Layout.KITTI if sensor is Sensor.STEREO else Layout.TUM
    try:
        chosen = Layout(layout)
    except ValueError:
        names = ", ".join(map(str, _SENSORS))
        raise SettingsError(f"layout is '{layout}'; there are {names}") from None
    if sensor not in _SENSORS.get(chosen, ()):
        fitting = " or ".join(str(item) for item in _SENSORS if sensor in _SENSORS[item])
        raise SettingsError(f"layout {chosen} has no place for {sensor}; take {fitting}")
    return chosen


def write_sequence(
    sequence: WritableSequence,
    folder: Path,
    layout: Layout | str | None = None,
    *,
    force: bool = False,
    progress: Progress | None = None,
) -> Path:
    """Write a sequence; see `SyntheticSequence.write`."""
    if sequence.sensor is Sensor.RIG and layout is None:
        layout = Layout.EUROC
    if layout is None and sequence.options.imu and sequence.sensor is not Sensor.RGBD:
        layout = Layout.EUROC
    chosen = choose_layout(layout, sequence.sensor)
    if sequence.options.lens_pair is not None and layout is None:
        chosen = Layout.EUROC
    if sequence.options.lens_pair is not None and chosen is not Layout.EUROC:
        raise SettingsError(
            f"the layout {chosen} has no place for the lenses of a raw pair; take the layout euroc"
        )
    if sequence.options.lens is not None and chosen is not Layout.TUM:
        raise SettingsError(
            f"the layout {chosen} has no place for the lens of the camera; take the layout tum"
        )
    if sequence.options.imu:
        _check_imu(sequence, chosen)
    writers: dict[Layout, Callable[[WritableSequence, Path, Progress], None]] = {
        Layout.TUM: _write_tum,
        Layout.KITTI: _write_kitti,
        Layout.EUROC: _write_euroc,
        **{Layout(name): partial(_write_bag, name) for name in BAG_LAYOUTS},
    }
    _check_replaceable(folder, force=force)
    with atomic_folder(folder) as temporary, failing_as(folder, temporary):
        writers[chosen](sequence, temporary, progress or (lambda done, total: None))
        _write_imu(sequence, temporary, chosen)
        about: dict[str, Any] = dataclasses.asdict(sequence.options) | {"layout": str(chosen)}
        if not sequence.options.imu:  # as before there were any
            del about["imu"], about["imu_noise"]
        if about.pop("rig") is not None:
            about["rig"] = sequence.default_settings().to_yaml()
        if about.pop("lens_pair") is not None:
            about["lens_pair"] = sequence.default_settings().to_yaml()
        about[_ENTRIES] = {entry.name: _n_files(entry) for entry in sorted(temporary.iterdir())}
        _write_text(temporary / MARKER, [json.dumps(about, indent=2, default=str)])
        _check_replaceable(folder, force=force)  # writing takes long: it may have been filled
    return folder


def _check_imu(sequence: WritableSequence, layout: Layout) -> None:
    if str(layout) in map(str, BAG_LAYOUTS):
        raise SettingsError(
            f"layout {layout} is written without an IMU; take euroc, tum or kitti, or leave out imu"
        )
    if len(sequence) < 3:
        raise SettingsError(
            f"{len(sequence)} frames make no path for an IMU; give 3 frames or more"
        )


def _write_imu(sequence: WritableSequence, folder: Path, layout: Layout) -> None:
    samples, settings = sequence.imu(), sequence.imu_settings()
    if samples is None or settings is None:
        return
    if layout is Layout.EUROC:
        write_euroc_imu(folder / "mav0", samples, settings)
    else:
        write_imu(folder, samples, settings)


# ---- layouts -------------------------------------------------------------------------------------


def _write_tum(sequence: WritableSequence, folder: Path, progress: Progress) -> None:
    rgb, depth, pairs = ["# timestamp filename"], ["# timestamp filename"], []
    (folder / "rgb").mkdir()
    if sequence.sensor is Sensor.RGBD:
        (folder / "depth").mkdir()
    for i in range(len(sequence)):
        images = sequence.load(i)
        stamp = sequence.timestamp_text(i)
        _write_image(folder / "rgb" / f"{stamp}.png", images.image)
        rgb.append(f"{stamp} rgb/{stamp}.png")
        if images.depth is not None:
            _write_image(folder / "depth" / f"{stamp}.png", images.depth)
            depth.append(f"{stamp} depth/{stamp}.png")
            pairs.append(f"{rgb[-1]} {depth[-1]}")
        progress(i + 1, len(sequence))
    _write_text(folder / "rgb.txt", rgb)
    if sequence.sensor is Sensor.RGBD:
        _write_text(folder / "depth.txt", depth)
        _write_text(folder / "associations.txt", pairs)
    T_wc = _upright(sequence.ground_truth().T_wc)
    quaternions = quaternions_from_rotations(T_wc[:, :3, :3])
    lines = ["# timestamp tx ty tz qx qy qz qw (camera to world)"]
    for i, (T, q) in enumerate(zip(T_wc, quaternions, strict=True)):
        lines.append(f"{sequence.timestamp_text(i)} {_numbers([*T[:3, 3], *q])}")
    _write_text(folder / "groundtruth.txt", lines)
    # The layout has no calibration of its own.
    sequence.default_settings().save(folder / "settings.yaml")


def _write_kitti(sequence: WritableSequence, folder: Path, progress: Progress) -> None:
    stereo = sequence.sensor is Sensor.STEREO
    for name in ("image_0", "image_1")[: 1 + stereo]:
        (folder / name).mkdir()
    for i in range(len(sequence)):
        images = sequence.load(i)
        _write_image(folder / "image_0" / f"{i:06d}.png", images.image)
        if images.right is not None:
            _write_image(folder / "image_1" / f"{i:06d}.png", images.right)
        progress(i + 1, len(sequence))
    _write_text(folder / "times.txt", [sequence.timestamp_text(i) for i in range(len(sequence))])
    camera = sequence.camera
    calibration = []
    for number in range(1 + stereo):
        P = np.hstack([camera.matrix, [[-camera.bf * number], [0.0], [0.0]]])
        calibration.append(f"P{number}: {_numbers(P.ravel())}")
    _write_text(folder / "calib.txt", calibration)
    poses = [_numbers(T[:3].ravel()) for T in sequence.ground_truth().T_wc]
    _write_text(folder / "poses.txt", poses)


def _write_euroc(sequence: WritableSequence, folder: Path, progress: Progress) -> None:
    top = folder / "mav0"
    if sequence.sensor is Sensor.RIG:
        _write_rig(sequence, top, progress)
        _write_euroc_truth(sequence, top)
        return
    cameras = [top / "cam0", top / "cam1"][: 1 + (sequence.sensor is Sensor.STEREO)]
    for number, camera in enumerate(cameras):
        (camera / "data").mkdir(parents=True)
        _write_text(camera / "sensor.yaml", _sensor_yaml(sequence, number))
    stamps = _stamps(sequence)
    for i, stamp in enumerate(stamps):
        images = sequence.load(i)
        for camera, image in zip(cameras, (images.image, images.right), strict=False):
            assert image is not None
            _write_image(camera / "data" / f"{stamp}.png", image)
        progress(i + 1, len(sequence))
    for camera in cameras:
        rows = [f"{stamp},{stamp}.png" for stamp in stamps]
        _write_text(camera / "data.csv", ["#timestamp [ns],filename", *rows])
    _write_euroc_truth(sequence, top)


def _write_rig(sequence: WritableSequence, top: Path, progress: Progress) -> None:
    """Images of all cameras in cam0, cam1, ... and depth images in depth0, ..."""
    stamps = _stamps(sequence)
    for i, stamp in enumerate(stamps):
        for number, images in enumerate(sequence.load(i).cameras or ()):
            kinds = ("cam", "depth") if isinstance(images, tuple) else ("cam",)
            each = images if isinstance(images, tuple) else (images,)
            for kind, image in zip(kinds, each, strict=True):
                folder = top / f"{kind}{number}" / "data"
                folder.mkdir(parents=True, exist_ok=True)
                _write_image(folder / f"{stamp}.png", image)
        progress(i + 1, len(sequence))
    # Says where the body of the ground truth is: in the first camera.
    _write_text(top / "cam0" / "sensor.yaml", _sensor_yaml(sequence, 0))


def _stamps(sequence: WritableSequence) -> list[str]:
    # Names of equal length sort by time.
    return [f"{nanoseconds:019d}" for nanoseconds in sequence.nanoseconds]


def _write_euroc_truth(sequence: WritableSequence, top: Path) -> None:
    stamps = _stamps(sequence)
    T_wc = _upright(sequence.ground_truth().T_wc)
    lines = [
        "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], "
        "q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z []"
    ]
    for stamp, T, q in zip(stamps, T_wc, quaternions_from_rotations(T_wc[:, :3, :3]), strict=True):
        lines.append(f"{stamp},{_numbers([*T[:3, 3], q[3], *q[:3]], ',')}")
    if sequence.options.lens_pair is not None or sequence.options.rig is not None:
        # sensor.yaml does not know all lenses, nor what belongs to the sensor alone.
        sequence.default_settings().save(top.parent / "settings.yaml")
    truth = top / "state_groundtruth_estimate0"
    truth.mkdir()
    _write_text(truth / "data.csv", lines)


def _write_bag(layout: str, sequence: WritableSequence, folder: Path, progress: Progress) -> None:
    def load(index: int) -> tuple[NDArray[Any], ...]:
        images = sequence.load(index)
        arrays = (images.image, images.right, images.depth)
        return tuple(image for image in arrays if image is not None)

    depth = sequence.default_settings().depth
    contents = BagContents(
        str(sequence.sensor),
        sequence.camera,
        sequence.nanoseconds.tolist(),
        _upright(sequence.ground_truth().T_wc),
        load,
        (depth and depth.raw_per_metre) or 1.0,
    )
    write_bag(contents, folder, layout, progress)


def _upright(T_wc: FloatArray) -> FloatArray:
    """Poses in a world whose z points up, as in TUM's and EuRoC's ground truth; here y is down."""
    T_up = np.eye(4)
    T_up[:3, :3] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
    return np.asarray(T_up @ T_wc)


def _sensor_yaml(sequence: WritableSequence, number: int) -> list[str]:
    """Describe a camera; the body frame of the rig is that of its left camera, as it is tracked."""
    camera, comment = sequence.camera, "without distortion"
    T_BS = np.eye(4)
    T_BS[0, 3] = sequence.baseline * number
    if sequence.options.lens_pair is not None:
        T_BS = lens_pair_of(sequence.options.lens_pair).T_tracked_raw[number]
        comment = "the lens is in settings.yaml"
    if sequence.options.rig is not None:
        comment = "the lens is in settings.yaml"
    return [
        "%YAML:1.0",
        "sensor_type: camera",
        f"comment: synthetic, {comment}",
        "T_BS:",
        "  cols: 4",
        "  rows: 4",
        f"  data: [{_numbers(T_BS.ravel(), ', ')}]",
        f"rate_hz: {camera.fps:g}",
        f"resolution: [{camera.width}, {camera.height}]",
        "camera_model: pinhole",
        f"intrinsics: [{_numbers([camera.fx, camera.fy, camera.cx, camera.cy], ', ')}]",
        "distortion_model: radial-tangential",
        "distortion_coefficients: [0.0, 0.0, 0.0, 0.0]",
    ]


# ---- files ---------------------------------------------------------------------------------------


def _check_replaceable(folder: Path, *, force: bool) -> None:
    if not folder.exists():
        return
    if not folder.is_dir():
        raise DatasetError(f"{folder} is not a folder; give another name")
    if not any(folder.iterdir()):
        return
    if not force:
        raise DatasetError(f"{folder} is not empty; give another name, or --force to replace it")
    if not (folder / MARKER).is_file():
        raise DatasetError(
            f"{folder} holds no {MARKER}, so it was not written by this command and is not "
            "replaced; give another name or remove it yourself"
        )
    if (other := _other_work(folder)) is not None:
        held = "is or holds what" if other.is_dir() else "is what"
        raise DatasetError(
            f"{other} {held} was not written by this command and would be lost with {folder}; take "
            "it away, or give another name"
        )


def _other_work(folder: Path) -> Path | None:
    """Return files in the folder of a synthetic sequence that do not belong to it."""
    try:
        told = json.loads((folder / MARKER).read_text(encoding="utf-8"))[_ENTRIES]
        written = {MARKER: 1, **{str(name): int(n_files) for name, n_files in told.items()}}
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise DatasetError(
            f"{folder / MARKER} does not say what else was written there, so {folder} is not "
            "replaced; give another name or remove it yourself"
        ) from error
    for entry in sorted(folder.iterdir()):
        if entry.name not in _NOBODYS and _n_files(entry) > written.get(entry.name, 0):
            return entry
    return None


def _n_files(entry: Path) -> int:
    """Number of files: one, or those in a folder."""
    if not entry.is_dir() or entry.is_symlink():
        return 1
    return sum(not path.is_dir() and path.name not in _NOBODYS for path in entry.rglob("*"))


def _write_image(path: Path, image: NDArray[Any]) -> None:
    # Not cv2.imwrite: it tells that it failed, but not why.
    done, png = cv2.imencode(".png", image)
    if not done:
        raise OSError(f"cannot encode {path}")
    path.write_bytes(png.tobytes())


def _write_text(path: Path, lines: list[str]) -> None:
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _numbers(values: Any, separator: str = " ") -> str:
    # repr keeps all digits of a float.
    return separator.join(repr(float(value)) for value in values)

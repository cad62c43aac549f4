# SPDX-License-Identifier: BSD-3-Clause
"""The groups of settings: camera, features, depth, rectification, map view.

Every group checks its values when it is created, and names all invalid ones by the keys of the
settings file. The meaning of a key is described at its field.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from orbslam2py._arguments import array_of, choice_of, is_whole, numbers_of, pose_of, shown
from orbslam2py._arrays import FloatArray, MadeAgainByCopies
from orbslam2py.errors import SettingsError
from orbslam2py.settings.camera_model import CameraModel
from orbslam2py.settings.fisheye import PINHOLE, checked_lens, checked_model
from orbslam2py.settings.keys import check_group, focal_problems
from orbslam2py.settings.projection import on_image_plane


def raise_if_any(problems: list[str]) -> None:
    """Raise `SettingsError` with all problems in one message, if there are any."""
    if problems:
        raise SettingsError("; ".join(problems))


#: Fields of `CameraSettings` in OpenCV's order of the coefficients.
DISTORTION_FIELDS = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
#: Models of `CameraModel` by the number of coefficients.
_OPENCV_MODELS = {0: "pinhole", 4: "radtan4", 5: "radtan5", 8: "rational"}


@dataclass(frozen=True)
class CameraSettings:
    """Pinhole camera with OpenCV's distortion, or a fisheye camera.

    Attributes
    ----------
    fx, fy, cx, cy
        Focal lengths and principal point in pixels; the centre of the top-left pixel is (0, 0).
    k1, k2, p1, p2, k3
        Radial-tangential distortion in OpenCV's order; all 0 for rectified images and fisheye
        lenses.
    width, height
        Image size in pixels, if known. Never enforced: the first image decides.
    fps
        Frames per second.
    bf
        Baseline times fx [pixel metres]; 0 for a single camera.
    rgb
        Whether colour images are RGB (True) or BGR.
    k4, k5, k6
        Denominator of the rational distortion model; all 0 for the radial-tangential model.
    model
        ``pinhole``, or the name of a fisheye model of `orbslam2py.CameraModel`:
        ``kannala_brandt``, ``double_sphere``, ``eucm``, ``mei`` or ``fov``; or ``thin_prism``.
        Other names of these are replaced by them.
    lens
        Parameters of the fisheye model after fx, fy, cx, cy, in the order of
        `orbslam2py.CameraModel`; empty for ``pinhole``. ``kannala_brandt``: k1, k2, k3, k4;
        ``double_sphere``: xi, alpha; ``eucm``: alpha, beta; ``mei``: xi, k1, k2, p1, p2; ``fov``:
        omega; ``thin_prism``: k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4.

    Raises
    ------
    SettingsError
        The message names all invalid values by the keys of the settings file.
    """

    fx: float
    fy: float
    cx: float
    cy: float
    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    k3: float = 0.0
    width: int | None = None
    height: int | None = None
    fps: float = 30.0
    bf: float = 0.0
    rgb: bool = False
    k4: float = 0.0
    k5: float = 0.0
    k6: float = 0.0
    model: str = PINHOLE
    lens: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        raise_if_any(check_group("camera", self))
        object.__setattr__(self, "model", checked_model(self.model))
        object.__setattr__(self, "lens", checked_lens(self.model, self.lens))
        if self.is_fisheye:
            self._check_fisheye()

    def _check_fisheye(self) -> None:
        given = [name for name in DISTORTION_FIELDS if getattr(self, name)]
        if given:
            raise SettingsError(
                f"{', '.join(given)} are coefficients of a pinhole camera, and the model is "
                f"{self.model}; give the coefficients of the fisheye lens as lens, and leave "
                f"{', '.join(given)} out"
            )
        # The size matters for the check of the focal length alone.
        self.camera_model(self.width or 1, self.height or 1)

    @property
    def is_fisheye(self) -> bool:
        """Return whether the camera has a fisheye model; its keypoints are raw pixels then."""
        return self.model != PINHOLE

    def camera_model(self, width: int, height: int) -> CameraModel:
        """Return the camera with its lens, for images of a size.

        Parameters
        ----------
        width, height
            Size of the images in pixels.

        Returns
        -------
        CameraModel
            A fisheye model, or ``pinhole``, ``radtan4``, ``radtan5`` or ``rational``.

        Raises
        ------
        SettingsError
            If the size is invalid, or the focal lengths do not fit images of this size.
        """
        intrinsics = (self.fx, self.fy, self.cx, self.cy)
        if self.is_fisheye:
            return CameraModel(self.model, (*intrinsics, *self.lens), (width, height))
        lens = self.distortion.tolist() if self.is_distorted else []
        return CameraModel(_OPENCV_MODELS[len(lens)], (*intrinsics, *lens), (width, height))

    @property
    def pixels_per_radian(self) -> float:
        """Return pixels of motion in the middle of the image per radian of rotation."""
        if not self.is_fisheye:
            return self.fx
        model = self.camera_model(self.width or 1, self.height or 1)
        return float(model.pixels_per_radian([[self.cx, self.cy]])[0])

    @property
    def matrix(self) -> FloatArray:
        """The camera matrix K, float64 (3, 3), pixels."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    @property
    def distortion(self) -> FloatArray:
        """Coefficients in OpenCV's order, float64 (4,), (5,) or (8,).

        k1, k2, p1, p2; also k3 if it is not 0; also k3, k4, k5, k6 if one of the last three is not
        0. All 0 for a fisheye lens, whose parameters are in `lens`.
        """
        four = [self.k1, self.k2, self.p1, self.p2]
        if self.k4 or self.k5 or self.k6:
            return np.array([*four, self.k3, self.k4, self.k5, self.k6])
        return np.array([*four, self.k3] if self.k3 else four)

    @property
    def is_distorted(self) -> bool:
        """Whether a pinhole camera has a distortion coefficient that is not 0."""
        return bool(np.any(self.distortion))

    def project(
        self, points: FloatArray, T_cw: FloatArray | None = None, *, distort: bool = True
    ) -> FloatArray:
        """Project points to pixels.

        Parameters
        ----------
        points
            Positions in the world (n, 3), as in `orbslam2py.MapSnapshot.point_positions`.
        T_cw
            World to camera (4, 4), as in `orbslam2py.TrackingRecord.T_cw`; None if the points are
            already in camera coordinates (x right, y down, z forward).
        distort
            Return pixels of the unchanged images. False: undistorted pixels, as the keypoints of
            `orbslam2py.FrameFeatures`; there is no difference for rectified images, nor for fisheye
            lenses, whose keypoints are raw pixels.

        Returns
        -------
        FloatArray
            Pixels u, v, float64 (n, 2), also outside the image. NaN for points that are not in
            front of the camera, or outside the domain of the distortion. A fisheye lens shows
            points behind the camera, in the domain of its model.

        Raises
        ------
        SettingsError
            If the arrays have other shapes, or `T_cw` is no pose.
        """
        positions = array_of(points, "points", (-1, 3), SettingsError, finite=False)
        if T_cw is not None:
            T = pose_of(T_cw, "T_cw")
            positions = positions @ T[:3, :3].T + T[:3, 3]
        bent = choice_of(distort, "distort")
        if self.is_fisheye:
            return self.camera_model(self.width or 1, self.height or 1).project(positions)
        lens = self.distortion if bent else None
        plane = on_image_plane(positions, lens)
        return plane * (self.fx, self.fy) + (self.cx, self.cy)


@dataclass(frozen=True)
class OrbSettings:
    """ORB extraction (ORB-SLAM2, section III).

    Attributes
    ----------
    n_features
        Keypoints wanted per image, all pyramid levels together.
    scale_factor, n_levels
        Ratio between neighbouring pyramid levels and their number.
    ini_th_fast, min_th_fast
        FAST thresholds in grey levels: the second serves cells where the first finds nothing.
    original_coordinates
        Whether keypoints of coarse levels lie where the original puts them, up to 1.3 pixels from
        their true place: for comparisons with it.
    """

    n_features: int = 1000
    scale_factor: float = 1.2
    n_levels: int = 8
    ini_th_fast: int = 20
    min_th_fast: int = 7
    original_coordinates: bool = False

    def __post_init__(self) -> None:
        problems = check_group("orb", self)
        if not problems and self.min_th_fast > self.ini_th_fast:
            problems = [thresholds_swapped(self.min_th_fast, self.ini_th_fast)]
        raise_if_any(problems)


#: Pixels of images that are large.
_LARGE = 600_000


def usual_n_features(width: int | None, height: int | None) -> int:
    """Features per image: 1000, or 2000 above 0.6 megapixels; 1000 if the size is unknown."""
    return 2000 if (width or 0) * (height or 0) > _LARGE else 1000


def thresholds_swapped(min_th_fast: int, ini_th_fast: int) -> str:
    """Say that the second FAST threshold lies above the first."""
    return (
        f"ORBextractor.minThFAST is {min_th_fast}; allowed: 1 to ORBextractor.iniThFAST, "
        f"which is {ini_th_fast}"
    )


@dataclass(frozen=True)
class DepthSettings:
    """How depth is read and trusted (stereo and RGB-D).

    Attributes
    ----------
    close_factor
        Points nearer than this many baselines are trusted from one view (key ``ThDepth``).
    raw_per_metre
        Units of the depth image per metre (key ``DepthMapFactor``): 1000 for millimetres, 1 for
        metres. RGB-D needs it.
    """

    close_factor: float
    raw_per_metre: float | None = None

    def __post_init__(self) -> None:
        raise_if_any(check_group("depth", self))


@dataclass(frozen=True)
class ViewerSettings:
    """Sizes of things in the map view, and where its eye stands.

    Attributes
    ----------
    keyframe_size, camera_size
        Length of the drawn cameras in units of the world [m].
    keyframe_line_width, graph_line_width, camera_line_width, point_size
        Widths of lines and points in pixels.
    viewpoint_x, viewpoint_y, viewpoint_z
        Where the eye stands, seen from the present camera (x right, y down, z forward) [m].
    viewpoint_f
        Focal length of the view in pixels.
    """

    keyframe_size: float = 0.05
    keyframe_line_width: float = 1.0
    graph_line_width: float = 0.9
    point_size: float = 2.0
    camera_size: float = 0.08
    camera_line_width: float = 3.0
    viewpoint_x: float = 0.0
    viewpoint_y: float = -0.7
    viewpoint_z: float = -1.8
    viewpoint_f: float = 500.0

    def __post_init__(self) -> None:
        raise_if_any(check_group("viewer", self))


@dataclass(frozen=True, eq=False)
class CameraRectification(MadeAgainByCopies):
    """Rectification of one raw camera of a stereo pair (OpenCV's conventions).

    Attributes
    ----------
    K
        Raw camera matrix (3, 3), pixels.
    D
        Raw distortion, 4, 5, 8 or 12 coefficients; of a fisheye model its parameters after fx, fy,
        cx, cy, as `orbslam2py.CameraModel` orders them.
    R
        Rotation (3, 3) from raw to rectified camera coordinates.
    P
        Rectified projection (3, 4), pixels; ``P[0, 3]`` of the right camera is -bf.
    width, height
        Size of the images in pixels, raw and rectified.
    model
        ``pinhole``, or a fisheye model as in `CameraSettings.model`.
    """

    K: FloatArray
    D: FloatArray
    R: FloatArray
    P: FloatArray
    width: int
    height: int
    model: str = PINHOLE

    def __post_init__(self) -> None:
        object.__setattr__(self, "model", checked_model(self.model))
        pinhole = self.model == PINHOLE
        problems = []
        for name, shape in (("K", (3, 3)), ("D", None), ("R", (3, 3)), ("P", (3, 4))):
            value = numbers_of(getattr(self, name), name, SettingsError).copy()
            value = value.reshape(-1) if name == "D" else value
            value.setflags(write=False)
            object.__setattr__(self, name, value)
            if shape is not None and value.shape != shape:
                problems.append(f"{name} must be {shape[0]} x {shape[1]}, not {value.shape}")
            elif shape is None and pinhole and value.size not in (4, 5, 8, 12):
                problems.append(f"{name} must have 4, 5, 8 or 12 coefficients, not {value.size}")
            elif not np.isfinite(value).all():
                problems.append(f"{name} holds a number that is not finite")
            elif name in "KP":
                problems += focal_problems(name, value)
        if not problems and np.abs(self.R @ self.R.T - np.eye(3)).max() > 1e-3:
            problems.append("R is not a rotation (rows not orthonormal to 1e-3)")
        for name in ("width", "height"):
            side = getattr(self, name)
            if not is_whole(side) or side < 1:
                problems.append(f"{name} is {shown(side)}; give pixels, 1 or more")
        raise_if_any(problems)
        if not pinhole:
            checked_lens(self.model, self.D)

    def camera_model(self) -> CameraModel:
        """Return the raw camera with its lens."""
        intrinsics = (self.K[0, 0], self.K[1, 1], self.K[0, 2], self.K[1, 2])
        bent = self.D if self.D.any() or self.model != PINHOLE else self.D[:0]
        name = _OPENCV_MODELS[bent.size] if self.model == PINHOLE else self.model
        return CameraModel(name, (*intrinsics, *bent), (self.width, self.height))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, CameraRectification):
            return NotImplemented
        ours = self.model, self.width, self.height
        return ours == (other.model, other.width, other.height) and all(
            np.array_equal(getattr(self, name), getattr(other, name)) for name in "KDRP"
        )

    def __hash__(self) -> int:
        # Adding 0 makes one zero of both.
        return hash((self.width, self.height, (self.K + 0.0).tobytes(), (self.P + 0.0).tobytes()))


@dataclass(frozen=True)
class StereoRectification:
    """Rectification of both cameras of a pair (keys ``LEFT.*`` and ``RIGHT.*``).

    Attributes
    ----------
    left, right
        Both cameras.
    applied
        Whether images come rectified by it already, as those of a sequence that was opened with
        these settings do. It is not stored in files and does not count in comparisons.
    """

    left: CameraRectification
    right: CameraRectification
    applied: bool = field(default=False, compare=False, kw_only=True)

    def __post_init__(self) -> None:
        for side in ("left", "right"):
            camera = getattr(self, side)
            if not isinstance(camera, CameraRectification):
                raise SettingsError(f"{side} is {shown(camera)}; give CameraRectification(...)")

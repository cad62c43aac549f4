# SPDX-License-Identifier: BSD-3-Clause
"""Camera models: pinhole with OpenCV's distortions, fisheye and omnidirectional lenses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from orbslam2py import _core
from orbslam2py._arguments import array_of, float_of, is_number, is_whole, shown
from orbslam2py._arrays import FloatArray
from orbslam2py.errors import SettingsError

_LARGEST_SIZE = 2**31 - 1


class AngleOfView(NamedTuple):
    """Angles of view of an image, in radians; they may exceed pi.

    Attributes
    ----------
    horizontal
        Along the row of the principal point.
    vertical
        Along the column of the principal point.
    diagonal
        Along the diagonal with the larger angle.
    """

    horizontal: float
    vertical: float
    diagonal: float


class CameraModel:
    """A calibrated camera of any model: pixels of points, and rays of pixels.

    Pixels belong to the unchanged image, with distortion; the centre of the top-left pixel is (0,
    0). Points and rays are in the camera frame: z along the optical axis, x right, y down. Objects
    are immutable and equal if model, parameters and image size are equal.

    Parameters
    ----------
    model
        A name of the list below, or another program's name for the same model. The case of letters
        does not matter.
    parameters
        The numbers in the order of the list, or a mapping from parameter names to numbers. Focal
        lengths and principal point are in pixels, ``omega`` is in radians, all others have no unit.
    image_size
        Width and height in pixels.

    Raises
    ------
    SettingsError
        For an unknown model, a wrong number of parameters, a parameter that is not finite or out of
        its range, focal lengths that are not in pixels, and an image size that is not positive. The
        message names model, parameter and remedy.

    Notes
    -----
    All parameters begin with ``fx, fy, cx, cy``. In the formulas, (x, y, z) is a point,
    r = sqrt(x^2 + y^2), and the pixel is (fx m_x + cx, fy m_y + cy). The models with their further
    parameters, and other programs' names:

    - ``pinhole``: no further parameters; m = (x / z, y / z). Domain: z > 0.
    - ``radtan4``: k1, k2, p1, p2. Other names: radtan, radial-tangential, OPENCV.
    - ``radtan5``: k1, k2, p1, p2, k3. Other name: plumb_bob.
    - ``rational``: k1, k2, p1, p2, k3, k4, k5, k6. Other names: rational_polynomial,
      pinhole-radtan8, FULL_OPENCV.
    - ``thin_prism``: k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4. ``radtan4`` to ``thin_prism``
      are the distortions of OpenCV's documentation, module calib3d (D. C. Brown, "Close-range
      camera calibration", 1971). Domain: z > 0, and radii below the one where the model folds over.
    - ``kannala_brandt``: k1, k2, k3, k4; m = d (x, y) / r with the angle theta from the axis and
      d = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8). Other names:
      KannalaBrandt8, kb4, equidistant, fisheye, OPENCV_FISHEYE. Domain: angles below 180 degrees,
      and below the one where d decreases. J. Kannala, S. Brandt, "A generic camera model and
      calibration method for conventional, wide-angle, and fish-eye lenses", PAMI 2006.
    - ``double_sphere``: xi (-1 to 1), alpha (0 to 1); m = (x, y) / (alpha d2 + (1 - alpha) z2) with
      d1 = sqrt(r^2 + z^2), z2 = xi d1 + z, d2 = sqrt(r^2 + z2^2). Other name: ds. V. Usenko,
      N. Demmel, D. Cremers, "The double sphere camera model", 3DV 2018.
    - ``eucm``: alpha (0 to 1), beta (above 0); m = (x, y) / (alpha d + (1 - alpha) z) with
      d = sqrt(beta r^2 + z^2). Other name: extended_unified. B. Khomutenko, G. Garcia, P. Martinet,
      "An enhanced unified camera model", RA-L 2016.
    - ``mei``: xi (not below 0), k1, k2, p1, p2; the distortion of ``radtan4`` of
      (x, y) / (z + xi sqrt(r^2 + z^2)). Other name: unified_omnidirectional. C. Mei, P. Rives,
      "Single view point omnidirectional camera calibration from planar grids", ICRA 2007.
    - ``fov``: omega (between 0 and pi); m = d (x, y) / r with
      d = atan2(2 r tan(omega / 2), z) / omega. Other name: pinhole-fov. F. Devernay, O. Faugeras,
      "Straight lines have to be straight", 2001.

    Kalibr writes ``xi``, ``alpha`` and ``beta`` before the focal lengths: give those by name.

    Examples
    --------
    >>> import orbslam2py as orb
    >>> camera = orb.CameraModel("double_sphere", [158.3, 158.3, 255, 257, -0.17, 0.59], (512, 512))
    >>> camera.project([[0.0, 0.0, 2.0], [0.0, 0.0, -1.0]])
    array([[255., 257.],
           [ nan,  nan]])
    """

    __slots__ = ("_core", "_image_size")

    def __init__(
        self,
        model: str,
        parameters: Sequence[float] | Mapping[str, float] | FloatArray,
        image_size: tuple[int, int],
    ) -> None:
        if not isinstance(model, str):
            names = ", ".join(name for name, _, _ in _core.camera_models())
            raise SettingsError(f"the camera model is {shown(model)}; give one of {names}")
        self._image_size = _size_of(model, image_size)
        if isinstance(parameters, Mapping):
            parameters = _in_order(model, parameters)
        self._core = _core.CameraModel(model, _floats(model, parameters), *self._image_size)

    @property
    def name(self) -> str:
        """Name of the model, as in the list above."""
        return self._core.name

    @property
    def parameters(self) -> tuple[float, ...]:
        """The parameters in the order of `parameter_names`."""
        return tuple(self._core.parameters)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the parameters, in their order."""
        return tuple(self._core.parameter_names)

    @property
    def core(self) -> _core.CameraModel:
        """The camera of the C++ core, for use inside of the package."""
        return self._core

    @property
    def image_size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return self._image_size

    def project(self, points: FloatArray | Sequence[Sequence[float]]) -> FloatArray:
        """Project points to pixels.

        Parameters
        ----------
        points
            (n, 3), in the camera frame, in any unit of length.

        Returns
        -------
        array of float64 (n, 2)
            Pixels (u, v). NaN for points outside of the domain of the model. Pixels outside the
            image are returned too.

        Raises
        ------
        SettingsError
            For an array of another shape.
        """
        return self._core.project(_rows_of(points, "points", 3))

    def project_with_jacobian(
        self, points: FloatArray | Sequence[Sequence[float]]
    ) -> tuple[FloatArray, FloatArray]:
        """Project points to pixels, with derivatives.

        Parameters
        ----------
        points
            (n, 3), in the camera frame.

        Returns
        -------
        pixels : array of float64 (n, 2)
            As from `project`.
        jacobians : array of float64 (n, 2, 3)
            Derivatives of (u, v) by (x, y, z), in pixels per unit of length. NaN outside of the
            domain.
        """
        return self._core.project_with_jacobian(_rows_of(points, "points", 3))

    def unproject(self, pixels: FloatArray | Sequence[Sequence[float]]) -> FloatArray:
        """Return the directions of pixels.

        Parameters
        ----------
        pixels
            (n, 2), with distortion; pixels outside the image are allowed.

        Returns
        -------
        array of float64 (n, 3)
            Rays of length 1 in the camera frame; z is negative beyond 90 degrees from the axis. NaN
            for pixels outside the domain of the model.

        Raises
        ------
        SettingsError
            For an array of another shape.
        """
        return self._core.unproject(_rows_of(pixels, "pixels", 2))

    def pixels_per_radian(
        self, pixels: FloatArray | Sequence[Sequence[float]] | None = None
    ) -> FloatArray:
        """Return the resolution of the image at pixels.

        Parameters
        ----------
        pixels
            (n, 2), with distortion. Default: the principal point alone.

        Returns
        -------
        array of float64 (n,)
            Pixels per radian, as the geometric mean over all directions: the square root of the
            area in the image per solid angle. NaN outside the domain of the model.
        """
        if pixels is None:
            pixels = [self.parameters[2:4]]
        return self._core.pixels_per_radian(_rows_of(pixels, "pixels", 2))

    def angle_of_view(self) -> AngleOfView:
        """Return the angles of view of the image, between its borders and between its corners.

        Returns
        -------
        AngleOfView
            In radians. If a border is outside the domain of the model, the last pixel inside
            counts.
        """
        return AngleOfView(*self._core.angle_of_view())

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, CameraModel):
            return NotImplemented
        return self._key() == other._key()

    def __hash__(self) -> int:
        return hash(self._key())

    def __repr__(self) -> str:
        values = ", ".join(
            f"{name}={value:g}"
            for name, value in zip(self.parameter_names, self.parameters, strict=True)
        )
        width, height = self._image_size
        return f"CameraModel({self.name}, {width}x{height}, {values})"

    def __reduce__(self) -> tuple[type[CameraModel], tuple[Any, ...]]:
        return type(self), self._key()

    def _key(self) -> tuple[str, tuple[float, ...], tuple[int, int]]:
        return self.name, self.parameters, self._image_size


def _in_order(model: str, parameters: Mapping[str, float]) -> list[float]:
    """Return the numbers of a mapping in the order of the model; the core checks the model."""
    names: Sequence[str] = ()
    for name, aliases, own in _core.camera_models():
        if model.lower() in (name, *(alias.lower() for alias in aliases)):
            names = own
    missing = [name for name in names if name not in parameters]
    unknown = [str(name) for name in parameters if name not in names]
    if names and (missing or unknown):
        wrong = [f"lacks {', '.join(missing)}"] if missing else []
        wrong += [f"does not have {', '.join(unknown)}"] if unknown else []
        raise SettingsError(f"camera model {model} {' and '.join(wrong)}; give {', '.join(names)}")
    return [parameters[name] for name in names]


def _floats(model: str, parameters: Any) -> list[float]:
    """Return the parameters as numbers; the core checks their count and ranges."""
    try:
        if isinstance(parameters, str | bytes):
            raise TypeError
        values = list(parameters)
    except TypeError:
        raise SettingsError(
            f"camera model {model}: parameters is {shown(parameters)}; give a list of numbers or a "
            "mapping from names to numbers"
        ) from None
    for place, value in enumerate(values):
        if not is_number(value):
            raise SettingsError(
                f"camera model {model}: parameter {place} is {shown(value)}; give a number"
            )
    return [float_of(value) for value in values]


def _size_of(model: str, image_size: Any) -> tuple[int, int]:
    try:
        width, height = image_size
        fits = all(is_whole(one) and 0 < one <= _LARGEST_SIZE for one in (width, height))
    except (TypeError, ValueError):
        fits = False
    if not fits:
        text = (
            repr(tuple(image_size)) if isinstance(image_size, tuple | list) else shown(image_size)
        )
        raise SettingsError(
            f"camera model {model}: image_size is {text}; give (width, height) in pixels, two "
            "whole numbers above 0"
        )
    return int(width), int(height)


def _rows_of(values: Any, what: str, columns: int) -> FloatArray:
    return np.ascontiguousarray(array_of(values, what, (-1, columns), SettingsError, finite=False))

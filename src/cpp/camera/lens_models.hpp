// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>

#include "camera/pinhole.hpp"
#include "camera/plane_distortion.hpp"

/// The models of which a CameraModel is one. Each has
///   bool project(p_c, seen): pixel and derivative of a point; false outside of its domain,
///   bool unproject(uv, ray): the unit ray seen at a pixel; false where no ray is shown.
/// The distance of the point does not matter, and may be in any unit. NaN is in no domain.
namespace orbslam::lens_models {

inline constexpr double kPi = 3.14159265358979323846;

/// Pinhole without distortion. Domain: z > 0.
struct PinholeLens {
  Pinhole plane;

  bool project(const Eigen::Vector3d& p_c, Seen& seen) const {
    if (!(p_c.z() > 0 && std::isfinite(p_c.x() + p_c.y()))) return false;
    const double inverse_z = 1 / p_c.z();
    seen.uv = plane.project(p_c);
    seen.J << plane.fx * inverse_z, 0, -plane.fx * p_c.x() * inverse_z * inverse_z,  //
        0, plane.fy * inverse_z, -plane.fy * p_c.y() * inverse_z * inverse_z;
    return true;
  }
  bool unproject(const Eigen::Vector2d& uv, Eigen::Vector3d& ray) const {
    ray = plane.unproject(uv.x(), uv.y(), 1).normalized();
    return true;
  }
};

/// OpenCV's model: radial-tangential, rational, thin prism (PlaneDistortion). Domain: z > 0, and
/// the distortion does not fold over.
struct PlaneDistortionLens {
  Pinhole plane;
  PlaneDistortion distortion;

  bool project(const Eigen::Vector3d& p_c, Seen& seen) const {
    if (!(p_c.z() > 0)) return false;
    const double inverse_z = 1 / p_c.z();
    const Eigen::Vector2d m = p_c.head<2>() * inverse_z;
    Bent bent;
    if (!distortion.distort(m, bent)) return false;
    seen.uv = plane.to_pixel(bent.at);
    seen.J.leftCols<2>() = bent.J * inverse_z;
    seen.J.col(2) = bent.J * m * -inverse_z;
    seen.J.row(0) *= plane.fx;
    seen.J.row(1) *= plane.fy;
    return true;
  }
  bool unproject(const Eigen::Vector2d& uv, Eigen::Vector3d& ray) const {
    Eigen::Vector2d m;
    if (!distortion.undistort(plane.to_plane(uv), m)) return false;
    ray = Eigen::Vector3d(m.x(), m.y(), 1).normalized();
    return true;
  }
};

/// Distance from the principal point, at focal length 1, of a point at distance r from the axis.
struct AxialRadius {
  double value, by_r, by_z;
};

/// Pixel of a lens that is symmetric about its axis.
inline void place_axially(const Pinhole& plane, const Eigen::Vector3d& p_c, double r,
                          const AxialRadius& radius, Seen& seen) {
  if (r == 0) {  // the derivatives have the same limit from all directions
    seen.uv = {plane.cx, plane.cy};
    seen.J << plane.fx * radius.by_r, 0, 0, 0, plane.fy * radius.by_r, 0;
    return;
  }
  const double cosine = p_c.x() / r, sine = p_c.y() / r, scale = radius.value / r;
  const double rest = radius.by_r - scale;
  seen.uv = plane.to_pixel({radius.value * cosine, radius.value * sine});
  seen.J << plane.fx * (scale + cosine * cosine * rest), plane.fx * cosine * sine * rest,
      plane.fx * cosine * radius.by_z,  //
      plane.fy * cosine * sine * rest, plane.fy * (scale + sine * sine * rest),
      plane.fy * sine * radius.by_z;
}

/// The unit ray at `angle` from the axis towards the point m of the image plane.
inline Eigen::Vector3d ray_at(const Eigen::Vector2d& m, double radius, double angle) {
  if (radius == 0) return {0, 0, 1};
  const double sine = std::sin(angle) / radius;
  return {m.x() * sine, m.y() * sine, std::cos(angle)};
}

/// J. Kannala, S. Brandt, "A generic camera model and calibration method for conventional,
/// wide-angle, and fish-eye lenses", PAMI 2006, with k1 = 1 of its radial polynomial as OpenCV's
/// fisheye module has it: radius = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8).
/// Domain: angles theta from the axis below pi, and below the one where the radius decreases.
class KannalaBrandtLens {
 public:
  KannalaBrandtLens(const Pinhole& plane, const std::array<double, 4>& k);

  bool project(const Eigen::Vector3d& p_c, Seen& seen) const {
    const double r = std::sqrt(p_c.x() * p_c.x() + p_c.y() * p_c.y());
    const double theta = std::atan2(r, p_c.z());
    if (!(theta < largest_theta_) || !(p_c.z() != 0 || r > 0)) return false;
    const Radius at = radius(theta);
    const double by_r2 = at.slope / (r * r + p_c.z() * p_c.z());
    place_axially(plane_, p_c, r, {at.value, by_r2 * p_c.z(), -by_r2 * r}, seen);
    return true;
  }
  bool unproject(const Eigen::Vector2d& uv, Eigen::Vector3d& ray) const;

 private:
  struct Radius {
    double value, slope;
  };
  Radius radius(double theta) const {
    const auto [k1, k2, k3, k4] = k_;
    const double t = theta * theta;
    return {theta * (1 + (((k4 * t + k3) * t + k2) * t + k1) * t),
            1 + (((9 * k4 * t + 7 * k3) * t + 5 * k2) * t + 3 * k1) * t};
  }

  Pinhole plane_;
  std::array<double, 4> k_;
  double largest_theta_;
};

/// F. Devernay, O. Faugeras, "Straight lines have to be straight", 2001: an ideal fisheye with
/// radius = atan(2 r tan(omega / 2) / z) / omega. With the angle's quadrant it also holds for z <=
/// 0 (V. Usenko, N. Demmel, D. Cremers, "The double sphere camera model", 3DV 2018). Domain: all
/// points but those of the axis behind the camera.
class FieldOfViewLens {
 public:
  FieldOfViewLens(const Pinhole& plane, double omega)
      : plane_(plane), omega_(omega), stretch_(2 * std::tan(0.5 * omega)) {}

  bool project(const Eigen::Vector3d& p_c, Seen& seen) const {
    const double r = std::sqrt(p_c.x() * p_c.x() + p_c.y() * p_c.y());
    const double wide = stretch_ * r, angle = std::atan2(wide, p_c.z());
    if (!(angle < kPi) || !(p_c.z() != 0 || r > 0)) return false;
    const double by_r = stretch_ / (omega_ * (wide * wide + p_c.z() * p_c.z()));
    place_axially(plane_, p_c, r, {angle / omega_, by_r * p_c.z(), -by_r * r}, seen);
    return true;
  }
  bool unproject(const Eigen::Vector2d& uv, Eigen::Vector3d& ray) const {
    const Eigen::Vector2d m = plane_.to_plane(uv);
    const double radius = m.norm(), angle = radius * omega_;
    if (!(angle < kPi)) return false;
    ray = ray_at(m, radius, std::atan2(std::sin(angle), stretch_ * std::cos(angle)));
    return true;
  }

 private:
  Pinhole plane_;
  double omega_, stretch_;
};

/// Projection from a unit sphere onto a plane, m = (x, y) / (alpha d + (1 - alpha) z) with the
/// distance d: the last step of the two models below. It is one-to-one for z > -w d.
struct SphereToPlane {
  explicit SphereToPlane(double a) : alpha(a), w(a > 0.5 ? (1 - a) / a : a / (1 - a)) {}

  bool contains(double z, double d) const { return d > 0 && z > -w * d; }
  double denominator(double z, double d) const { return alpha * d + (1 - alpha) * z; }
  /// The z of a point on the ray whose x and y are those of m, at the squared radius of m.
  bool depth(double r2, double& z) const {
    const double root = 1 - (2 * alpha - 1) * r2;
    if (!(root > 0)) return false;
    z = (1 - alpha * alpha * r2) / (alpha * std::sqrt(root) + 1 - alpha);
    return true;
  }

  double alpha, w;
};

/// V. Usenko, N. Demmel, D. Cremers, "The double sphere camera model", 3DV 2018. The domain is
/// exact: its condition is taken on the second sphere, as that of the first in the paper excludes
/// some points that the model shows.
class DoubleSphereLens {
 public:
  DoubleSphereLens(const Pinhole& plane, double xi, double alpha)
      : plane_(plane), xi_(xi), second_(alpha) {}

  bool project(const Eigen::Vector3d& p_c, Seen& seen) const {
    const double x = p_c.x(), y = p_c.y(), z = p_c.z();
    const double r2 = x * x + y * y, d1 = std::sqrt(r2 + z * z);
    const double z2 = xi_ * d1 + z, d2 = std::sqrt(r2 + z2 * z2);
    if (!second_.contains(z2, d2)) return false;
    const double n = 1 / second_.denominator(z2, d2), alpha = second_.alpha;
    const Eigen::Vector3d d1_by(x / d1, y / d1, z / d1);
    const Eigen::Vector3d z2_by = xi_ * d1_by + Eigen::Vector3d::UnitZ();
    const Eigen::Vector3d d2_by = (Eigen::Vector3d(x, y, 0) + z2 * z2_by) / d2;
    const Eigen::RowVector3d by = n * n * (alpha * d2_by + (1 - alpha) * z2_by).transpose();
    seen.uv = {plane_.fx * x * n + plane_.cx, plane_.fy * y * n + plane_.cy};
    seen.J << -plane_.fx * x * by, -plane_.fy * y * by;
    seen.J(0, 0) += plane_.fx * n;
    seen.J(1, 1) += plane_.fy * n;
    return true;
  }
  bool unproject(const Eigen::Vector2d& uv, Eigen::Vector3d& ray) const {
    const Eigen::Vector2d m = plane_.to_plane(uv);
    const double r2 = m.squaredNorm();
    double z = 0;
    if (!second_.depth(r2, z)) return false;
    const double root = z * z + (1 - xi_ * xi_) * r2;
    const double scale = (z * xi_ + std::sqrt(root)) / (z * z + r2);
    if (!(scale > 0)) return false;  // |xi| = 1: a ray that leaves the first sphere
    ray = {scale * m.x(), scale * m.y(), scale * z - xi_};
    return true;
  }

 private:
  Pinhole plane_;
  double xi_;
  SphereToPlane second_;
};

/// B. Khomutenko, G. Garcia, P. Martinet, "An enhanced unified camera model", RA-L 2016:
/// d = sqrt(beta (x^2 + y^2) + z^2). Domain: that of SphereToPlane with this d.
class ExtendedUnifiedLens {
 public:
  ExtendedUnifiedLens(const Pinhole& plane, double alpha, double beta)
      : plane_(plane), beta_(beta), sphere_(alpha) {}

  bool project(const Eigen::Vector3d& p_c, Seen& seen) const {
    const double x = p_c.x(), y = p_c.y(), z = p_c.z();
    const double d = std::sqrt(beta_ * (x * x + y * y) + z * z);
    if (!sphere_.contains(z, d)) return false;
    const double n = 1 / sphere_.denominator(z, d), alpha = sphere_.alpha;
    const Eigen::Vector3d d_by(beta_ * x / d, beta_ * y / d, z / d);
    const Eigen::RowVector3d by =
        n * n * (alpha * d_by + (1 - alpha) * Eigen::Vector3d::UnitZ()).transpose();
    seen.uv = {plane_.fx * x * n + plane_.cx, plane_.fy * y * n + plane_.cy};
    seen.J << -plane_.fx * x * by, -plane_.fy * y * by;
    seen.J(0, 0) += plane_.fx * n;
    seen.J(1, 1) += plane_.fy * n;
    return true;
  }
  bool unproject(const Eigen::Vector2d& uv, Eigen::Vector3d& ray) const {
    const Eigen::Vector2d m = plane_.to_plane(uv);
    double z = 0;
    if (!sphere_.depth(beta_ * m.squaredNorm(), z)) return false;
    ray = Eigen::Vector3d(m.x(), m.y(), z).normalized();
    return true;
  }

 private:
  Pinhole plane_;
  double beta_;
  SphereToPlane sphere_;
};

/// C. Mei, P. Rives, "Single view point omnidirectional camera calibration from planar grids", ICRA
/// 2007: m = (x, y) / (z + xi d), then radial-tangential distortion of m. Domain: z > -xi d, for
/// xi > 1 z > -d / xi, and the distortion does not fold over.
class OmnidirectionalLens {
 public:
  OmnidirectionalLens(const Pinhole& plane, double xi, const PlaneDistortion& distortion)
      : plane_(plane), xi_(xi), w_(xi > 1 ? 1 / xi : xi), distortion_(distortion) {}

  bool project(const Eigen::Vector3d& p_c, Seen& seen) const {
    const double d = p_c.norm();
    if (!(d > 0 && p_c.z() > -w_ * d)) return false;
    const double n = 1 / (p_c.z() + xi_ * d);
    const Eigen::Vector2d m = p_c.head<2>() * n;
    Bent bent;
    if (!distortion_.distort(m, bent)) return false;
    const Eigen::RowVector3d by =
        n * (xi_ / d * p_c + Eigen::Vector3d::UnitZ()).transpose();  // d m = (I dx - m by) n
    Eigen::Matrix<double, 2, 3> m_by = -m * by;
    m_by(0, 0) += n;
    m_by(1, 1) += n;
    seen.uv = plane_.to_pixel(bent.at);
    seen.J = bent.J * m_by;
    seen.J.row(0) *= plane_.fx;
    seen.J.row(1) *= plane_.fy;
    return true;
  }
  bool unproject(const Eigen::Vector2d& uv, Eigen::Vector3d& ray) const {
    Eigen::Vector2d m;
    if (!distortion_.undistort(plane_.to_plane(uv), m)) return false;
    const double r2 = m.squaredNorm(), root = 1 + (1 - xi_ * xi_) * r2;
    if (!(root > 0)) return false;
    const double scale = (xi_ + std::sqrt(root)) / (1 + r2);
    ray = {scale * m.x(), scale * m.y(), scale - xi_};
    return true;
  }

 private:
  Pinhole plane_;
  double xi_, w_;
  PlaneDistortion distortion_;
};

}  // namespace orbslam::lens_models

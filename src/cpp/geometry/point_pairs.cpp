// SPDX-License-Identifier: BSD-3-Clause
#include "geometry/point_pairs.hpp"

#include <Eigen/LU>
#include <cmath>
#include <stdexcept>
#include <string>

namespace orbslam {
namespace {

// Deviations far below a pixel's float32 resolution are rounding, not extent.
constexpr double kLeastDeviation = 1e-6;

HomogeneousPoint homogeneous(const Camera& camera, const Eigen::Matrix3d& inverse_K, double u,
                             double v) {
  HomogeneousPoint point;
  point.B = camera.sight(u, v).leftCols<3>() * inverse_K;
  point.h = camera.is_flat() ? Eigen::Vector3d(u, v, 1) : camera.ray(u, v);
  const double scale = point.B.row(2).dot(point.h);
  point.by_pixel = scale * point.B.inverse().leftCols<2>();
  return point;
}

}  // namespace

void PointPairs::resize(std::size_t count) {
  for (Eigen::ArrayXd* column : {&u_1, &v_1, &u_2, &v_2}) {
    column->resize(static_cast<Eigen::Index>(count));
  }
}

PointPairs gather_pairs(const std::vector<Eigen::Vector2f>& initial,
                        const std::vector<Eigen::Vector2f>& current,
                        const std::vector<int>& matches) {
  if (matches.size() != initial.size()) {
    throw std::invalid_argument("matches has " + std::to_string(matches.size()) + " entries for " +
                                std::to_string(initial.size()) +
                                " initial points; give one per point, -1 for none");
  }
  std::size_t count = 0;
  for (const int match : matches) count += match >= 0 ? 1 : 0;
  PointPairs pairs;
  pairs.resize(count);
  Eigen::Index k = 0;
  for (std::size_t i = 0; i < matches.size(); ++i) {
    if (matches[i] < 0) continue;
    const auto j = static_cast<std::size_t>(matches[i]);
    if (j >= current.size()) {
      throw std::invalid_argument("match " + std::to_string(i) + " points to " + std::to_string(j) +
                                  ", but there are " + std::to_string(current.size()) +
                                  " current points");
    }
    pairs.u_1[k] = initial[i].x();
    pairs.v_1[k] = initial[i].y();
    pairs.u_2[k] = current[j].x();
    pairs.v_2[k] = current[j].y();
    ++k;
  }
  return pairs;
}

Eigen::Matrix3d calibration_of(const Camera& camera) {
  return camera.is_flat() ? camera.pinhole().matrix() : Eigen::Matrix3d::Identity();
}

void add_homogeneous_points(const Camera& camera, PointPairs& pairs) {
  pairs.flat = camera.is_flat();
  if (camera.is_pinhole()) return;
  const Eigen::Matrix3d inverse_K = calibration_of(camera).inverse();
  const auto fill = [&](const Eigen::ArrayXd& u, const Eigen::ArrayXd& v, auto& points) {
    points.reserve(pairs.size());
    for (Eigen::Index i = 0; i < u.size(); ++i) {
      points.push_back(homogeneous(camera, inverse_K, u[i], v[i]));
    }
  };
  fill(pairs.u_1, pairs.v_1, pairs.points_1);
  fill(pairs.u_2, pairs.v_2, pairs.points_2);
}

Eigen::Matrix3d Normalization::matrix() const {
  Eigen::Matrix3d T;
  T << scale_u, 0, shift_u, 0, scale_v, shift_v, 0, 0, 1;
  return T;
}

Eigen::Matrix3d Normalization::inverse() const {
  Eigen::Matrix3d T;
  T << 1 / scale_u, 0, -shift_u / scale_u, 0, 1 / scale_v, -shift_v / scale_v, 0, 0, 1;
  return T;
}

bool normalize(const std::vector<Eigen::Vector2f>& points, Normalization& normalization) {
  if (points.empty()) return false;
  const auto count = static_cast<double>(points.size());
  Eigen::Array2d mean = Eigen::Array2d::Zero(), deviation = Eigen::Array2d::Zero();
  for (const auto& point : points) mean += point.cast<double>().array();
  mean /= count;
  for (const auto& point : points) deviation += (point.cast<double>().array() - mean).abs();
  deviation /= count;
  const bool extended = (deviation > kLeastDeviation).all() && deviation.isFinite().all();
  if (!extended) return false;
  normalization = {1 / deviation.x(), 1 / deviation.y(), -mean.x() / deviation.x(),
                   -mean.y() / deviation.y()};
  return true;
}

}  // namespace orbslam

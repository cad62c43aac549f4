// SPDX-License-Identifier: BSD-3-Clause
#include "geometry/motion_check.hpp"

#include <algorithm>
#include <cmath>

#include "geometry/small_solvers.hpp"

namespace orbslam {
namespace {

constexpr double min_parallax_cosine = 0.99998;
constexpr double degrees_per_radian = 57.29577951308232;
constexpr std::size_t parallax_rank = 50;

/// Two poses of one camera; the first is the world.
struct CameraPair {
  explicit CameraPair(const Motion& motion) : R(motion.R), t(motion.t) {
    P.leftCols<3>() = R;
    P.col(3) = t;
    center_2 = -R.transpose() * t;
  }

  /// Linear triangulation of two keypoints, in units of their pixels.
  Eigen::Vector3d triangulate(const Eigen::Matrix3d& sight_1,
                              const Eigen::Matrix3d& sight_2) const {
    Eigen::Matrix4d A = Eigen::Matrix4d::Zero();
    A.topLeftCorner<2, 3>() = sight_1.topRows<2>();
    A.bottomRows<2>() = sight_2.topRows<2>() * P;
    const Eigen::Matrix4d normal = A.transpose() * A;
    const Eigen::Vector4d point = least_eigenvector<4>(normal);
    return point.head<3>() / point.w();
  }

  Eigen::Matrix3d R;
  Eigen::Vector3d t, center_2;
  Eigen::Matrix<double, 3, 4> P;  // of camera 2, normalised
};

/// Of a keypoint compared with a point, sight times point: pixels^2.
double squared_error(const Eigen::Vector3d& compared) {
  return compared.head<2>().squaredNorm() / (compared.z() * compared.z());
}

struct Judgement {
  bool good = false;
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  double parallax_cosine = 0;
};

Judgement judge(const CameraPair& cameras, const Eigen::Matrix3d& sight_1,
                const Eigen::Matrix3d& sight_2, double max_squared_error) {
  Judgement judgement;
  const Eigen::Vector3d p_1 = cameras.triangulate(sight_1, sight_2);
  if (!p_1.allFinite()) return judgement;
  const Eigen::Vector3d ray_2 = p_1 - cameras.center_2;
  const double cosine = p_1.dot(ray_2) / (p_1.norm() * ray_2.norm());
  const bool far = !(cosine < min_parallax_cosine);
  const Eigen::Vector3d in_1 = sight_1 * p_1, in_2 = sight_2 * (cameras.R * p_1 + cameras.t);
  if ((in_1.z() <= 0 || in_2.z() <= 0) && !far) return judgement;
  const bool fits =
      squared_error(in_1) <= max_squared_error && squared_error(in_2) <= max_squared_error;
  if (!fits || !std::isfinite(cosine)) return judgement;
  judgement.good = true;
  judgement.point = p_1;
  judgement.parallax_cosine = cosine;
  return judgement;
}

double parallax_of(std::vector<double>& cosines) {
  if (cosines.empty()) return 0;
  const auto at =
      cosines.begin() + static_cast<std::ptrdiff_t>(std::min(parallax_rank, cosines.size() - 1));
  std::nth_element(cosines.begin(), at, cosines.end());
  return std::acos(std::clamp(*at, -1.0, 1.0)) * degrees_per_radian;
}

}  // namespace

MotionSupport check_motion(const Motion& motion, const PointPairs& pairs,
                           const std::vector<std::uint8_t>& inliers, const Camera& camera,
                           double max_squared_error) {
  const CameraPair cameras(motion);
  MotionSupport support;
  support.points.assign(pairs.size(), Eigen::Vector3d::Zero());
  support.good.assign(pairs.size(), 0);
  support.triangulated.assign(pairs.size(), 0);
  std::vector<double> cosines;
  cosines.reserve(pairs.size());
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    if (!inliers[i]) continue;
    const auto k = static_cast<Eigen::Index>(i);
    const Judgement judgement =
        judge(cameras, camera.sight(pairs.u_1[k], pairs.v_1[k]).leftCols<3>(),
              camera.sight(pairs.u_2[k], pairs.v_2[k]).leftCols<3>(), max_squared_error);
    if (!judgement.good) continue;
    support.points[i] = judgement.point;
    support.good[i] = 1;
    support.triangulated[i] = judgement.parallax_cosine < min_parallax_cosine ? 1 : 0;
    cosines.push_back(judgement.parallax_cosine);
  }
  support.n_good = cosines.size();
  support.parallax = parallax_of(cosines);
  return support;
}

}  // namespace orbslam

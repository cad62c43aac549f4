// SPDX-License-Identifier: BSD-3-Clause
#include "matching/pair_triangulation.hpp"

#include <algorithm>
#include <cmath>

#include "geometry/triangulation.hpp"

namespace orbslam {
namespace {

constexpr double kMonoGate = 5.991;       // chi-square, 95 %, 2 degrees of freedom
constexpr double kStereoGate = 7.8;       // 3 degrees of freedom, rounded as in the original
constexpr double kWidestCosine = 0.9998;  // rays closer than 1.15 degrees do not determine a depth
constexpr double kScaleSlack = 1.5;       // in multiples of the pyramid's factor

}  // namespace

PairTriangulation::PairTriangulation(const Frame& frame_1, const Pose& T_1w, const Frame& frame_2,
                                     const Pose& T_2w)
    : view_1_{&frame_1, T_1w, T_1w.inverse()}, view_2_{&frame_2, T_2w, T_2w.inverse()} {}

Eigen::Vector3d PairTriangulation::View::ray(std::size_t i) const {
  return frame->camera->ray(frame->keypoints[i].x, frame->keypoints[i].y);
}

Pose PairTriangulation::View::from_world(std::size_t i) const {
  if (!frame->camera->is_rig()) return T_cw;
  return Pose::from_unit(T_cw.rotation(),
                         T_cw.translation() - frame->camera->centre(frame->keypoints[i].x));
}

Eigen::Vector3d PairTriangulation::View::centre(std::size_t i) const {
  if (!frame->camera->is_rig()) return T_wc.translation();
  return T_wc * frame->camera->centre(frame->keypoints[i].x);
}

// Cosine of the angle under which the baseline is seen from the measured depth.
double PairTriangulation::View::depth_parallax(std::size_t i, double none) const {
  if (!frame->has_depth(i)) return none;
  const Camera& rig = *frame->camera;
  const Camera& camera =
      rig.is_rig() ? *rig.members()[rig.camera_at(frame->keypoints[i].x)].camera : rig;
  if (camera.has_wide_pair()) {  // of the part of the baseline across the ray
    const Keypoint& keypoint = frame->keypoints[i];
    const double disparity = rig.disparity(keypoint.x, keypoint.y, frame->depth[i]);
    return std::cos(2.0 * std::atan(disparity / camera.pixels_per_radian() / 2.0));
  }
  return std::cos(2.0 * std::atan2(camera.baseline() / 2.0, frame->depth[i]));
}

bool PairTriangulation::View::sees(const Eigen::Vector3d& point, std::size_t i) const {
  const Eigen::Vector3d p_c = T_cw * point;
  const Keypoint& keypoint = frame->keypoints[i];
  Eigen::Vector2d off;
  if (!frame->camera->error(p_c, keypoint.x, keypoint.y, off)) return false;
  double error = off.squaredNorm();
  double gate = kMonoGate;
  if (frame->has_depth(i)) {
    const double error_right =
        frame->camera->right_error(p_c, off, keypoint.x, keypoint.y, frame->right_u[i]);
    error += error_right * error_right;
    gate = kStereoGate;
  }
  return error <= gate * frame->scales->sigma2(keypoint.level);
}

std::optional<Eigen::Vector3d> PairTriangulation::locate(std::size_t i_1, std::size_t i_2) const {
  const Eigen::Vector3d ray_1 = view_1_.ray(i_1), ray_2 = view_2_.ray(i_2);
  const Eigen::Vector3d world_1 = view_1_.T_wc.rotation() * ray_1;
  const Eigen::Vector3d world_2 = view_2_.T_wc.rotation() * ray_2;
  const double parallax = world_1.dot(world_2) / (world_1.norm() * world_2.norm());

  const bool depth_1 = view_1_.frame->has_depth(i_1), depth_2 = view_2_.frame->has_depth(i_2);
  const double none = parallax + 1.0;
  const double parallax_1 = view_1_.depth_parallax(i_1, none);
  const double parallax_2 = view_2_.depth_parallax(i_2, none);

  if (parallax > 0 && parallax < std::min(parallax_1, parallax_2) &&
      (depth_1 || depth_2 || parallax < kWidestCosine)) {
    return triangulate(ray_1, ray_2, view_1_.from_world(i_1), view_2_.from_world(i_2));
  }
  // If both are equally wide, the first is used, so that rounding does not decide.
  if (depth_1 && parallax_1 <= parallax_2) return view_1_.T_wc * view_1_.frame->unproject(i_1);
  if (depth_2 && parallax_2 < parallax_1) return view_2_.T_wc * view_2_.frame->unproject(i_2);
  return std::nullopt;
}

// The nearer camera must see the feature on the coarser level, about as much as it is nearer.
bool PairTriangulation::scales_agree(const Eigen::Vector3d& point, std::size_t i_1,
                                     std::size_t i_2) const {
  const double distance_1 = (point - view_1_.centre(i_1)).norm();
  const double distance_2 = (point - view_2_.centre(i_2)).norm();
  if (!(distance_1 > 0) || !(distance_2 > 0)) return false;
  const ScalePyramid& scales = *view_1_.frame->scales;
  const double by_distance = distance_2 / distance_1;
  const double by_level =
      static_cast<double>(scales.scale(view_1_.frame->keypoints[i_1].level)) /
      static_cast<double>(view_2_.frame->scales->scale(view_2_.frame->keypoints[i_2].level));
  const double slack = kScaleSlack * scales.factor();
  return by_distance * slack >= by_level && by_distance <= by_level * slack;
}

std::optional<Eigen::Vector3d> PairTriangulation::operator()(std::size_t i_1,
                                                             std::size_t i_2) const {
  const std::optional<Eigen::Vector3d> point = locate(i_1, i_2);
  if (!point || !view_1_.sees(*point, i_1) || !view_2_.sees(*point, i_2) ||
      !scales_agree(*point, i_1, i_2)) {
    return std::nullopt;
  }
  return point;
}

}  // namespace orbslam

// SPDX-License-Identifier: BSD-3-Clause
#include "geometry/pnp_ransac.hpp"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "geometry/epnp.hpp"

namespace orbslam {
namespace {

constexpr std::size_t sample_size = 4;

void check(const PnpProblem& problem, const PnpOptions& options) {
  const Eigen::Index n = problem.points.cols();
  if (problem.pixels.cols() != n || problem.sigma2.size() != n) {
    throw std::invalid_argument("points, pixels and sigma2 must have the same length");
  }
  if (!problem.camera) throw std::invalid_argument("the camera is missing");
  check(options.ransac, options.max_chi2, "PnP options");
}

}  // namespace

PnpRansac::PnpRansac(PnpProblem problem, const PnpOptions& options, std::uint64_t seed)
    : problem_(std::move(problem)),
      max_chi2_(options.max_chi2),
      sampler_(static_cast<std::size_t>(problem_.points.cols()), seed) {
  check(problem_, options);
  RansacOptions ransac = options.ransac;
  const auto expected =
      static_cast<std::size_t>(static_cast<double>(sampler_.count()) * ransac.inlier_ratio);
  ransac.min_inliers = std::max({expected, ransac.min_inliers, sample_size});
  min_inliers_ = ransac.min_inliers;
  max_iterations_ = ransac_iterations(sampler_.count(), ransac);
}

PnpPose PnpRansac::judge(const Pose& T_cw) const {
  PnpPose pose;
  pose.T_cw = T_cw;
  pose.inliers.assign(sampler_.count(), 0);
  const Eigen::Matrix3d R = T_cw.rotation_matrix();
  for (std::size_t i = 0; i < pose.inliers.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    const Eigen::Vector3d p_c = R * problem_.points.col(k) + T_cw.translation();
    Eigen::Vector2d error;
    if (!problem_.camera->error(p_c, problem_.pixels(0, k), problem_.pixels(1, k), error)) continue;
    if (!(error.squaredNorm() < max_chi2_ * problem_.sigma2[k])) continue;
    pose.inliers[i] = 1;
    ++pose.n_inliers;
  }
  return pose;
}

std::optional<PnpPose> PnpRansac::pose_of_sample() {
  const auto sample = sampler_.draw<sample_size>();
  Eigen::Matrix<double, 3, sample_size> points;
  Eigen::Matrix<double, 2, sample_size> pixels;
  for (std::size_t i = 0; i < sample_size; ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    points.col(k) = problem_.points.col(sample[i]);
    pixels.col(k) = problem_.pixels.col(sample[i]);
  }
  const auto estimate = solve_epnp(points, pixels, *problem_.camera);
  if (!estimate) return std::nullopt;
  return judge(estimate->T_cw);
}

std::optional<PnpPose> PnpRansac::refine_best() const {
  const auto n = static_cast<Eigen::Index>(best_.n_inliers);
  Eigen::Matrix3Xd points(3, n);
  Eigen::Matrix2Xd pixels(2, n);
  Eigen::Index column = 0;
  for (std::size_t i = 0; i < best_.inliers.size(); ++i) {
    if (!best_.inliers[i]) continue;
    points.col(column) = problem_.points.col(static_cast<Eigen::Index>(i));
    pixels.col(column++) = problem_.pixels.col(static_cast<Eigen::Index>(i));
  }
  const auto estimate = solve_epnp(points, pixels, *problem_.camera);
  if (!estimate) return std::nullopt;
  PnpPose refined = judge(estimate->T_cw);
  refined.refined = true;
  return refined;
}

std::optional<PnpPose> PnpRansac::iterate(int n) {
  if (exhausted()) return std::nullopt;
  for (int k = 0; k < n && !exhausted(); ++k) {
    ++iterations_;
    std::optional<PnpPose> pose = pose_of_sample();
    if (!pose || pose->n_inliers < min_inliers_ || pose->n_inliers <= best_.n_inliers) continue;
    best_ = std::move(*pose);
    std::optional<PnpPose> refined = refine_best();
    if (refined && refined->n_inliers > min_inliers_) return refined;
  }
  if (exhausted() && best_.n_inliers > 0) return best_;
  return std::nullopt;
}

}  // namespace orbslam

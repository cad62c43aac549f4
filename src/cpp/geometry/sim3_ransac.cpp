// SPDX-License-Identifier: BSD-3-Clause
#include "geometry/sim3_ransac.hpp"

#include <algorithm>
#include <stdexcept>

#include "geometry/sim3_horn.hpp"

namespace orbslam {
namespace {

constexpr std::size_t sample_size = 3;

void check(const Sim3Problem& problem, const Sim3Options& options) {
  const Eigen::Index n = problem.points_1.cols();
  if (problem.points_2.cols() != n || problem.sigma2_1.size() != n ||
      problem.sigma2_2.size() != n) {
    throw std::invalid_argument(
        "points_1, points_2, sigma2_1 and sigma2_2 must have the same length");
  }
  if (!problem.camera_1 || !problem.camera_2) throw std::invalid_argument("a camera is missing");
  check(options.ransac, options.max_chi2, "Sim3 options");
}

/// Pixels and gates of a camera's own points.
void project(const Eigen::Matrix3Xd& points, const Camera& camera, const Eigen::VectorXd& sigma2,
             double max_chi2, Eigen::Matrix2Xd& pixels, Eigen::VectorXd& gates) {
  pixels.setZero(2, points.cols());
  gates.setConstant(points.cols(), -1);
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    Eigen::Vector2d pixel;
    if (!camera.project(points.col(i), pixel)) continue;
    pixels.col(i) = pixel;
    gates[i] = max_chi2 * sigma2[i];
  }
}

bool near_pixel(const Eigen::Vector3d& p_c, const Camera& camera, const Eigen::Vector2d& pixel,
                double gate) {
  Eigen::Vector2d error;
  return camera.error(p_c, pixel.x(), pixel.y(), error) && error.squaredNorm() < gate;
}

}  // namespace

Sim3Ransac::Sim3Ransac(const Sim3Problem& problem, const Sim3Options& options, std::uint64_t seed)
    : problem_(problem),
      min_inliers_(std::max(options.ransac.min_inliers, sample_size)),
      fix_scale_(options.fix_scale),
      sampler_(static_cast<std::size_t>(problem.points_1.cols()), seed) {
  check(problem_, options);
  project(problem_.points_1, *problem_.camera_1, problem_.sigma2_1, options.max_chi2, pixels_1_,
          gates_1_);
  project(problem_.points_2, *problem_.camera_2, problem_.sigma2_2, options.max_chi2, pixels_2_,
          gates_2_);
  RansacOptions ransac = options.ransac;
  ransac.min_inliers = min_inliers_;
  max_iterations_ = ransac_iterations(sampler_.count(), ransac);
}

Sim3Estimate Sim3Ransac::judge(const Similarity& S_12) const {
  Sim3Estimate estimate;
  estimate.S_12 = S_12;
  estimate.inliers.assign(sampler_.count(), 0);
  const Eigen::Matrix3d R = S_12.rotation_matrix();
  const Eigen::Matrix3d sR_12 = S_12.scale() * R;
  const Eigen::Matrix3d sR_21 = R.transpose() / S_12.scale();
  for (std::size_t i = 0; i < estimate.inliers.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    const Eigen::Vector3d in_1 = sR_12 * problem_.points_2.col(k) + S_12.translation();
    if (!near_pixel(in_1, *problem_.camera_1, pixels_1_.col(k), gates_1_[k])) continue;
    const Eigen::Vector3d in_2 = sR_21 * (problem_.points_1.col(k) - S_12.translation());
    if (!near_pixel(in_2, *problem_.camera_2, pixels_2_.col(k), gates_2_[k])) continue;
    estimate.inliers[i] = 1;
    ++estimate.n_inliers;
  }
  return estimate;
}

std::optional<Sim3Estimate> Sim3Ransac::iterate(int n) {
  for (int k = 0; k < n && !exhausted(); ++k) {
    ++iterations_;
    const auto sample = sampler_.draw<sample_size>();
    Eigen::Matrix3d points_1, points_2;
    for (std::size_t i = 0; i < sample_size; ++i) {
      points_1.col(static_cast<Eigen::Index>(i)) = problem_.points_1.col(sample[i]);
      points_2.col(static_cast<Eigen::Index>(i)) = problem_.points_2.col(sample[i]);
    }
    const std::optional<Similarity> S_12 = align_similarity(points_1, points_2, fix_scale_);
    if (!S_12) continue;
    Sim3Estimate estimate = judge(*S_12);
    if (estimate.n_inliers > min_inliers_) return estimate;
  }
  return std::nullopt;
}

}  // namespace orbslam

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
  if (!problem_.camera->is_rig()) return;
  by_camera_.resize(problem_.camera->n_cameras());
  for (Eigen::Index i = 0; i < problem_.pixels.cols(); ++i) {
    by_camera_[problem_.camera->camera_at(problem_.pixels(0, i))].push_back(
        static_cast<std::size_t>(i));
  }
  std::size_t most = 0;
  for (const auto& some : by_camera_) {
    samplers_.emplace_back(some.size(), seed + samplers_.size() + 1);
    most = std::max(most, some.size());
  }
  if (most < sample_size) max_iterations_ = 0;
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

std::vector<std::size_t> PnpRansac::draw_of_rig() {
  const Camera& rig = *problem_.camera;
  for (;;) {
    const auto drawn = sampler_.draw<1>();
    const std::size_t camera = rig.camera_at(problem_.pixels(0, drawn[0]));
    if (by_camera_[camera].size() < sample_size) continue;
    std::vector<std::size_t> sample;
    for (const int i : samplers_[camera].draw<sample_size>()) {
      sample.push_back(by_camera_[camera][static_cast<std::size_t>(i)]);
    }
    return sample;
  }
}

std::optional<PnpPose> PnpRansac::pose_of(const std::vector<std::size_t>& chosen) const {
  const Camera& rig = *problem_.camera;
  const auto n = static_cast<Eigen::Index>(chosen.size());
  const std::size_t camera =
      rig.camera_at(problem_.pixels(0, static_cast<Eigen::Index>(chosen[0])));
  const Eigen::Vector2d corner(rig.column_of(camera), 0);
  Eigen::Matrix3Xd points(3, n);
  Eigen::Matrix2Xd pixels(2, n);
  for (Eigen::Index column = 0; column < n; ++column) {
    const auto k = static_cast<Eigen::Index>(chosen[static_cast<std::size_t>(column)]);
    points.col(column) = problem_.points.col(k);
    pixels.col(column) = problem_.pixels.col(k) - corner;
  }
  if (!rig.is_rig()) {
    const auto estimate = solve_epnp(points, pixels, rig);
    return estimate ? std::optional(judge(estimate->T_cw)) : std::nullopt;
  }
  const RigMember& member = rig.members()[camera];
  const auto estimate = solve_epnp(points, pixels, *member.camera);
  return estimate ? std::optional(judge(member.T_bc * estimate->T_cw)) : std::nullopt;
}

std::optional<PnpPose> PnpRansac::pose_of_sample() {
  if (problem_.camera->is_rig()) return pose_of(draw_of_rig());
  std::vector<std::size_t> sample;
  for (const int i : sampler_.draw<sample_size>()) sample.push_back(static_cast<std::size_t>(i));
  return pose_of(sample);
}

std::optional<PnpPose> PnpRansac::refine_best() const {
  // Of a rig those of the camera with most.
  std::vector<std::vector<std::size_t>> inliers(problem_.camera->n_cameras());
  for (std::size_t i = 0; i < best_.inliers.size(); ++i) {
    if (!best_.inliers[i]) continue;
    const double u = problem_.pixels(0, static_cast<Eigen::Index>(i));
    inliers[problem_.camera->camera_at(u)].push_back(i);
  }
  const auto most =
      std::max_element(inliers.begin(), inliers.end(),
                       [](const auto& a, const auto& b) { return a.size() < b.size(); });
  std::optional<PnpPose> refined = pose_of(*most);
  if (refined) refined->refined = true;
  // The pose refined on a part of the inliers may be worse than that of the sample.
  if (problem_.camera->is_rig() && (!refined || refined->n_inliers < best_.n_inliers)) return best_;
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

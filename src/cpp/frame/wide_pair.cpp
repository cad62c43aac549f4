// SPDX-License-Identifier: BSD-3-Clause
#include "frame/wide_pair.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "alignment/align_patch.hpp"
#include "alignment/patch_warp.hpp"
#include "base/errors.hpp"
#include "base/parallel.hpp"
#include "features/level_placement.hpp"

namespace orbslam {
namespace {

constexpr float kNoDepth = -1.0F;
constexpr double kHalfTurn = 3.14159265358979323846;
constexpr int kMostBits = 75;
constexpr int kMostLevelsApart = 1;
/// Pixels of its level by which a keypoint may lie beside the epipolar curve, or behind infinity.
constexpr double kCurveBand = 2;
/// Sine of the angle from the baseline below which planes and parallaxes are of no use.
constexpr double kLeastSine = 0.1;
constexpr double kLeastDisparity = 0.01;  // pixels
/// Least parallax that the affine map of a patch is computed for [rad]: beyond, depth is infinite.
constexpr double kLeastParallax = 1e-4;
/// Half the side of the square of 9 x 9 pixels whose alignment counts [px of their level].
constexpr double kHalfPatch = 4;
/// Cosine of the angle between the axes of two cameras that bend patches alike.
constexpr double kSameDirection = 0.97;
constexpr std::size_t kKeypointsPerTask = 64;  // keypoints per task

double wrapped(double angle) { return std::remainder(angle, 2 * kHalfTurn); }

/// Derivative of the unit ray by the pixel, from the derivative of the pixel by the point.
Eigen::Matrix<double, 3, 2> ray_by_pixel(const Eigen::Matrix<double, 2, 3>& J) {
  return J.transpose() * (J * J.transpose()).inverse();
}

Eigen::Vector2d level_scale(const LevelPlacement& place) {
  return Eigen::Vector2d(place.x.to_image(1) - place.x.to_image(0),
                         place.y.to_image(1) - place.y.to_image(0));
}

std::vector<LevelPlacement> level_places(const ImagePyramid& pyramid, const ScalePyramid& scales) {
  const ImageSize size{pyramid.levels[0].cols, pyramid.levels[0].rows};
  std::vector<LevelPlacement> placements;
  for (int level = 0; level < static_cast<int>(pyramid.levels.size()); ++level) {
    placements.emplace_back(scales, level, size);
  }
  return placements;
}

/// A pixel of the image in pixels of a level.
Eigen::Vector2d in_level(const LevelPlacement& place, const Eigen::Vector2d& pixel) {
  const Eigen::Vector2f uv = pixel.cast<float>();
  return {place.x.to_level(uv.x()), place.y.to_level(uv.y())};
}

}  // namespace

/// A right keypoint by its epipolar plane.
struct WidePair::Candidate {
  double plane, angle;
  double tolerance;  ///< of the plane [rad]
  double behind;     ///< angle by which it may lie behind infinity [rad]
  std::int32_t level;
  std::uint32_t index;
};

/// Both images of one pair, and the right keypoints in the order of their planes.
class WidePair::Search {
 public:
  Search(const WidePair& pair, const Extraction& left, const Extraction& right,
         const ScalePyramid& scales)
      : pair_(pair),
        left_(left),
        right_(right),
        scales_(scales),
        left_places_(level_places(left.pyramid, scales)),
        right_places_(level_places(right.pyramid, scales)) {
    const auto& keypoints = right.features.keypoints;
    for (std::uint32_t i = 0; i < keypoints.size(); ++i) list(i, keypoints[i]);
    std::sort(candidates_.begin(), candidates_.end(), [](const Candidate& a, const Candidate& b) {
      return a.plane != b.plane ? a.plane < b.plane : a.index < b.index;
    });
  }

  /// Depth along the ray of a left keypoint, and its disparity; none without a match.
  std::optional<std::pair<double, double>> depth_of(std::size_t i) const {
    const Keypoint& keypoint = left_.features.keypoints[i];
    const Camera& camera = pair_.left();
    const Eigen::Vector3d ray = camera.ray(keypoint.x, keypoint.y);
    Seen seen;
    if (!ray.allFinite() || !camera.project(ray, seen)) return std::nullopt;
    // Pixels of disparity per inverse metre, as in Camera::disparity().
    const double shift = (seen.J * camera.options().right_centre).norm();
    if (!(shift > Camera::kLeastShift * camera.bf())) return std::nullopt;
    const Direction at = pair_.direction(ray, seen.J, Eigen::Matrix3d::Identity());
    const Candidate* const match = most_similar(keypoint, left_.features.descriptors[i], at);
    if (match == nullptr) return std::nullopt;
    const auto angle = refined_angle(keypoint, seen.J, ray, at, *match);
    if (!angle) return std::nullopt;
    const double depth = pair_.baseline_ * std::sin(*angle) / std::sin(*angle - at.angle);
    if (!(depth > 0)) return std::nullopt;
    const double disparity = std::max(shift / depth, kLeastDisparity);
    return std::pair(shift / disparity, disparity);
  }

 private:
  void list(std::uint32_t index, const Keypoint& keypoint) {
    const auto at = right_direction({keypoint.x, keypoint.y});
    if (!at || at->sine < kLeastSine) return;
    const double pixels = kCurveBand * static_cast<double>(scales_.scale(keypoint.level));
    Candidate candidate{at->plane,          at->angle,      pixels / (at->across * at->sine),
                        pixels / at->along, keypoint.level, index};
    widest_ = std::max(widest_, candidate.tolerance);
    candidates_.push_back(candidate);
    // Planes are a circle: those near its seam are listed on both sides.
    candidate.plane += candidate.plane < 0 ? 2 * kHalfTurn : -2 * kHalfTurn;
    if (std::abs(candidate.plane) < 1.5 * kHalfTurn) candidates_.push_back(candidate);
  }

  std::optional<Direction> right_direction(const Eigen::Vector2d& pixel) const {
    Eigen::Vector3d ray;
    Seen seen;
    if (!pair_.right_.unproject(pixel, ray) || !pair_.right_.project(ray, seen)) {
      return std::nullopt;
    }
    return pair_.direction(pair_.R_rl_.transpose() * ray, seen.J, pair_.R_rl_);
  }

  /// The right keypoint with the most similar descriptor near the curve; the lowest index of equal
  /// ones.
  const Candidate* most_similar(const Keypoint& keypoint, const Descriptor& descriptor,
                                const Direction& at) const {
    const auto first = std::lower_bound(
        candidates_.begin(), candidates_.end(), at.plane - widest_,
        [](const Candidate& candidate, double plane) { return candidate.plane < plane; });
    int best_distance = kMostBits;
    const Candidate* best = nullptr;
    for (auto c = first; c != candidates_.end() && c->plane <= at.plane + widest_; ++c) {
      if (std::abs(c->level - keypoint.level) > kMostLevelsApart) continue;
      if (std::abs(c->plane - at.plane) > c->tolerance) continue;
      const double parallax = c->angle - at.angle;
      // Not nearer than one baseline.
      if (parallax < -c->behind || std::sin(parallax) > std::sin(c->angle)) continue;
      const int distance = hamming_distance(descriptor, right_.features.descriptors[c->index]);
      const bool better = distance < best_distance ||
                          (best != nullptr && distance == best_distance && c->index < best->index);
      if (!better) continue;
      best_distance = distance;
      best = &*c;
    }
    return best;
  }

  /// Angle from the baseline at which the right camera sees the left patch.
  std::optional<double> refined_angle(const Keypoint& keypoint,
                                      const Eigen::Matrix<double, 2, 3>& J_left,
                                      const Eigen::Vector3d& ray, const Direction& at,
                                      const Candidate& match) const {
    const auto from = static_cast<std::size_t>(keypoint.level);
    ReferencePatch patch;
    const Eigen::Vector2d left_pixel(keypoint.x, keypoint.y);
    if (!cut_patch(left_.pyramid.levels[from], in_level(left_places_[from], left_pixel), patch)) {
      return std::nullopt;
    }
    const double parallax = std::max(match.angle - at.angle, kLeastParallax);
    const double depth = pair_.baseline_ * std::sin(match.angle) / std::sin(parallax);
    Seen seen;
    if (!pair_.right_.project(pair_.T_rl_ * (depth * ray), seen)) return std::nullopt;
    // The patch is a piece of a sphere around the left camera.
    const Eigen::Matrix2d warp = seen.J * pair_.R_rl_ * (depth * ray_by_pixel(J_left));
    const auto to =
        static_cast<std::size_t>(std::min<int>(warped_level(scales_, keypoint.level, warp),
                                               static_cast<int>(right_.pyramid.levels.size()) - 1));
    const Eigen::Matrix2d A = level_scale(right_places_[to]).cwiseInverse().asDiagonal() * warp *
                              level_scale(left_places_[from]).asDiagonal();
    const Keypoint& right = right_.features.keypoints[match.index];
    const PatchAlignment aligned = align_patch(patch, A, right_.pyramid.levels[to],
                                               in_level(right_places_[to], {right.x, right.y}));
    if (!aligned.ok()) return std::nullopt;
    Eigen::Vector2d pixel(right_places_[to].x.to_image(static_cast<float>(aligned.position.x())),
                          right_places_[to].y.to_image(static_cast<float>(aligned.position.y())));
    pixel -= bend_of_patch(left_pixel, level_scale(left_places_[from]), depth, seen.uv, warp);
    const auto found = right_direction(pixel);
    if (!found) return std::nullopt;
    const double beside = std::abs(wrapped(found->plane - at.plane)) * found->sine * found->across;
    if (beside > kCurveBand * static_cast<double>(scales_.scale(static_cast<int>(to)))) {
      return std::nullopt;
    }
    return found->angle;
  }

  /// Mean deviation [px, right image] of the right patch from its affine map. It is caused by the
  /// lenses, and by different viewing directions of the cameras.
  Eigen::Vector2d bend_of_patch(const Eigen::Vector2d& left_pixel, const Eigen::Vector2d& scale,
                                double depth, const Eigen::Vector2d& right_pixel,
                                const Eigen::Matrix2d& warp) const {
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    if (pair_.R_rl_(2, 2) > kSameDirection) return sum;
    // Of a quadratic function over a square of side 2 h, four points at h sqrt(2/3) give the mean.
    const double aside = kHalfPatch * std::sqrt(2.0 / 3.0);
    for (const Eigen::Vector2d& side : {Eigen::Vector2d(aside, 0), Eigen::Vector2d(-aside, 0),
                                        Eigen::Vector2d(0, aside), Eigen::Vector2d(0, -aside)}) {
      const Eigen::Vector2d offset = side.cwiseProduct(scale);
      const Eigen::Vector2d at = left_pixel + offset;
      const Eigen::Vector3d point = depth * pair_.left_->ray(at.x(), at.y());
      Seen seen;
      if (!point.allFinite() || !pair_.right_.project(pair_.T_rl_ * point, seen)) return {0, 0};
      sum += seen.uv - right_pixel - warp * offset;
    }
    return sum / 4;
  }

  const WidePair& pair_;
  const Extraction &left_, &right_;
  const ScalePyramid& scales_;
  std::vector<LevelPlacement> left_places_, right_places_;
  std::vector<Candidate> candidates_;
  double widest_ = 0;
};

WidePair::WidePair(std::shared_ptr<const Camera> left, CameraModel right, const Pose& T_right_left)
    : left_(std::move(left)),
      right_(std::move(right)),
      T_rl_(T_right_left),
      R_rl_(T_right_left.rotation_matrix()),
      baseline_(T_right_left.center().norm()) {
  const Eigen::Vector3d centre = T_right_left.center();
  const double apart = (centre - left_->options().right_centre).norm();
  if (!left_->has_wide_pair() || !(apart <= 1e-6 * baseline_)) {
    throw SettingsError("the left camera of a fisheye pair must know the centre of the right one");
  }
  const Eigen::Vector3d along = centre / baseline_;
  // The seam of the circle of planes lies behind the cameras.
  Eigen::Vector3d forward = Eigen::Vector3d::UnitZ() - along.z() * along;
  if (forward.norm() < 1e-3) forward = along.unitOrthogonal();
  forward.normalize();
  axes_ << along.transpose(), forward.transpose(), along.cross(forward).transpose();
}

WidePair::Direction WidePair::direction(const Eigen::Vector3d& ray_in_left,
                                        const Eigen::Matrix<double, 2, 3>& J,
                                        const Eigen::Matrix3d& R_camera_left) const {
  const Eigen::Vector3d a = axes_ * ray_in_left;
  const double sine = std::hypot(a.y(), a.z());
  const double plane = std::atan2(a.z(), a.y());
  const Eigen::Vector3d outwards = std::cos(plane) * axes_.row(1) + std::sin(plane) * axes_.row(2);
  const Eigen::Vector3d across = axes_.row(0).transpose().cross(outwards);
  // Derivative of the ray by its angle.
  const Eigen::Vector3d along = a.x() * outwards - sine * axes_.row(0).transpose();
  return {plane, std::atan2(sine, a.x()), sine, (J * (R_camera_left * across)).norm(),
          (J * (R_camera_left * along)).norm()};
}

double WidePair::distance(const Eigen::Vector3d& left_ray, const Eigen::Vector3d& right_ray) const {
  const Eigen::Vector3d l = axes_ * left_ray, r = axes_ * (R_rl_.transpose() * right_ray);
  const double left = std::atan2(std::hypot(l.y(), l.z()), l.x());
  const double right = std::atan2(std::hypot(r.y(), r.z()), r.x());
  return baseline_ * std::sin(right) / std::sin(right - left);
}

StereoMatches WidePair::match(const Extraction& left, const Extraction& right,
                              const ScalePyramid& scales) const {
  check_extraction(left, scales, "left");
  check_extraction(right, scales, "right");
  const std::size_t n = left.features.size();
  StereoMatches matches{std::vector<float>(n, kNoDepth), std::vector<float>(n, kNoDepth)};
  const Search search(*this, left, right, scales);
  for_each_in_parallel(
      (n + kKeypointsPerTask - 1) / kKeypointsPerTask, threads_for(2), [&](std::size_t chunk) {
        for (std::size_t i = chunk * kKeypointsPerTask;
             i < std::min(n, (chunk + 1) * kKeypointsPerTask); ++i) {
          const auto found = search.depth_of(i);
          if (!found) continue;
          matches.depth[i] = static_cast<float>(found->first);
          matches.right_u[i] = left.features.keypoints[i].x - static_cast<float>(found->second);
        }
      });
  return matches;
}

}  // namespace orbslam

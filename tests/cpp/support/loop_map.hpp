// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "map/map.hpp"
#include "support/synthetic_frames.hpp"

/// A map as it is after a loop was corrected, without images. Header only; link orbslam_map.
namespace orbslam::testing {

struct LoopMapOptions {
  int n_keyframes = 100;
  int points_per_keyframe = 75;  ///< seen first by each keyframe; some are not kept
  double mean_track = 7;         ///< keyframes that observe a point in one visit, on average
  double overlap = 0.06;         ///< part of the keyframes that see the beginning again
  /// Observations with a measured depth: all of points nearer than this [m]. 0: a single camera.
  double depth_limit = 8;
  double pixel_noise = 0.7;  ///< standard deviation at level 0 [pixels]
  double outliers = 0;       ///< part of the observations that are off by up to 10 sigma
  double turn_drift = 5e-4;  ///< of the poses per keyframe before the loop was closed [rad]
  double move_drift = 4e-3;  ///< [m]
  double pose_noise = 2e-4;  ///< of each pose beside that: [m], half of it in [rad]
  std::uint64_t seed = 1;
};

/// A camera drives once around a ring, looking ahead, and sees its beginning again. Points are
/// tracked over some keyframes; those of the beginning also by the last keyframes. Poses have
/// drifted, and the error found at the end was spread evenly over all of them, as an essential
/// graph does; points lie where the observations of the first lap put them.
class LoopMap {
 public:
  Map map;
  std::vector<Pose> truth;                ///< T_cw by keyframe id
  std::vector<Eigen::Vector3d> position;  ///< true ones by point id

  explicit LoopMap(const LoopMapOptions& options) : options_(options), random_(options.seed) {
    n_ = static_cast<std::size_t>(options.n_keyframes);
    n_lap_ = n_ - static_cast<std::size_t>(options.overlap * options.n_keyframes);
    for (std::size_t k = 0; k < n_; ++k) truth.push_back(on_ring(k));
    features_.resize(n_);
    wrong_.resize(n_);
    seen_.resize(n_);
    for (std::size_t k = 0; k < n_lap_; ++k) make_points(k);
    disturb();
    fill_map();
  }

  /// Root mean square of the distances of the keyframes from where they were [m].
  double pose_error() const {
    double sum = 0, count = 0;
    map.for_each_keyframe([&](const KeyFrame& keyframe) {
      const auto k = static_cast<std::size_t>(keyframe.id.value);
      if (k >= truth.size()) return;
      sum += (keyframe.center() - truth[k].center()).squaredNorm();
      ++count;
    });
    return std::sqrt(sum / count);
  }

  /// Median distance of the points from where they are [m].
  double point_error() const {
    std::vector<double> errors;
    map.for_each_point([&](const MapPoint& point) {
      const auto i = static_cast<std::size_t>(point.id.value);
      if (i < position.size()) errors.push_back((point.position - position[i]).norm());
    });
    std::nth_element(errors.begin(),
                     errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2), errors.end());
    return errors[errors.size() / 2];
  }

  double normal() {
    const double r = std::sqrt(-2 * std::log(1 - uniform(random_)));
    return r * std::cos(6.283185307179586 * uniform(random_));
  }

 private:
  static constexpr double kStep = 0.5;  // metres between keyframes

  Pose on_ring(std::size_t k) const {
    const double turn = 6.283185307179586 * static_cast<double>(k) / static_cast<double>(n_lap_);
    const double radius = kStep * static_cast<double>(n_lap_) / 6.283185307179586;
    // x to the right (outwards), y down, z ahead; a little beside the first lap in the second.
    const double off = k < n_lap_ ? 0.0 : 0.1;
    const Eigen::Matrix3d R_wc =
        Eigen::AngleAxisd(-turn, Eigen::Vector3d::UnitY()).toRotationMatrix();
    const Eigen::Vector3d center(-radius + (radius + off) * std::cos(turn), 0,
                                 (radius + off) * std::sin(turn));
    return Pose(R_wc, center).inverse();
  }

  void make_points(std::size_t k) {
    const auto& camera = *camera_;
    for (int i = 0; i < options_.points_per_keyframe; ++i) {
      const double z = uniform(random_, 4, 16);
      const Eigen::Vector3d p_c =
          camera.pinhole().unproject(uniform(random_, 60, 580), uniform(random_, 40, 440), z);
      const Eigen::Vector3d p_w = truth[k].inverse() * p_c;
      const std::size_t point = position.size();
      const double p_end = 1 / options_.mean_track;
      std::vector<std::size_t> observers;
      for (std::size_t j = k; j < n_ && j < k + 30; ++j) {
        if (j > k + 1 && uniform(random_) < p_end) break;
        observers.push_back(j);
      }
      for (std::size_t j = k + n_lap_; j < n_ && j < k + n_lap_ + 10; ++j) {
        if (uniform(random_) < 0.6) observers.push_back(j);
      }
      std::vector<std::size_t> visible;
      for (const std::size_t j : observers) {
        const Eigen::Vector3d p = truth[j] * p_w;
        if (p.z() > 1 && camera.bounds().contains_half_open(camera.pinhole().project(p).x(),
                                                            camera.pinhole().project(p).y())) {
          visible.push_back(j);
        }
      }
      if (visible.size() < 2 || !is_mapped(p_w, visible)) continue;
      position.push_back(p_w);
      creator_.push_back(visible.front());
      observations_.emplace_back();
      for (const std::size_t j : visible) observe(j, point, truth[j] * p_w);
    }
  }

  /// Mapping keeps a point that has a depth or that is seen under different directions.
  bool is_mapped(const Eigen::Vector3d& p_w, const std::vector<std::size_t>& observers) const {
    const Eigen::Vector3d first = (p_w - truth[observers.front()].center()).normalized();
    for (const std::size_t j : observers) {
      if ((truth[j] * p_w).z() < options_.depth_limit) return true;
      if (first.dot((p_w - truth[j].center()).normalized()) < 0.9998) return true;
    }
    return false;
  }

  void observe(std::size_t k, std::size_t point, const Eigen::Vector3d& p_c) {
    FeatureSpec feature;
    feature.level = std::clamp(static_cast<int>(std::lround(std::log(16 / p_c.z()) / 0.182)), 0, 7);
    const double sigma =
        options_.pixel_noise * static_cast<double>(synthetic_scales()->scale(feature.level));
    const bool wrong = uniform(random_) < options_.outliers;
    const double off = wrong ? 10 * sigma : 0;
    const Eigen::Vector2d uv = camera_->pinhole().project(p_c);
    feature.u = static_cast<float>(uv.x() + sigma * normal() + uniform(random_, -off, off));
    feature.v = static_cast<float>(uv.y() + sigma * normal() + uniform(random_, -off, off));
    if (p_c.z() < options_.depth_limit) {
      const double disparity = camera_->bf() / p_c.z() + sigma * normal();
      if (disparity > 0.5) feature.depth = static_cast<float>(camera_->bf() / disparity);
    }
    feature.descriptor = random_descriptor(random_);
    features_[k].push_back(feature);
    wrong_[k].push_back(wrong);
    observations_[point].emplace_back(k, seen_[k].size());
    seen_[k].push_back(point);
  }

  Vector6d noise(double move, double turn) {
    Vector6d xi;
    for (int i = 0; i < 6; ++i) xi(i) = (i < 3 ? turn : move) * normal();
    return xi;
  }

  void disturb() {
    start_.push_back(truth[0]);
    for (std::size_t k = 1; k < n_; ++k) {
      const Pose step = truth[k] * truth[k - 1].inverse();
      start_.push_back(Pose::exp(noise(options_.move_drift, options_.turn_drift)) * step *
                       start_[k - 1]);
    }
    // The last keyframe is where it was seen to be; what that takes is spread over the others.
    const Vector6d gap = (start_.back().inverse() * truth.back()).log();
    for (std::size_t k = 1; k < n_; ++k) {
      const double part = static_cast<double>(k) / static_cast<double>(n_ - 1);
      start_[k] = Pose::exp(noise(options_.pose_noise, options_.pose_noise / 2)) * start_[k] *
                  Pose::exp(part * gap);
    }
  }

  /// Where the observations of the first visit put the point, given the poses: Gauss-Newton steps
  /// from the right place before its creator, lightly damped.
  Eigen::Vector3d triangulated(std::size_t point) const {
    const Pinhole& k = camera_->pinhole();
    const Eigen::Vector3d start =
        start_[creator_[point]].inverse() * (truth[creator_[point]] * position[point]);
    Eigen::Vector3d x = start;
    for (int step = 0; step < 5; ++step) {
      Eigen::Matrix3d H = 1e-2 * Eigen::Matrix3d::Identity();
      Eigen::Vector3d g = 1e-2 * (start - x);
      for (const auto& [keyframe, slot] : observations_[point]) {
        if (keyframe > creator_[point] + 30 || wrong_[keyframe][slot]) continue;
        const FeatureSpec& feature = features_[keyframe][slot];
        const Eigen::Vector3d p = start_[keyframe] * x;
        const Eigen::Matrix3d R = start_[keyframe].rotation_matrix();
        const double weight =
            1 / static_cast<double>(synthetic_scales()->scale(feature.level)) / p.z();
        Eigen::Matrix3d J = Eigen::Matrix3d::Zero();
        J.row(0) << k.fx, 0, -k.fx * p.x() / p.z();
        J.row(1) << 0, k.fy, -k.fy * p.y() / p.z();
        const Eigen::Vector2d uv = k.project(p);
        Eigen::Vector3d e(feature.u - uv.x(), feature.v - uv.y(), 0);
        if (feature.depth > 0) {
          J.row(2) << 0, 0, camera_->bf() / p.z();
          e.z() = -camera_->bf() / feature.depth + camera_->bf() / p.z();
        }
        J = weight * J * R;
        H += J.transpose() * J;
        g += weight * p.z() * J.transpose() * e;
      }
      x += H.ldlt().solve(g);
    }
    // Where rays are nearly parallel the steps may have run away.
    const Pose& before = start_[creator_[point]];
    const double ratio = (before * x).z() / (before * start).z();
    return ratio > 0.5 && ratio < 2 ? x : start;
  }

  void fill_map() {
    for (std::size_t k = 0; k < n_; ++k) {
      const auto frame = make_synthetic_frame(static_cast<FrameId>(k), features_[k], camera_);
      map.add_keyframe(frame, start_[k]);
    }
    for (std::size_t i = 0; i < position.size(); ++i) {
      map.add_point(triangulated(i), KeyFrameId(static_cast<std::int64_t>(creator_[i])), 0);
    }
    for (std::size_t k = 0; k < n_; ++k) {
      const KeyFrameId id(static_cast<std::int64_t>(k));
      for (std::size_t i = 0; i < seen_[k].size(); ++i) {
        map.add_observation(MapPointId(static_cast<std::int64_t>(seen_[k][i])), id, i);
      }
      map.publish(id);
      map.mark_processed(id);
    }
    for (std::size_t k = 0; k < n_; ++k) {
      map.update_connections(KeyFrameId(static_cast<std::int64_t>(k)));
    }
    for (const MapPointId id : map.point_ids()) map.update_point(id);
  }

  LoopMapOptions options_;
  std::mt19937_64 random_;
  std::shared_ptr<const Camera> camera_ =
      synthetic_camera(options_.depth_limit > 0 ? 200 : 0);  // a baseline of 0.5 m
  std::size_t n_ = 0, n_lap_ = 0;  // keyframes; those of the first time around
  std::vector<std::vector<FeatureSpec>> features_;
  std::vector<std::vector<bool>> wrong_;        // per feature
  std::vector<std::vector<std::size_t>> seen_;  // per keyframe: the points of its features
  std::vector<std::size_t> creator_;            // per point
  std::vector<std::vector<std::pair<std::size_t, std::size_t>>> observations_;  // keyframe, slot
  std::vector<Pose> start_;
};

}  // namespace orbslam::testing

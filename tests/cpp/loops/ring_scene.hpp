// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "loops/loop.hpp"
#include "map/invariants.hpp"
#include "map/map.hpp"
#include "support/synthetic_frames.hpp"

namespace orbslam::testing {

struct RingOptions {
  bool monocular = false;
  int per_lap = 60;            ///< keyframes of a lap
  int extra = 6;               ///< keyframes that follow after it
  int points_per_step = 80;    ///< physical points
  double radius = 2;           ///< of the camera's path [m]; walls are 4 to 7 m farther out
  double half_view = 120;      ///< keypoints lie in columns up to this far from the middle [pixels]
  double turn_drift = 4e-4;    ///< between keyframes, about the vertical [rad]
  double log_scale_drift = 0;  ///< for a single camera
  int second_map_from = -1;    ///< the keyframe that begins another map; -1: there is one map only
  Similarity S_21;             ///< world of the first map to that of the second
  int flipped_bits = 0;        ///< of each descriptor
  std::uint64_t seed = 1;
};

/// A camera goes around a room once and a bit more, looking outwards at the walls. Between
/// keyframes the poses drift evenly; each point is where the keyframe that made it puts it. What
/// was seen at the beginning is not recognised at the end: it is in the map twice.
class RingScene {
 public:
  Map map;
  RingOptions options;
  std::vector<Pose> truth;            ///< T_cw in the real world, per keyframe
  std::vector<Similarity> drifted;    ///< world of the map to the camera in metres, per keyframe
  std::vector<std::size_t> physical;  ///< per map point: what it shows
  Loop loop;

  explicit RingScene(const RingOptions& given = {}) : options(given) {
    make_walls();
    const int n = options.per_lap + options.extra;
    Vector7d drift;
    drift << 0, options.turn_drift, 0, 0, 0, 0, options.log_scale_drift;
    const Similarity step = Similarity::exp(drift);
    for (int k = 0; k < n; ++k) {
      truth.push_back(pose_at(k));
      drifted.push_back(k == 0
                            ? Similarity(truth[0])
                            : step * Similarity(truth.back() * truth[truth.size() - 2].inverse()) *
                                  drifted.back());
      if (k == options.second_map_from) drifted.back() = drifted.back() * options.S_21.inverse();
    }
    instances_.resize(2 * walls_.positions.size());
    first_seen_.assign(walls_.positions.size(), -1);
    for (int k = 0; k < n; ++k) add_keyframe(k);
    for (int k = 0; k < n; ++k) map.update_connections(KeyFrameId(k));
    make_loop();
  }

  KeyFrameId current() const { return loop.current; }
  KeyFrameId matched() const { return loop.matched; }

  /// The frame that keyframe k (of any number) would be made of; its points' numbers follow.
  std::shared_ptr<Frame> make_frame(int k, std::vector<std::size_t>& seen) const {
    std::vector<FeatureSpec> features;
    std::mt19937_64 random(static_cast<std::uint64_t>(k));
    const Pose T_cw = pose_at(k);
    const auto camera = synthetic_camera(options.monocular ? 0 : 40);
    for (const std::size_t i : near(k)) {
      const Eigen::Vector3d p = T_cw * walls_.positions[i];
      if (!(p.z() > 0.5)) continue;
      const Eigen::Vector2d uv = camera->pinhole().project(p);
      if (std::abs(uv.x() - 320) > options.half_view) continue;
      if (!camera->bounds().contains_half_open(uv.x(), uv.y())) continue;
      FeatureSpec feature;
      feature.u = static_cast<float>(uv.x());
      feature.v = static_cast<float>(uv.y());
      feature.depth = options.monocular ? -1.0F : static_cast<float>(p.z());
      feature.level =
          std::clamp(static_cast<int>(std::lround(std::log(9 / p.norm()) / std::log(1.2))), 0, 7);
      feature.descriptor = flip_bits(walls_.descriptors[i], options.flipped_bits, random);
      features.push_back(feature);
      seen.push_back(i);
    }
    return make_synthetic_frame(k, features, camera);
  }

  /// Where a keyframe belongs in the corrected map, which is anchored at `matched`.
  Pose expected(std::size_t k) const {
    const auto m = static_cast<std::size_t>(loop.matched.value);
    return (Similarity(truth[k] * truth[m].inverse()) * drifted[m]).pose();
  }
  /// Largest and mean distance of the keyframes from where they belong.
  std::pair<double, double> pose_errors() const {
    double largest = 0, sum = 0;
    for (std::size_t k = 0; k < truth.size(); ++k) {
      const double error = (map.T_cw(id(k)).center() - expected(k).center()).norm();
      largest = std::max(largest, error);
      sum += error;
    }
    return {largest, sum / static_cast<double>(truth.size())};
  }
  /// Largest distance of a point's projection from a keypoint that shows it [pixels].
  double largest_reprojection_error() const {
    double largest = 0;
    map.for_each_point([&](const MapPoint& point) {
      for (const Observation& seen : point.observations) {
        const KeyFrame& keyframe = *map.find(seen.keyframe);
        const Eigen::Vector3d p = keyframe.T_cw * point.position;
        const Keypoint& keypoint = keyframe.frame->keypoints[seen.index];
        const Eigen::Vector2d uv = keyframe.frame->camera->pinhole().project(p);
        largest = std::max(largest, std::hypot(uv.x() - keypoint.x, uv.y() - keypoint.y));
        if (p.z() <= 0) largest = 1e9;
      }
    });
    return largest;
  }
  /// Things that `current` sees and that are in the map twice.
  int n_doubles() const {
    int doubles = 0;
    for (const MapPointId seen : map.find(current())->map_points) {
      if (!seen.valid()) continue;
      const std::size_t thing = physical[static_cast<std::size_t>(seen.value)];
      doubles += map.find(first_instance(thing)) && map.find(second_instance(thing)) ? 1 : 0;
    }
    return doubles;
  }
  /// The point of the first visit that shows the same, or an invalid id.
  MapPointId first_instance(std::size_t thing) const { return instances_[2 * thing]; }
  MapPointId second_instance(std::size_t thing) const { return instances_[2 * thing + 1]; }

  std::string violations() const {
    std::string text;
    for (const std::string& violation : check_invariants(map, false)) text += violation + "\n";
    return text;
  }
  static KeyFrameId id(std::size_t k) { return KeyFrameId(static_cast<std::int64_t>(k)); }

 private:
  static constexpr double kTwoPi = 6.283185307179586;

  Pose pose_at(int k) const {
    const double angle = kTwoPi * k / options.per_lap;
    // y points down, z outwards.
    const Eigen::Matrix3d R_wc =
        Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitY()).toRotationMatrix();
    return Pose(R_wc, options.radius * R_wc.col(2)).inverse();
  }

  void make_walls() {
    std::mt19937_64 random(options.seed);
    const int n = options.per_lap * options.points_per_step;
    for (int i = 0; i < n; ++i) {  // by ascending angles
      const double angle = kTwoPi * (i + uniform(random)) / n;
      const double distance = options.radius + uniform(random, 4, 7);
      walls_.positions.emplace_back(distance * std::sin(angle), uniform(random, -2, 2),
                                    distance * std::cos(angle));
      walls_.descriptors.push_back(random_descriptor(random));
    }
  }

  /// Numbers of the points that can be in view of keyframe k, ascending.
  std::vector<std::size_t> near(int k) const {
    const auto n = static_cast<std::int64_t>(walls_.positions.size());
    const double half_window = std::atan(0.8 * 7 / (options.radius + 7));
    const auto half = static_cast<std::int64_t>(half_window / kTwoPi * static_cast<double>(n)) + 1;
    const std::int64_t middle = static_cast<std::int64_t>(k) * options.points_per_step;
    std::vector<std::size_t> numbers;
    for (std::int64_t i = middle - half; i <= middle + half; ++i) {
      numbers.push_back(static_cast<std::size_t>(((i % n) + n) % n));
    }
    std::sort(numbers.begin(), numbers.end());
    numbers.erase(std::unique(numbers.begin(), numbers.end()), numbers.end());
    return numbers;
  }

  void add_keyframe(int k) {
    std::vector<std::size_t> seen;
    const auto frame = make_frame(k, seen);
    if (k == options.second_map_from) map.begin_map();
    const bool later = options.second_map_from >= 0 && k >= options.second_map_from;
    const auto at = static_cast<std::size_t>(k);
    const KeyFrameId keyframe = map.add_keyframe(frame, drifted[at].pose());
    for (std::size_t i = 0; i < seen.size(); ++i) {
      int& first = first_seen_[seen[i]];
      if (first < 0) first = k;
      const bool again = later || k - first > options.per_lap / 2;
      MapPointId& instance = instances_[2 * seen[i] + (again ? 1 : 0)];
      if (!instance.valid()) {
        instance = map.add_point(drifted[at].inverse() * (truth[at] * walls_.positions[seen[i]]),
                                 keyframe, k);
        physical.push_back(seen[i]);
      }
      map.add_observation(instance, keyframe, i);
      map.update_point(instance);
    }
    map.update_connections(keyframe);
    map.publish(keyframe);
    map.mark_processed(keyframe);
  }

  void make_loop() {
    const std::size_t c = truth.size() - 1, m = c - static_cast<std::size_t>(options.per_lap);
    loop.current = id(c);
    loop.matched = id(m);
    const Similarity to_units_of_current(1 / drifted[c].scale(), Eigen::Quaterniond::Identity(),
                                         Eigen::Vector3d::Zero());
    loop.S_cw = to_units_of_current * Similarity(truth[c] * truth[m].inverse()) * drifted[m];
    loop.S_cm = loop.S_cw * Similarity(map.T_cw(loop.matched)).inverse();
    const KeyFrame& current = *map.find(loop.current);
    for (const MapPointId seen : current.map_points) {
      const auto thing = physical[static_cast<std::size_t>(seen.value)];
      const MapPoint* far = map.find(first_instance(thing));
      const bool known = far && far->id != seen && far->observation_of(loop.matched);
      loop.matches.push_back(known ? far->id : MapPointId());
      loop.n_matches += known ? 1 : 0;
    }
    std::vector<KeyFrameId> around = map.find(loop.matched)->neighbours;
    around.push_back(loop.matched);
    for (const KeyFrameId keyframe : around) {
      for (const MapPointId point : map.find(keyframe)->map_points) {
        if (point.valid()) loop.loop_points.push_back(point);
      }
    }
    std::sort(loop.loop_points.begin(), loop.loop_points.end());
    loop.loop_points.erase(std::unique(loop.loop_points.begin(), loop.loop_points.end()),
                           loop.loop_points.end());
  }

  PointCloud walls_;
  std::vector<MapPointId> instances_;  // of each thing: first and second visit
  std::vector<int> first_seen_;
};

}  // namespace orbslam::testing

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gtest/gtest.h>

#include <algorithm>

#include "map/culling.hpp"
#include "map/keyframe_insertion.hpp"
#include "map/local_map.hpp"
#include "map_builder.hpp"

namespace orbslam::testing {

/// Performs random changes of a map and remembers what is needed to check them.
class RandomOperations {
 public:
  explicit RandomOperations(std::uint64_t seed) : random_(seed) {}

  const Map& map() const { return map_; }
  int n_performed(std::size_t operation) const { return performed_[operation]; }
  static constexpr std::size_t kOperations = 14;

  void perform() {
    const std::size_t operation = map_.n_keyframes() < 3 ? 0 : uniform_index(random_, kOperations);
    ++performed_[operation];
    switch (operation) {
      case 0:
        return insert();
      case 1:
        return process();
      case 2:
        return add_point();
      case 3:
        return add_observation();
      case 4:
        return map_.erase_observation(any_point(), any_keyframe());
      case 5:
        return chance(4) ? map_.erase_point(any_point()) : map_.update_point(any_point());
      case 6:
        return replace();
      case 7:
        return map_.update_connections(any_keyframe());
      case 8:
        return chance(3) ? erase_keyframe() : move();
      case 9:
        return lease();
      case 10:
        return chance(20) ? loop_edge() : reparent();
      case 11: {
        cull_recent_points(map_, any_keyframe(), 2, recent_);
        return;
      }
      case 12: {
        if (chance(4)) cull_keyframes(map_, any_keyframe(), chance(2));
        return;
      }
      default:
        return track();
    }
  }

 private:
  static constexpr std::size_t kSlots = 30;

  bool chance(std::size_t n) { return uniform_index(random_, n) == 0; }
  KeyFrameId any_keyframe() {
    const auto ids = map_.keyframe_ids();
    return ids[uniform_index(random_, ids.size())];
  }
  /// Sometimes a dead one.
  MapPointId any_point() {
    return MapPointId(static_cast<std::int64_t>(uniform_index(random_, n_ever_ + 1)));
  }
  void seen(MapPointId id) {
    if (id.valid()) n_ever_ = std::max(n_ever_, static_cast<std::size_t>(id.value));
  }

  TrackedFrame frame() {
    std::vector<FeatureSpec> features(kSlots);
    for (std::size_t i = 0; i < kSlots; ++i) {
      features[i].u = static_cast<float>(uniform(random_, 0, 640));
      features[i].v = static_cast<float>(uniform(random_, 0, 480));
      features[i].level = static_cast<std::int32_t>(uniform_index(random_, 8));
      features[i].descriptor = thermometer_descriptor(static_cast<int>(uniform_index(random_, 99)));
      if (chance(2)) features[i].depth = static_cast<float>(uniform(random_, 1, 8));
    }
    TrackedFrame tracked(make_synthetic_frame(n_frames_++, features));
    tracked.T_cw = Pose(Eigen::Quaterniond::Identity(),
                        Eigen::Vector3d(uniform(random_), uniform(random_), uniform(random_)));
    if (map_.n_points() == 0) return tracked;
    for (std::size_t i = 0; i < kSlots; ++i) {
      if (chance(3)) continue;
      // Dead, replaced and repeated points as well.
      tracked.associate(i, any_point(), Eigen::Vector3d::Zero());
    }
    return tracked;
  }

  void insert() {
    TrackedFrame tracked = frame();
    waiting_.push_back(insert_keyframe(map_, tracked, !chance(3), uniform_index(random_, 12)));
    for (const MapPointId id : tracked.map_points) seen(id);
    if (map_.n_keyframes() < 3) process();
  }
  void process() {
    if (waiting_.empty()) return;
    const KeyFrameId id = waiting_.front();
    waiting_.erase(waiting_.begin());
    if (map_.find(id)) process_new_keyframe(map_, id, recent_);
  }
  void add_point() {
    const KeyFrameId id = any_keyframe();
    const std::size_t slot = uniform_index(random_, kSlots);
    if (map_.find(map_.find(id)->map_points[slot])) return;
    const Eigen::Vector3d position(uniform(random_), uniform(random_), 4);
    const MapPointId added = map_.add_point(position, id, 0);
    map_.add_observation(added, id, slot);
    map_.update_point(added);
    seen(added);
  }
  void add_observation() {
    const MapPointId id = any_point();
    if (map_.find(id)) map_.add_observation(id, any_keyframe(), uniform_index(random_, kSlots));
  }
  void replace() {
    const MapPointId id = any_point(), by = any_point();
    const MapPointId end = map_.resolve(by);
    const bool happens = map_.find(id) && end.valid() && end != id;
    map_.replace_point(id, by);
    EXPECT_TRUE(!happens || map_.resolve(id) == end);
  }
  void erase_keyframe() {
    const KeyFrameId id = any_keyframe();
    const Pose pose = map_.T_cw(id);
    const bool died = map_.erase_keyframe(id);
    EXPECT_EQ(map_.find(id) == nullptr, died);
    EXPECT_TRUE(map_.T_cw(id).matrix().isApprox(pose.matrix(), 1e-9));
  }
  void move() {
    Vector6d xi;
    for (int i = 0; i < 6; ++i) xi[i] = uniform(random_, -1, 1);
    map_.set_pose(any_keyframe(), Pose::exp(xi));
  }
  void lease() {
    if (leased_.empty() || chance(2)) {
      leased_.push_back(any_keyframe());
      map_.begin_lease(leased_.back());
    } else {
      map_.end_lease(leased_.back());
      leased_.pop_back();
    }
  }
  void loop_edge() {
    const KeyFrameId a = any_keyframe(), b = any_keyframe();
    if (a != b) map_.add_loop_edge(a, b);
  }
  void reparent() {
    const KeyFrameId child = any_keyframe(), parent = any_keyframe();
    try {
      map_.set_parent(child, parent);
      EXPECT_EQ(map_.find(child)->parent, parent);
    } catch (const std::exception&) {  // a cycle: refused, and nothing may have changed
    }
  }
  void track() {
    TrackedFrame tracked = frame();
    const LocalMap local = select_local_map(map_, tracked);
    for (const MapPointId id : tracked.map_points) {
      if (!id.valid()) continue;
      EXPECT_TRUE(map_.find(id));
      EXPECT_EQ(std::count(local.points.ids.begin(), local.points.ids.end(), id), 1);
    }
    for (const KeyFrameId id : local.keyframes) EXPECT_TRUE(map_.find(id));
  }

  std::mt19937_64 random_;
  Map map_;
  std::vector<KeyFrameId> waiting_, leased_;
  std::vector<MapPointId> recent_;
  std::size_t n_ever_ = 0;
  FrameId n_frames_ = 0;
  std::array<int, kOperations> performed_{};
};

}  // namespace orbslam::testing

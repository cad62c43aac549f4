// SPDX-License-Identifier: BSD-3-Clause
#include "map/content_hash.hpp"

#include <cstring>

#include "base/mix.hpp"

namespace orbslam {
namespace {

/// Words are mixed in, in order.
class Hash {
 public:
  void add(std::uint64_t word) { state_ = mix(state_ + word); }
  void add(std::int64_t value) { add(static_cast<std::uint64_t>(value)); }
  void add(double value) {
    std::uint64_t bits;
    std::memcpy(&bits, &value, sizeof(bits));
    add(bits);
  }
  void add(const Eigen::Vector3d& v) {
    for (const double x : {v.x(), v.y(), v.z()}) add(x);
  }
  std::uint64_t value() const { return state_; }

 private:
  std::uint64_t state_ = 0;
};

}  // namespace

std::uint64_t content_hash(const Map& map) {
  Hash hash;
  MapIndex first = kNoMap;
  const auto lock = map.read_lock();
  map.for_each_keyframe([&](const KeyFrame& keyframe) {
    hash.add(keyframe.id.value);
    hash.add(keyframe.parent.value);
    // A single map has the same hash for any number.
    if (first == kNoMap) first = keyframe.map;
    if (keyframe.map != first) hash.add(keyframe.map - first);
    const Eigen::Quaterniond& q = keyframe.T_cw.rotation();
    for (const double x : {q.w(), q.x(), q.y(), q.z()}) hash.add(x);
    hash.add(keyframe.T_cw.translation());
  });
  map.for_each_point([&](const MapPoint& point) {
    hash.add(point.id.value);
    hash.add(point.position);
    for (const std::uint64_t word : point.descriptor.words) hash.add(word);
    hash.add(static_cast<std::uint64_t>(point.observations.size()));
    for (const Observation& observation : point.observations) {
      hash.add(observation.keyframe.value);
      hash.add(static_cast<std::uint64_t>(observation.index));
    }
  });
  return hash.value();
}

}  // namespace orbslam

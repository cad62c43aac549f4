// SPDX-License-Identifier: BSD-3-Clause
#include "map/local_map.hpp"

#include <algorithm>

#include "map/anchor.hpp"
#include "map/keyframe_tally.hpp"

namespace orbslam {
namespace {

/// The extension stops once the list has more keyframes than this.
constexpr std::size_t kMaxKeyFrames = 80;
/// How many of a keyframe's neighbours may be tried.
constexpr std::size_t kTriedNeighbours = 10;

}  // namespace

void refresh_associations(const Map& map, TrackedFrame& frame) {
  for (std::size_t i = 0; i < frame.map_points.size(); ++i) {
    const MapPointId id = frame.map_points[i];
    if (!id.valid() || is_temporary(id)) continue;
    const MapPoint* point = map.find(id);
    if (!point) {
      const MapPointId successor = map.resolve(id);
      // Two keypoints may have held the two halves of a merged point: one of them keeps it.
      const bool taken = successor.valid() &&
                         std::find(frame.map_points.begin(), frame.map_points.end(), successor) !=
                             frame.map_points.end();
      point = taken ? nullptr : map.find(successor);
    }
    if (!point) {
      frame.dissociate(i);
      continue;
    }
    frame.map_points[i] = point->id;  // the outlier flag stays: it is about the keypoint's match
    frame.positions[i] = point->position;
  }
}

namespace {

/// A set of ids as one bit each: small enough to stay in the cache for any local map. Its owner
/// keeps the bits, all zero; when the set goes, also by an exception, they are zero again.
template <class IdType>
class IdBits {
 public:
  explicit IdBits(std::vector<std::uint64_t>& words) : words_(words) {}
  ~IdBits() {
    for (const std::size_t word : used_) words_[word] = 0;
  }
  IdBits(const IdBits&) = delete;
  IdBits& operator=(const IdBits&) = delete;

  /// False when the id was there already.
  bool insert(IdType id) {
    const auto word = static_cast<std::size_t>(id.value) / 64;
    const std::uint64_t mask = std::uint64_t{1} << (id.value % 64);
    if (word >= words_.size()) words_.resize(word + 1 + word / 4, 0);
    if (words_[word] & mask) return false;
    if (words_[word] == 0) used_.push_back(word);
    words_[word] |= mask;
    return true;
  }
  bool contains(IdType id) const {
    const auto word = static_cast<std::size_t>(id.value) / 64;
    return word < words_.size() && (words_[word] >> (id.value % 64) & 1) != 0;
  }

 private:
  std::vector<std::uint64_t>& words_;
  std::vector<std::size_t> used_;
};

/// Number of the frame's points that each keyframe observes; ascending ids.
std::vector<std::pair<KeyFrameId, int>> count_votes(const Map& map, const TrackedFrame& frame) {
  thread_local std::vector<int> counters;
  KeyFrameTally votes(counters);
  for (const MapPointId id : frame.map_points) {
    const MapPoint* point = map.find(id);
    if (!point) continue;
    for (const Observation& observation : point->observations) votes.add(observation.keyframe);
  }
  std::vector<std::pair<KeyFrameId, int>> result;
  for (const KeyFrameId id : votes.counted()) result.emplace_back(id, votes.of(id));
  std::sort(result.begin(), result.end());
  return result;
}

/// Adds for each voted keyframe at most one neighbour, one child and the parent.
void extend(const Map& map, std::vector<KeyFrameId>& keyframes) {
  thread_local std::vector<std::uint64_t> bits;
  IdBits<KeyFrameId> listed(bits);
  for (const KeyFrameId id : keyframes) listed.insert(id);
  const auto add = [&](KeyFrameId id) {
    if (!map.find(id) || !listed.insert(id)) return false;
    keyframes.push_back(id);
    return true;
  };
  const std::size_t n_voted = keyframes.size();
  for (std::size_t k = 0; k < n_voted && keyframes.size() <= kMaxKeyFrames; ++k) {
    const KeyFrame& voted = *map.find(keyframes[k]);
    const std::size_t n_tried = std::min(kTriedNeighbours, voted.neighbours.size());
    for (std::size_t i = 0; i < n_tried && !add(voted.neighbours[i]); ++i) {
    }
    for (auto child = voted.children.begin(); child != voted.children.end() && !add(*child);
         ++child) {
    }
    add(voted.parent);
  }
}

void collect_points(const Map& map, const std::vector<KeyFrameId>& keyframes, PointBatch& points) {
  thread_local std::vector<std::uint64_t> bits;
  thread_local std::vector<const MapPoint*> found;
  IdBits<MapPointId> collected(bits);
  found.clear();
  for (const KeyFrameId id : keyframes) {
    for (const MapPointId point_id : map.find(id)->map_points) {
      if (!point_id.valid() || collected.contains(point_id)) continue;
      const MapPoint* point = map.find(point_id);
      if (!point) continue;
      collected.insert(point_id);
      found.push_back(point);
    }
  }
  points.reserve(found.size());
  for (const MapPoint* point : found) points.push_back(*point);
}

}  // namespace

LocalMap select_local_map(const Map& map, TrackedFrame& frame) {
  LocalMap local;
  const auto lock = map.read_lock();
  // The map has moved since the pose was predicted. From here on the pose is in the present map.
  if (frame.anchor.big_change != map.big_change_index()) move_with_anchor(map, frame);
  refresh_associations(map, frame);
  int most = 0;
  for (const auto& [keyframe, votes] : count_votes(map, frame)) {
    local.keyframes.push_back(keyframe);
    if (votes <= most) continue;
    most = votes;
    local.reference_keyframe = keyframe;
  }
  extend(map, local.keyframes);
  collect_points(map, local.keyframes, local.points);
  if (local.reference_keyframe.valid()) frame.anchor = anchor_at(map, local.reference_keyframe);
  return local;
}

}  // namespace orbslam

// SPDX-License-Identifier: BSD-3-Clause
#include "places/place_recognition.hpp"

#include <algorithm>

#include "places/vocabulary.hpp"

namespace orbslam {
namespace {

/// nullptr when the keyframe is dead.
std::shared_ptr<const Frame> frame_of(const Map& map, KeyFrameId id) {
  const auto lock = map.read_lock();
  const KeyFrame* keyframe = map.find(id);
  return keyframe == nullptr ? nullptr : keyframe->frame;
}

std::vector<PlaceCandidate> query_living(const KeyFrameIndex& index, const Map& map,
                                         const WordVector& words, const PlaceQuery& query) {
  auto candidates = index.query(words, query, [&map](KeyFrameId id) {
    const auto lock = map.read_lock();
    return map.best_neighbours(id, KeyFrameIndex::kGroupNeighbours);
  });
  const auto lock = map.read_lock();
  const auto is_dead = [&map](const PlaceCandidate& candidate) {
    return map.find(candidate.keyframe) == nullptr;
  };
  candidates.erase(std::remove_if(candidates.begin(), candidates.end(), is_dead), candidates.end());
  return candidates;
}

}  // namespace

void index_keyframe(KeyFrameIndex& index, const Map& map, KeyFrameId id) {
  std::shared_ptr<const Frame> frame = frame_of(map, id);
  if (frame == nullptr) return;
  index.add(id, std::move(frame));
  // The keyframe may have died between the two steps above, when it was not in the index yet.
  if (frame_of(map, id) == nullptr) index.erase(id);
}

double lowest_neighbour_score(const Map& map, KeyFrameId id) {
  std::shared_ptr<const Frame> frame;
  std::vector<std::shared_ptr<const Frame>> others;
  {
    const auto lock = map.read_lock();
    const KeyFrame* keyframe = map.find(id);
    if (keyframe == nullptr) return 1.0;
    frame = keyframe->frame;
    for (const KeyFrameId neighbour : keyframe->neighbours) {
      const KeyFrame* other = map.find(neighbour);
      if (other != nullptr) others.push_back(other->frame);
    }
  }
  double lowest = 1.0;
  for (const auto& other : others) {
    lowest = std::min(lowest, similarity(frame->words, other->words));
  }
  return lowest;
}

std::vector<PlaceCandidate> find_loop_candidates(const KeyFrameIndex& index, const Map& map,
                                                 KeyFrameId id, double min_score) {
  std::shared_ptr<const Frame> frame;
  PlaceQuery query{{id}, min_score};
  {
    const auto lock = map.read_lock();
    const KeyFrame* keyframe = map.find(id);
    if (keyframe == nullptr) return {};
    frame = keyframe->frame;
    for (const auto& [neighbour, weight] : keyframe->weights) query.excluded.push_back(neighbour);
  }
  return query_living(index, map, frame->words, query);
}

std::vector<PlaceCandidate> find_relocalization_candidates(const KeyFrameIndex& index,
                                                           const Map& map, const Frame& frame) {
  return query_living(index, map, frame.words, {});
}

}  // namespace orbslam

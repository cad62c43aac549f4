// SPDX-License-Identifier: BSD-3-Clause
#include "places/keyframe_index.hpp"

#include <algorithm>

#include "base/errors.hpp"
#include "places/vocabulary.hpp"

namespace orbslam {

struct KeyFrameIndex::Scored {
  KeyFrameId id;
  std::shared_ptr<const Frame> frame;
  int common_words = 0;
  double score = 0;
};

void KeyFrameIndex::add(KeyFrameId id, std::shared_ptr<const Frame> frame) {
  if (!frame->described) {
    throw StateError("keyframe " + std::to_string(id.value) +
                     " has no words; describe its frame before adding it");
  }
  const std::lock_guard lock(mutex_);
  if (slot_of_.count(id) > 0) return;
  if (free_slots_.empty()) {
    free_slots_.push_back(static_cast<std::uint32_t>(slots_.size()));
    slots_.emplace_back();
  }
  const std::uint32_t slot = free_slots_.back();
  free_slots_.pop_back();
  for (const std::uint32_t word : frame->words.words) slots_with_word_[word].push_back(slot);
  slots_[slot] = {id, std::move(frame)};
  slot_of_[id] = slot;
}

void KeyFrameIndex::erase(KeyFrameId id) {
  const std::lock_guard lock(mutex_);
  const auto found = slot_of_.find(id);
  if (found == slot_of_.end()) return;
  const std::uint32_t slot = found->second;
  for (const std::uint32_t word : slots_[slot].frame->words.words) {
    const auto list = slots_with_word_.find(word);
    auto& slots = list->second;
    // The order inside a list has no meaning.
    *std::find(slots.begin(), slots.end(), slot) = slots.back();
    slots.pop_back();
    if (slots.empty()) slots_with_word_.erase(list);
  }
  slots_[slot] = {};
  free_slots_.push_back(slot);
  slot_of_.erase(found);
}

void KeyFrameIndex::clear() {
  const std::lock_guard lock(mutex_);
  slots_.clear();
  free_slots_.clear();
  slot_of_.clear();
  slots_with_word_.clear();
}

std::size_t KeyFrameIndex::size() const {
  const std::lock_guard lock(mutex_);
  return slot_of_.size();
}

bool KeyFrameIndex::contains(KeyFrameId id) const {
  const std::lock_guard lock(mutex_);
  return slot_of_.count(id) > 0;
}

/// Those that share enough words with the query, by ascending id, not scored yet.
std::vector<KeyFrameIndex::Scored> KeyFrameIndex::share_words(
    const WordVector& words, const std::vector<KeyFrameId>& excluded) const {
  const std::lock_guard lock(mutex_);
  std::vector<int> counts(slots_.size(), 0);
  for (const std::uint32_t word : words.words) {
    const auto list = slots_with_word_.find(word);
    if (list == slots_with_word_.end()) continue;
    for (const std::uint32_t slot : list->second) ++counts[slot];
  }
  for (const KeyFrameId id : excluded) {
    const auto found = slot_of_.find(id);
    if (found != slot_of_.end()) counts[found->second] = 0;
  }
  const auto most = std::max_element(counts.begin(), counts.end());
  if (most == counts.end() || *most == 0) return {};
  const int min_common = static_cast<int>(kCommonWordShare * static_cast<float>(*most));
  std::vector<Scored> kept;
  for (std::size_t slot = 0; slot < counts.size(); ++slot) {
    if (counts[slot] > min_common) {
      kept.push_back({slots_[slot].id, slots_[slot].frame, counts[slot], 0});
    }
  }
  std::sort(kept.begin(), kept.end(), [](const Scored& a, const Scored& b) { return a.id < b.id; });
  return kept;
}

std::vector<PlaceCandidate> KeyFrameIndex::query(const WordVector& words, const PlaceQuery& query,
                                                 const NeighbourLookup& neighbours) const {
  std::vector<Scored> kept = share_words(words, query.excluded);
  for (Scored& scored : kept) scored.score = similarity(words, scored.frame->words);
  const auto find = [&kept](KeyFrameId id) -> const Scored* {
    const auto place = std::lower_bound(kept.begin(), kept.end(), id,
                                        [](const Scored& s, KeyFrameId i) { return s.id < i; });
    return place != kept.end() && place->id == id ? &*place : nullptr;
  };

  std::vector<PlaceCandidate> groups;
  double best_group = query.min_score;
  for (const Scored& first : kept) {
    if (first.score < query.min_score) continue;
    const Scored* best = &first;
    double group_score = first.score;
    std::size_t n_neighbours = 0;
    for (const KeyFrameId id : neighbours(first.id)) {
      if (n_neighbours++ == kGroupNeighbours) break;
      const Scored* neighbour = find(id);
      if (neighbour == nullptr) continue;
      group_score += neighbour->score;
      if (neighbour->score > best->score) best = neighbour;
    }
    groups.push_back({best->id, best->common_words, best->score, group_score});
    best_group = std::max(best_group, group_score);
  }

  // Of several groups with the same best keyframe the one with the highest score counts.
  std::sort(groups.begin(), groups.end(), [](const PlaceCandidate& a, const PlaceCandidate& b) {
    return a.keyframe != b.keyframe ? a.keyframe < b.keyframe : a.group_score > b.group_score;
  });
  std::vector<PlaceCandidate> result;
  for (const PlaceCandidate& group : groups) {
    const bool known = !result.empty() && result.back().keyframe == group.keyframe;
    if (!known && group.group_score > kGroupShare * best_group) result.push_back(group);
  }
  return result;
}

}  // namespace orbslam

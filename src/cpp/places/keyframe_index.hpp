// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <unordered_map>
#include <vector>

#include "base/ids.hpp"
#include "frame/frame.hpp"

namespace orbslam {

/// A keyframe that may show the same place as the query.
struct PlaceCandidate {
  KeyFrameId keyframe;
  int common_words = 0;
  double score = 0;        ///< L1 score with the query, 0 to 1
  double group_score = 0;  ///< sum of the scores of the group it was the best of
};

struct PlaceQuery {
  std::vector<KeyFrameId> excluded;  ///< never found, never counted
  double min_score = 0;              ///< a group needs a first member with at least this score
};

/// The best covisible keyframes of one, best first; empty when it is dead.
using NeighbourLookup = std::function<std::vector<KeyFrameId>(KeyFrameId)>;

/// Inverted file: which keyframes contain a word. Its lock protects the lists only; queries score
/// without it and keep their counters to themselves, so that several can run at the same time. See
/// docs/method/words.md#index-of-keyframes.
class KeyFrameIndex {
 public:
  static constexpr float kCommonWordShare = 0.8F;  ///< of the largest number of common words
  static constexpr double kGroupShare = 0.75;      ///< of the best group score
  static constexpr std::size_t kGroupNeighbours = 10;

  /// The frame must be described. Adding a keyframe again does nothing.
  void add(KeyFrameId id, std::shared_ptr<const Frame> frame);
  /// Does nothing when the keyframe is not there.
  void erase(KeyFrameId id);
  void clear();
  std::size_t size() const;
  bool contains(KeyFrameId id) const;

  /// Keyframes that look like the query. Those that share more than kCommonWordShare of the largest
  /// number of common words are scored. Each that reaches query.min_score makes a group with those
  /// of its kGroupNeighbours best neighbours that were scored too. Groups whose scores add up to
  /// more than kGroupShare of the best group's are good: the best keyframe of each, each once, by
  /// ascending id. `neighbours` is called without the index's lock.
  std::vector<PlaceCandidate> query(const WordVector& words, const PlaceQuery& query,
                                    const NeighbourLookup& neighbours) const;

 private:
  struct Entry {
    KeyFrameId id;  ///< invalid: the slot is free
    std::shared_ptr<const Frame> frame;
  };
  struct Scored;
  std::vector<Scored> share_words(const WordVector& words,
                                  const std::vector<KeyFrameId>& excluded) const;

  mutable std::mutex mutex_;
  std::vector<Entry> slots_;
  std::vector<std::uint32_t> free_slots_;
  std::unordered_map<KeyFrameId, std::uint32_t> slot_of_;
  std::unordered_map<std::uint32_t, std::vector<std::uint32_t>> slots_with_word_;
};

}  // namespace orbslam

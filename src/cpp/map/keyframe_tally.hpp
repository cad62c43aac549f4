// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

#include "base/ids.hpp"

namespace orbslam {

/// Counts by keyframe. The counters are an array over ids that its owner keeps, all zero, so that
/// each count costs one access; when the tally goes, also by an exception, those that were counted
/// are zero again.
class KeyFrameTally {
 public:
  explicit KeyFrameTally(std::vector<int>& counters) : counters_(counters) {}
  ~KeyFrameTally() {
    for (const KeyFrameId id : counted_) counters_[index(id)] = 0;
  }
  KeyFrameTally(const KeyFrameTally&) = delete;
  KeyFrameTally& operator=(const KeyFrameTally&) = delete;

  void add(KeyFrameId id) {
    const std::size_t i = index(id);
    if (i >= counters_.size()) counters_.resize(i + 1 + i / 4, 0);
    if (counters_[i] == 0) counted_.push_back(id);  // first: nothing is counted that it misses
    ++counters_[i];
  }
  int of(KeyFrameId id) const {
    const std::size_t i = index(id);
    return i < counters_.size() ? counters_[i] : 0;
  }
  /// Each once, in the order of their first count.
  const std::vector<KeyFrameId>& counted() const { return counted_; }

 private:
  static std::size_t index(KeyFrameId id) { return static_cast<std::size_t>(id.value); }

  std::vector<int>& counters_;
  std::vector<KeyFrameId> counted_;
};

}  // namespace orbslam

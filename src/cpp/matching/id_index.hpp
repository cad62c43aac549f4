// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/ids.hpp"

namespace orbslam {

/// A small hash table from map point id to a number, for look-ups in loops over thousands of
/// points. It uses open addressing in one flat buffer, which is reused without allocation. It is
/// never iterated, so its inner order cannot influence results
/// (docs/method/threads.md#deterministic-mode).
class PointIdIndex {
 public:
  static constexpr std::int32_t kNone = -1;

  /// Forgets everything and makes room for `n` ids; more make the table grow.
  void reset(std::size_t n) {
    shift_ = 64 - 4;
    while (capacity() < 2 * n) --shift_;
    slots_.assign(capacity(), Slot{});
    size_ = 0;
  }

  /// The first number given for an id stays. Returns whether the id was new. The id must be valid.
  bool insert(MapPointId id, std::int32_t number) {
    Slot* slot = &slots_[position_of(id)];
    if (slot->id == id.value) return false;
    if (2 * (size_ + 1) > capacity()) {
      grow();
      slot = &slots_[position_of(id)];
    }
    *slot = {id.value, number};
    ++size_;
    return true;
  }

  std::int32_t find(MapPointId id) const {
    if (!id.valid()) return kNone;
    const Slot& slot = slots_[position_of(id)];
    return slot.id == id.value ? slot.number : kNone;
  }

 private:
  struct Slot {
    std::int64_t id = -1;
    std::int32_t number = kNone;
  };

  std::size_t capacity() const { return std::size_t{1} << (64 - shift_); }

  void grow() {
    std::vector<Slot> old(2 * capacity());
    old.swap(slots_);
    --shift_;
    for (const Slot& slot : old) {
      if (slot.id >= 0) slots_[position_of(MapPointId(slot.id))] = slot;
    }
  }

  // Multiplication by 2^64 / golden ratio spreads consecutive ids over the table.
  std::size_t position_of(MapPointId id) const {
    const std::size_t mask = slots_.size() - 1;
    auto position = static_cast<std::size_t>(
        (static_cast<std::uint64_t>(id.value) * 0x9E3779B97F4A7C15ULL) >> shift_);
    while (slots_[position].id >= 0 && slots_[position].id != id.value) {
      position = (position + 1) & mask;
    }
    return position;
  }

  int shift_ = 60;
  std::size_t size_ = 0;
  std::vector<Slot> slots_ = std::vector<Slot>(16);
};

}  // namespace orbslam

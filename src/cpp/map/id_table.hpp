// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <memory>
#include <utility>
#include <vector>

#include "base/ids.hpp"

namespace orbslam {

/// Objects owned by ascending id: O(1) look-up, iteration in id order, and pages that are freed
/// once all their objects have died, so that memory follows the number of live objects. See
/// docs/method/map.md#replaced-and-dead-points.
template <class IdType, class Object>
class IdTable {
 public:
  static constexpr std::size_t kPageSize = 256;

  Object* find(IdType id) { return const_cast<Object*>(std::as_const(*this).find(id)); }
  const Object* find(IdType id) const {
    if (!id.valid()) return nullptr;
    const auto page = static_cast<std::size_t>(id.value) / kPageSize;
    if (page >= pages_.size() || !pages_[page]) return nullptr;
    return pages_[page]->slots[static_cast<std::size_t>(id.value) % kPageSize].get();
  }

  /// The id must not be in use.
  Object& insert(IdType id, std::unique_ptr<Object> object) {
    const auto page = static_cast<std::size_t>(id.value) / kPageSize;
    if (page >= pages_.size()) pages_.resize(page + 1);
    if (!pages_[page]) pages_[page] = std::make_unique<Page>();
    auto& slot = pages_[page]->slots[static_cast<std::size_t>(id.value) % kPageSize];
    slot = std::move(object);
    ++pages_[page]->used;
    ++size_;
    return *slot;
  }

  void erase(IdType id) {
    if (!find(id)) return;
    auto& page = pages_[static_cast<std::size_t>(id.value) / kPageSize];
    page->slots[static_cast<std::size_t>(id.value) % kPageSize].reset();
    --size_;
    if (--page->used == 0) page.reset();
  }

  void clear() {
    pages_.clear();
    size_ = 0;
  }

  std::size_t size() const { return size_; }

  /// Calls visit(object) for every live object in ascending id order. The visitor must not insert.
  template <class Visitor>
  void for_each(Visitor&& visit) const {
    for (const auto& page : pages_) {
      if (!page) continue;
      for (const auto& slot : page->slots) {
        if (slot) visit(static_cast<const Object&>(*slot));
      }
    }
  }

 private:
  struct Page {
    std::array<std::unique_ptr<Object>, kPageSize> slots;
    std::size_t used = 0;
  };
  std::vector<std::unique_ptr<Page>> pages_;
  std::size_t size_ = 0;
};

}  // namespace orbslam

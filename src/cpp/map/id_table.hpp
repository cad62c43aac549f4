// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "base/ids.hpp"

namespace orbslam {

/// Objects owned by ascending id: O(1) look-up, iteration in id order, and pages that are freed
/// once all their objects have died, so that memory follows the number of live objects. See
/// docs/method/map.md#replaced-and-dead-points.
///
/// Every change has a number, its stamp. The table stores the last stamp of each object, its death
/// included, and of each page. Changes are therefore found without a visit to unchanged objects.
/// See docs/method/map.md#changes.
template <class IdType, class Object>
class IdTable {
 public:
  static constexpr std::size_t kPageSize = 256;

  Object* find(IdType id) { return const_cast<Object*>(std::as_const(*this).find(id)); }
  const Object* find(IdType id) const {
    if (!id.valid()) return nullptr;
    const auto page = static_cast<std::size_t>(id.value) / kPageSize;
    if (page >= pages_.size() || !pages_[page].objects) return nullptr;
    return pages_[page].objects->slots[static_cast<std::size_t>(id.value) % kPageSize].get();
  }

  /// The id must not be in use.
  Object& insert(IdType id, std::unique_ptr<Object> object) {
    const auto page = static_cast<std::size_t>(id.value) / kPageSize;
    if (page >= pages_.size()) pages_.resize(page + 1);
    if (!pages_[page].objects) {
      pages_[page].objects = std::make_unique<Objects>();
      // Earlier objects of this place died with the page at the latest.
      pages_[page].objects->stamps.fill(pages_[page].stamp);
    }
    auto& slot = pages_[page].objects->slots[static_cast<std::size_t>(id.value) % kPageSize];
    slot = std::move(object);
    ++pages_[page].objects->used;
    ++size_;
    touch(id);
    return *slot;
  }

  /// Notes that the object has changed; it must live.
  void touch(IdType id) {
    Page& page = pages_[static_cast<std::size_t>(id.value) / kPageSize];
    page.stamp = ++stamp_;
    page.objects->stamps[static_cast<std::size_t>(id.value) % kPageSize] = page.stamp;
  }

  void erase(IdType id) {
    if (!find(id)) return;
    touch(id);
    auto& objects = pages_[static_cast<std::size_t>(id.value) / kPageSize].objects;
    objects->slots[static_cast<std::size_t>(id.value) % kPageSize].reset();
    --size_;
    if (--objects->used == 0) objects.reset();
  }

  /// Stamps go on growing.
  void clear() {
    pages_.clear();
    size_ = 0;
    ++stamp_;
  }

  std::size_t size() const { return size_; }

  /// Of the last change.
  std::uint64_t stamp() const { return stamp_; }
  std::size_t n_pages() const { return pages_.size(); }
  /// Of the last change of an object of the page.
  std::uint64_t page_stamp(std::size_t page) const { return pages_[page].stamp; }
  /// Calls visit(id, object) for every object of the page that has changed after `since`, in
  /// ascending id order, with a null pointer for the dead. Among these may be ids not used yet.
  template <class Visitor>
  void for_each_change(std::size_t page, std::uint64_t since, Visitor&& visit) const {
    const Page& looked_at = pages_[page];
    if (looked_at.stamp <= since) return;
    for (std::size_t i = 0; i < kPageSize; ++i) {
      const IdType id(static_cast<std::int64_t>(page * kPageSize + i));
      if (!looked_at.objects) {
        visit(id, static_cast<const Object*>(nullptr));
      } else if (looked_at.objects->stamps[i] > since) {
        visit(id, static_cast<const Object*>(looked_at.objects->slots[i].get()));
      }
    }
  }

  /// Calls visit(object) for every live object in ascending id order. The visitor must not insert.
  template <class Visitor>
  void for_each(Visitor&& visit) const {
    for (const auto& page : pages_) {
      if (!page.objects) continue;
      for (const auto& slot : page.objects->slots) {
        if (slot) visit(static_cast<const Object&>(*slot));
      }
    }
  }

 private:
  struct Objects {
    std::array<std::unique_ptr<Object>, kPageSize> slots;
    std::array<std::uint64_t, kPageSize> stamps{};  ///< 0: never used
    std::size_t used = 0;
  };
  struct Page {
    std::unique_ptr<Objects> objects;  ///< null once all have died
    std::uint64_t stamp = 0;
  };
  std::vector<Page> pages_;
  std::size_t size_ = 0;
  std::uint64_t stamp_ = 0;
};

}  // namespace orbslam

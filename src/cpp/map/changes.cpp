// SPDX-License-Identifier: BSD-3-Clause
#include "map/changes.hpp"

#include <algorithm>
#include <iterator>
#include <utility>

namespace orbslam {
namespace {

/// Work done under one lock, in points copied: a few hundred microseconds to a millisecond.
constexpr int kBudget = 4096;
/// A keyframe costs as much as so many points: its weights are read.
constexpr int kKeyFrameCost = 16;
/// A page that has changed is read whole.
constexpr int kPageCost = 8;
/// After so many sections the next ones get more.
constexpr int kPatience = 256;

/// An id may be reported in several sections; its last state counts.
template <class IdType>
std::vector<std::size_t> last_of_each(const std::vector<IdType>& ids) {
  std::vector<std::size_t> rows(ids.size());
  for (std::size_t i = 0; i < rows.size(); ++i) rows[i] = i;
  std::stable_sort(rows.begin(), rows.end(),
                   [&](std::size_t a, std::size_t b) { return ids[a] < ids[b]; });
  std::vector<std::size_t> last;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (i + 1 == rows.size() || ids[rows[i]] != ids[rows[i + 1]]) last.push_back(rows[i]);
  }
  return last;
}

template <class Item>
void select(std::vector<Item>& items, const std::vector<std::size_t>& rows) {
  std::vector<Item> selected;
  selected.reserve(rows.size());
  for (const std::size_t row : rows) selected.push_back(items[row]);
  items = std::move(selected);
}

template <class IdType>
bool contains(const std::vector<IdType>& sorted, IdType id) {
  return std::binary_search(sorted.begin(), sorted.end(), id);
}

template <class IdType>
void drop(std::vector<std::size_t>& rows, const std::vector<IdType>& ids,
          const std::vector<IdType>& dead) {
  rows.erase(std::remove_if(rows.begin(), rows.end(),
                            [&](std::size_t row) { return contains(dead, ids[row]); }),
             rows.end());
}

/// Dead objects that had been reported before this look.
template <class IdType>
std::vector<IdType> removed(const std::vector<IdType>& dead, const std::vector<IdType>& born) {
  std::vector<IdType> ids;
  std::set_difference(dead.begin(), dead.end(), born.begin(), born.end(), std::back_inserter(ids));
  return ids;
}

template <class Tag>
std::size_t index_of(Id<Tag> id) {
  return static_cast<std::size_t>(id.value);
}

void tell_if_changed(KeyFramePairs&& now, KeyFramePairs& before, bool always,
                     std::optional<KeyFramePairs>& told) {
  if (!always && now == before) return;
  before = std::move(now);
  told = before;
}

}  // namespace

/// One look, which may take several sections under the lock.
struct MapFollower::Pending {
  MapChanges changes;
  // Objects reported for the first time in this look, and reported objects that have died since.
  std::vector<KeyFrameId> keyframes_born, keyframes_dead;
  std::vector<MapPointId> points_born, points_dead;

  void settle_keyframes() {
    std::sort(keyframes_born.begin(), keyframes_born.end());
    std::sort(keyframes_dead.begin(), keyframes_dead.end());
    KeyFrameSnapshot& set = changes.keyframes_set;
    auto rows = last_of_each(set.ids);
    drop(rows, set.ids, keyframes_dead);
    select(set.ids, rows);
    select(set.T_wc, rows);
    select(set.timestamps, rows);
    select(set.parents, rows);
    changes.keyframes_removed = removed(keyframes_dead, keyframes_born);
  }

  void settle_points() {
    std::sort(points_born.begin(), points_born.end());
    std::sort(points_dead.begin(), points_dead.end());
    PointSnapshot& set = changes.points_set;
    auto rows = last_of_each(set.ids);
    drop(rows, set.ids, points_dead);
    select(set.ids, rows);
    select(set.positions, rows);
    select(set.observation_counts, rows);
    changes.points_removed = removed(points_dead, points_born);
  }
};

MapFollower::MapFollower(std::shared_ptr<const Map> map, int least_weight, MapIndex which)
    : map_(std::move(map)), least_weight_(least_weight), which_(which) {}

MapChanges MapFollower::update() {
  const std::lock_guard<std::mutex> one_at_a_time(mutex_);
  Pending pending;
  if (!complete_) restart(pending);
  complete_ = false;  // if memory runs out, the next look starts again
  int n_sections = 1;
  // If writers are faster, sections grow.
  while (!look(pending, kBudget * (1 + n_sections / kPatience))) ++n_sections;
  if (n_sections == 1) {
    pending.changes.keyframes_removed = std::move(pending.keyframes_dead);
    pending.changes.points_removed = std::move(pending.points_dead);
  } else {
    pending.settle_keyframes();
    pending.settle_points();
  }
  tell_edges(pending.changes);
  complete_ = true;
  return std::move(pending.changes);
}

void MapFollower::restart(Pending& pending) {
  keyframes_ = Known();
  points_ = Known();
  links_.clear();
  links_changed_ = true;
  pending = Pending();
  pending.changes.restarted = true;
}

/// Reads one section. Returns true when all objects have been read, so that the report agrees with
/// the present map.
bool MapFollower::look(Pending& pending, int budget) {
  const auto lock = map_->read_lock();
  const MapIndex wanted = which_ == kNoMap ? map_->active_map() : which_;
  if (map_->epoch() != epoch_ || wanted != followed_) {
    restart(pending);
    epoch_ = map_->epoch();
    followed_ = wanted;
  }
  pending.changes.map = followed_;
  const auto look_at_pages = [&](const auto& table, Known& known, auto&& look_at_page) {
    known.seen.resize(table.n_pages(), 0);
    known.told.resize(table.n_pages() * table.kPageSize, false);
    for (std::size_t page = 0; page < table.n_pages(); ++page) {
      if (table.page_stamp(page) <= known.seen[page]) continue;
      if (budget <= 0) return false;
      budget -= look_at_page(page);
      known.seen[page] = table.page_stamp(page);
    }
    return true;
  };
  return look_at_pages(map_->keyframe_table(), keyframes_,
                       [&](std::size_t page) { return look_at_keyframes(page, pending); }) &&
         look_at_pages(map_->point_table(), points_,
                       [&](std::size_t page) { return look_at_points(page, pending); });
}

int MapFollower::look_at_keyframes(std::size_t page, Pending& pending) {
  int cost = kPageCost;
  KeyFrameSnapshot& set = pending.changes.keyframes_set;
  const auto tell = [&](KeyFrameId id, const KeyFrame* keyframe) {
    std::vector<bool>::reference told = keyframes_.told[index_of(id)];
    if (!keyframe || keyframe->map != followed_) {
      if (!told) return;
      told = false;
      pending.keyframes_dead.push_back(id);
      links_.erase(id);
      links_changed_ = true;
      return;
    }
    if (!keyframe->published) return;
    cost += kKeyFrameCost;
    set.ids.push_back(id);
    set.T_wc.push_back(row_major(keyframe->T_cw.inverse()));
    set.timestamps.push_back(keyframe->frame->timestamp);
    set.parents.push_back(keyframe->parent);
    if (!told) pending.keyframes_born.push_back(id);

    Links now;
    now.parent = keyframe->parent;
    for (auto other = keyframe->weights.upper_bound(id); other != keyframe->weights.end();
         ++other) {
      if (other->second >= least_weight_) now.strong.push_back(other->first);
    }
    now.loops.assign(keyframe->loop_edges.upper_bound(id), keyframe->loop_edges.end());
    Links& before = links_[id];
    if (!told || now.parent != before.parent || now.strong != before.strong ||
        now.loops != before.loops) {
      before = std::move(now);
      links_changed_ = true;
    }
    told = true;
  };
  map_->keyframe_table().for_each_change(page, keyframes_.seen[page], tell);
  return cost;
}

int MapFollower::look_at_points(std::size_t page, Pending& pending) {
  int cost = kPageCost;
  PointSnapshot& set = pending.changes.points_set;
  const auto tell = [&](MapPointId id, const MapPoint* point) {
    std::vector<bool>::reference told = points_.told[index_of(id)];
    if (!point || !map_->is_in(*point, followed_)) {
      if (!told) return;
      told = false;
      pending.points_dead.push_back(id);
      return;
    }
    ++cost;
    const Eigen::Vector3d& p = point->position;
    set.ids.push_back(id);
    set.positions.push_back({p.x(), p.y(), p.z()});
    set.observation_counts.push_back(point->observation_count);
    if (!told) pending.points_born.push_back(id);
    told = true;
  };
  map_->point_table().for_each_change(page, points_.seen[page], tell);
  return cost;
}

void MapFollower::tell_edges(MapChanges& changes) {
  if (!links_changed_) return;
  const auto is_told = [&](KeyFrameId id) {
    return id.valid() && index_of(id) < keyframes_.told.size() && keyframes_.told[index_of(id)];
  };
  KeyFramePairs covisibility, loop_edges, spanning_tree;
  covisibility.reserve(covisibility_.size() + 64);
  for (const auto& [id, links] : links_) {
    for (const KeyFrameId other : links.strong) {
      if (is_told(other)) covisibility.push_back({id, other});
    }
    for (const KeyFrameId other : links.loops) {
      if (is_told(other)) loop_edges.push_back({id, other});
    }
    if (is_told(links.parent)) spanning_tree.push_back({id, links.parent});
  }
  const bool always = changes.restarted;
  tell_if_changed(std::move(covisibility), covisibility_, always, changes.covisibility);
  tell_if_changed(std::move(loop_edges), loop_edges_, always, changes.loop_edges);
  tell_if_changed(std::move(spanning_tree), spanning_tree_, always, changes.spanning_tree);
  links_changed_ = false;
}

}  // namespace orbslam

// SPDX-License-Identifier: BSD-3-Clause
#include "map/changed_ids.hpp"

namespace orbslam {
namespace {

template <class IdType, class Object>
void list_changes(const IdTable<IdType, Object>& table, std::uint64_t since,
                  std::vector<IdType>& living, std::vector<IdType>& dead) {
  for (std::size_t page = 0; page < table.n_pages(); ++page) {
    table.for_each_change(page, since, [&](IdType id, const Object* object) {
      (object ? living : dead).push_back(id);
    });
  }
}

MapStamp present(const Map& map) {
  return {map.epoch(), map.keyframe_table().stamp(), map.point_table().stamp()};
}

}  // namespace

MapStamp stamp_of(const Map& map) {
  const auto lock = map.read_lock();
  return present(map);
}

ChangedIds changed_since(const Map& map, const MapStamp& since) {
  ChangedIds changed;
  const auto lock = map.read_lock();
  changed.stamp = present(map);
  changed.restarted = since.epoch != map.epoch();
  const MapStamp from = changed.restarted ? MapStamp() : since;
  list_changes(map.keyframe_table(), from.keyframes, changed.keyframes, changed.keyframes_removed);
  list_changes(map.point_table(), from.points, changed.points, changed.points_removed);
  return changed;
}

}  // namespace orbslam

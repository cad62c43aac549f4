// SPDX-License-Identifier: BSD-3-Clause
#include "map/map_transform.hpp"

#include "map/map_rewrite.hpp"

namespace orbslam {

void transform_map(Map& map, MapIndex which, const Similarity& S) {
  const auto lock = map.write_lock();
  const Similarity back = S.inverse();
  MapRewrite rewrite;
  map.for_each_keyframe([&](const KeyFrame& keyframe) {
    if (keyframe.map != which) return;
    const Similarity S_cw = Similarity(keyframe.T_cw) * back;
    rewrite.move_keyframe(keyframe.id, S_cw.pose(), S.scale());
  });
  map.for_each_point([&](const MapPoint& point) {
    if (map.is_in(point, which)) rewrite.move_point(point.id, S * point.position);
  });
  if (rewrite.n_keyframes() == 0) return;
  rewrite.prepare_locked(map);
  rewrite.apply(map);
  map.count_big_change();
}

}  // namespace orbslam

// SPDX-License-Identifier: BSD-3-Clause
#include "map/scene_depth.hpp"

#include <gtest/gtest.h>

#include "support/synthetic_frames.hpp"

namespace orbslam::testing {
namespace {

/// A keyframe at z = 1 that looks along z and sees points at the given world depths.
std::optional<double> depth_of(const std::vector<double>& z) {
  Map map;
  const KeyFrameId id = map.add_keyframe(
      make_raster_frame(0, 20), Pose(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0, 0, -1)));
  for (std::size_t i = 0; i < z.size(); ++i) {
    map.add_observation(map.add_point({5, -3, z[i]}, id, 0), id, 2 * i);
  }
  return median_scene_depth(map, *map.find(id));
}

TEST(MedianSceneDepth, IsTheLowerMedianInTheCamera) {
  EXPECT_EQ(depth_of({4}), 3.0);
  EXPECT_EQ(depth_of({9, 4, 6}), 5.0);
  EXPECT_EQ(depth_of({9, 4, 6, 5}), 4.0);  // element 1 of 3, 4, 5, 8
  EXPECT_EQ(depth_of({0, -2, 7}), -1.0);
  EXPECT_FALSE(depth_of({}).has_value());
}

}  // namespace
}  // namespace orbslam::testing

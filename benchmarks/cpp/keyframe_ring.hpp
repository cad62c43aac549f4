// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <functional>
#include <vector>

#include "loops/loop.hpp"
#include "map/map.hpp"
#include "support/synthetic_frames.hpp"

namespace orbslam {

/// A ring of keyframes, each covisible with the 15 before and the 15 after it. First and last are
/// not connected.
struct KeyFrameRing {
  using Dress = std::function<void(std::int64_t, Frame&)>;

  /// `dress` may change the frame of keyframe k before it enters the map.
  explicit KeyFrameRing(
      std::int64_t n, const Dress& dress = [](std::int64_t, Frame&) {}) {
    constexpr std::int64_t kBefore = 15;
    constexpr std::size_t kShared = 15;
    const double step = 2 * 3.141592653589793 / static_cast<double>(n);
    for (std::int64_t k = 0; k < n; ++k) {
      const double angle = step * static_cast<double>(k);
      const double radius = 0.5 / step;
      const Eigen::Vector3d center(radius * std::cos(angle), 0, radius * std::sin(angle));
      const Eigen::Quaterniond R_wc(Eigen::AngleAxisd(-angle, Eigen::Vector3d::UnitY()));
      const auto frame = testing::make_raster_frame(k, (kBefore + 1) * kShared, 5);
      dress(k, *frame);
      map.add_keyframe(frame, Pose(R_wc, center).inverse());
      map.publish(KeyFrameId(k));
    }
    // Points are seen by kBefore + 1 keyframes in a row; a keyframe's slot follows from who made
    // the point.
    for (std::int64_t k = 0; k + kBefore < n; ++k) {
      for (std::size_t i = 0; i < kShared; ++i) {
        const MapPointId id = map.add_point({0, 0, 5}, KeyFrameId(k), 0);
        for (std::int64_t j = k; j <= k + kBefore; ++j) {
          map.add_observation(id, KeyFrameId(j), static_cast<std::size_t>(j - k) * kShared + i);
        }
      }
    }
    for (std::int64_t k = 0; k < n; ++k) map.update_connections(KeyFrameId(k));
    for (std::int64_t matched = 0; matched < 8; ++matched) {
      Loop loop;
      loop.current = KeyFrameId(n - 1);
      loop.matched = KeyFrameId(matched);
      loop.S_cw = Similarity(map.T_cw(loop.current));
      loop.n_matches = 100;
      loops.push_back(loop);
    }
  }

  Map map;
  std::vector<Loop> loops;  ///< of the last keyframe with each of the first eight
};

}  // namespace orbslam

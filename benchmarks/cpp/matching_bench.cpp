// SPDX-License-Identifier: BSD-3-Clause
#include <benchmark/benchmark.h>

#include <algorithm>
#include <memory>
#include <vector>

#include "map/map.hpp"
#include "matching/by_projection.hpp"
#include "matching/by_words.hpp"
#include "matching/for_initialization.hpp"
#include "matching/for_triangulation.hpp"
#include "matching/fuse.hpp"
#include "measure.hpp"
#include "support/synthetic_frames.hpp"

namespace {

using namespace orbslam;
using namespace orbslam::testing;

/// Sizes of a KITTI keyframe (2000 features) or a TUM one (1000).
struct Size {
  Pinhole pinhole;
  ImageSize image;
  double bf;
  std::size_t n_features, n_cloud, n_observed, n_unobserved;
};
const Size kKitti{{718.9, 718.9, 607.2, 185.2}, {1241, 376}, 386.1, 2000, 4000, 700, 300};
const Size kTum{{517.3, 516.5, 318.6, 255.3}, {640, 480}, 40.0, 1000, 4000, 500, 150};

/// Keyframes close to each other that look at one cloud of points, each observing a part of it:
/// any two share points, so that the neighbours of neighbours are many.
class World {
 public:
  World(const Size& size, std::size_t n_keyframes) : size_(size), random_(1) {
    CameraOptions options;
    options.pinhole = size.pinhole;
    options.image_size = size.image;
    options.bf = size.bf;
    options.depth_ratio = 40;
    camera_ = std::make_shared<Camera>(options);
    for (std::size_t i = 0; i < size.n_cloud; ++i) {
      const double u = uniform(random_, 20, size.image.width - 20);
      const double v = uniform(random_, 20, size.image.height - 20);
      positions_.push_back(size.pinhole.unproject(u, v, uniform(random_, 5, 40)));
      descriptors_.push_back(random_descriptor(random_));
      levels_.push_back(static_cast<std::int32_t>(uniform_index(random_, 5)));
    }
    points_.resize(size.n_cloud);
    for (std::size_t k = 0; k < n_keyframes; ++k) add_keyframe();
    for (const KeyFrameId id : keyframes_) map->update_connections(id);
  }

  /// A frame at a pose near the others; `sources[i]`: the point of the cloud that keypoint i
  /// shows, or -1 for clutter. The first n_observed show points that are meant to be observed.
  std::shared_ptr<Frame> make_frame(const Pose& T_cw, std::vector<int>& sources) {
    std::vector<FeatureSpec> features;
    sources.clear();
    std::vector<std::size_t> order(positions_.size());
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
    for (std::size_t i = order.size(); i-- > 1;) {
      std::swap(order[i], order[uniform_index(random_, i + 1)]);
    }
    for (const std::size_t i : order) {
      if (features.size() == size_.n_observed + size_.n_unobserved) break;
      const Eigen::Vector3d p_c = T_cw * positions_[i];
      const Eigen::Vector2d uv = size_.pinhole.project(p_c);
      if (!camera_->bounds().contains_half_open(uv.x(), uv.y())) continue;
      features.push_back(
          feature(uv.x(), uv.y(), levels_[i], p_c.z(), flip_bits(descriptors_[i], 15, random_)));
      sources.push_back(static_cast<int>(i));
    }
    while (features.size() < size_.n_features) {
      const double u = uniform(random_, 0, size_.image.width);
      const double v = uniform(random_, 0, size_.image.height);
      features.push_back(feature(u, v, static_cast<std::int32_t>(uniform_index(random_, 8)), -1,
                                 random_descriptor(random_)));
      sources.push_back(-1);
    }
    auto frame = make_synthetic_frame(0, features, camera_);
    describe(*frame, sources);
    return frame;
  }

  Pose random_pose() {
    Vector6d xi;
    for (int i = 0; i < 3; ++i) xi[i] = uniform(random_, -0.01, 0.01);
    for (int i = 3; i < 6; ++i) xi[i] = uniform(random_, -0.8, 0.8);
    return Pose::exp(xi);
  }

  MapPointId point(std::size_t i) const { return points_[i]; }
  std::vector<MapPointId> living_points() const { return map->point_ids(); }
  KeyFrameId last_keyframe() const { return keyframes_.back(); }
  const std::vector<int>& last_sources() const { return sources_; }

  std::unique_ptr<Map> map = std::make_unique<Map>();

 private:
  static FeatureSpec feature(double u, double v, std::int32_t level, double depth,
                             const Descriptor& descriptor) {
    FeatureSpec spec;
    spec.u = static_cast<float>(u);
    spec.v = static_cast<float>(v);
    spec.level = level;
    spec.depth = static_cast<float>(depth);
    spec.descriptor = descriptor;
    return spec;
  }

  // About 100 groups, as a vocabulary with branching 10 gives at depth 2.
  void describe(Frame& frame, const std::vector<int>& sources) {
    std::vector<std::pair<std::uint32_t, std::uint32_t>> sorted;
    for (std::size_t i = 0; i < frame.size(); ++i) {
      const auto node = sources[i] >= 0 ? static_cast<std::uint32_t>(sources[i]) % 100
                                        : static_cast<std::uint32_t>(uniform_index(random_, 100));
      sorted.emplace_back(node, static_cast<std::uint32_t>(i));
    }
    std::sort(sorted.begin(), sorted.end());
    for (const auto& [node, index] : sorted) {
      DirectIndex& direct = frame.direct_index;
      if (direct.nodes.empty() || direct.nodes.back() != node) {
        direct.nodes.push_back(node);
        direct.offsets.push_back(static_cast<std::uint32_t>(direct.indices.size()));
      }
      direct.indices.push_back(index);
    }
    frame.direct_index.offsets.push_back(static_cast<std::uint32_t>(sorted.size()));
    frame.described = true;
  }

  void add_keyframe() {
    const Pose T_cw = random_pose();
    const KeyFrameId id = map->add_keyframe(make_frame(T_cw, sources_), T_cw);
    map->publish(id);
    keyframes_.push_back(id);
    for (std::size_t i = 0; i < size_.n_observed; ++i) {
      const auto source = static_cast<std::size_t>(sources_[i]);
      if (!points_[source].valid()) points_[source] = map->add_point(positions_[source], id, 0);
      map->add_observation(points_[source], id, i);
      map->update_point(points_[source]);
    }
  }

  Size size_;
  std::mt19937_64 random_;
  std::shared_ptr<const Camera> camera_;
  std::vector<Eigen::Vector3d> positions_;
  std::vector<Descriptor> descriptors_;
  std::vector<std::int32_t> levels_;
  std::vector<MapPointId> points_;
  std::vector<KeyFrameId> keyframes_;
  std::vector<int> sources_;
};

/// A frame that holds the points it observes, at a pose in the world.
TrackedFrame tracked_frame(World& world, const Pose& T_cw, std::size_t n_held) {
  std::vector<int> sources;
  TrackedFrame frame(world.make_frame(T_cw, sources));
  frame.T_cw = T_cw;
  for (std::size_t i = 0; i < n_held; ++i) {
    const MapPointId id = world.point(static_cast<std::size_t>(sources[i]));
    if (const MapPoint* point = world.map->find(id)) frame.associate(i, id, point->position);
  }
  return frame;
}

void match_last_frame(benchmark::State& state, const Size& size) {
  World world(size, 40);
  const TrackedFrame last = tracked_frame(world, world.random_pose(), size.n_observed);
  const TrackedFrame current = tracked_frame(world, world.random_pose(), 0);
  const PointBatch points = gather_points(*world.map, last.map_points);
  int n = 0;
  measure_prepared(
      state, [&] { return current; },
      [&](TrackedFrame& frame) { n = match_last_frame(frame, last, points, 15, true); });
  state.counters["points"] = static_cast<double>(points.size());
  state.counters["matches"] = n;
}
BENCHMARK_CAPTURE(match_last_frame, kitti, kKitti)->UseManualTime();
BENCHMARK_CAPTURE(match_last_frame, tum, kTum)->UseManualTime();

void match_local_map(benchmark::State& state, const Size& size, float radius_factor) {
  World world(size, 40);
  const TrackedFrame current = tracked_frame(world, world.random_pose(), size.n_observed / 2);
  const PointBatch points = gather_points(*world.map, world.living_points());
  LocalMapMatches matches;
  measure_prepared(
      state, [&] { return current; },
      [&](TrackedFrame& frame) { matches = match_local_map(frame, points, {}, radius_factor); });
  state.counters["points"] = static_cast<double>(points.size());
  state.counters["visible"] = static_cast<double>(matches.visible.size());
  state.counters["matches"] = matches.n_matches;
}
BENCHMARK_CAPTURE(match_local_map, kitti_stereo, kKitti, 1.0F)->UseManualTime();
BENCHMARK_CAPTURE(match_local_map, tum_rgbd, kTum, 3.0F)->UseManualTime();

void match_keyframe_by_words(benchmark::State& state, const Size& size) {
  World world(size, 10);
  const TrackedFrame current = tracked_frame(world, world.random_pose(), 0);
  int n = 0;
  measure_prepared(
      state, [&] { return current; },
      [&](TrackedFrame& frame) {
        n = match_keyframe_by_words(*world.map, world.last_keyframe(), frame, 0.7F);
      });
  state.counters["matches"] = n;
}
BENCHMARK_CAPTURE(match_keyframe_by_words, kitti, kKitti)->UseManualTime();
BENCHMARK_CAPTURE(match_keyframe_by_words, tum, kTum)->UseManualTime();

void match_views(benchmark::State& state, const Size& size) {
  World world(size, 1);
  std::vector<int> sources;
  const auto first = world.make_frame(world.random_pose(), sources);
  const auto current = world.make_frame(world.random_pose(), sources);
  std::vector<Eigen::Vector2f> expected;
  for (const Keypoint& keypoint : first->keypoints) expected.emplace_back(keypoint.x, keypoint.y);
  measure_prepared(
      state, [] { return ViewMatchOptions(); },
      [&](const ViewMatchOptions& options) { match_views(*first, *current, expected, options); });
}
BENCHMARK_CAPTURE(match_views, tum, kTum)->UseManualTime();

void create_new_points(benchmark::State& state, const Size& size) {
  std::size_t n = 0;
  measure_prepared(
      state, [&] { return std::make_unique<World>(size, 30); },
      [&](std::unique_ptr<World>& world) {
        n = create_new_points(*world->map, world->last_keyframe(), {}, nullptr).size();
      });
  state.counters["new_points"] = static_cast<double>(n);
}
BENCHMARK_CAPTURE(create_new_points, kitti, kKitti)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond)
    ->Iterations(15);
BENCHMARK_CAPTURE(create_new_points, tum, kTum)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond)
    ->Iterations(15);

// `settled`: everything has been fused before, so that only the searches cost.
void fuse_with_neighbours(benchmark::State& state, const Size& size, bool settled) {
  int changes = 0;
  measure_prepared(
      state,
      [&] {
        auto world = std::make_unique<World>(size, 80);
        if (settled) fuse_with_neighbours(*world->map, world->last_keyframe(), 10);
        return world;
      },
      [&](std::unique_ptr<World>& world) {
        changes = fuse_with_neighbours(*world->map, world->last_keyframe(), 10);
      });
  state.counters["changes"] = changes;
}
BENCHMARK_CAPTURE(fuse_with_neighbours, kitti, kKitti, false)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond)
    ->Iterations(15);
BENCHMARK_CAPTURE(fuse_with_neighbours, tum, kTum, false)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond)
    ->Iterations(15);
BENCHMARK_CAPTURE(fuse_with_neighbours, kitti_settled, kKitti, true)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond)
    ->Iterations(15);

}  // namespace

// SPDX-License-Identifier: BSD-3-Clause
// The verbs of the map on a map of 80 keyframes with 1000 keypoints each.
#include <benchmark/benchmark.h>

#include <memory>
#include <random>
#include <utility>

#include "map/content_hash.hpp"
#include "map/culling.hpp"
#include "map/invariants.hpp"
#include "map/keyframe_insertion.hpp"
#include "map/local_map.hpp"
#include "map/snapshot.hpp"
#include "measure.hpp"

namespace orbslam {
namespace {

constexpr std::size_t kKeypoints = 1000;
constexpr int kKeyFrames = 80;
/// Each keyframe brings this many points; a point stays in view for about 20 keyframes.
constexpr std::size_t kNewPoints = 50;

std::shared_ptr<const Frame> make_frame(FrameId id) {
  static const auto camera = [] {
    CameraOptions options;
    options.pinhole = {400, 400, 320, 240};
    options.bf = 40;
    options.depth_ratio = 40;
    options.image_size = {640, 480};
    return std::make_shared<const Camera>(options);
  }();
  static const auto scales = std::make_shared<const ScalePyramid>(1.2F, 8);
  std::mt19937_64 random(static_cast<std::uint64_t>(id));
  auto frame = std::make_shared<Frame>();
  frame->id = id;
  frame->camera = camera;
  frame->scales = scales;
  for (std::size_t i = 0; i < kKeypoints; ++i) {
    Keypoint keypoint;
    keypoint.x = static_cast<float>(random() % 640);
    keypoint.y = static_cast<float>(random() % 480);
    keypoint.level = static_cast<std::int32_t>(random() % 8);
    Descriptor descriptor;
    for (auto& word : descriptor.words) word = random();
    frame->keypoints.push_back(keypoint);
    frame->descriptors.push_back(descriptor);
    frame->depth.push_back(1.0F + static_cast<float>(i % 50) * 0.1F);
    frame->right_u.push_back(keypoint.x - 10);
  }
  return frame;
}

/// Slot i of frame k sees the point that was made for slot i by the last frame that replaced it;
/// every frame replaces the next kNewPoints slots.
TrackedFrame track(const Map& map, FrameId id, bool all_known) {
  TrackedFrame frame(make_frame(id));
  frame.T_cw =
      Pose(Eigen::Quaterniond::Identity(), Eigen::Vector3d(-0.1 * static_cast<double>(id), 0, 0));
  if (id == 0) return frame;
  const auto lock = map.read_lock();
  const KeyFrame* last = nullptr;
  map.for_each_keyframe([&](const KeyFrame& keyframe) { last = &keyframe; });
  const std::size_t first_new = static_cast<std::size_t>(id) * kNewPoints % kKeypoints;
  for (std::size_t i = 0; i < kKeypoints; ++i) {
    const bool is_new = i >= first_new && i < first_new + kNewPoints;
    const MapPoint* point = map.find(last->map_points[i]);
    if (point && (all_known || !is_new)) frame.associate(i, point->id, point->position);
  }
  return frame;
}

std::unique_ptr<Map> make_map() {
  auto map = std::make_unique<Map>();
  std::vector<MapPointId> recent;
  for (int k = 0; k < kKeyFrames; ++k) {
    TrackedFrame frame = track(*map, k, false);
    process_new_keyframe(*map, insert_keyframe(*map, frame, true, SIZE_MAX), recent);
  }
  return map;
}

void BM_SelectLocalMap(benchmark::State& state) {
  const auto map = make_map();
  TrackedFrame frame = track(*map, kKeyFrames, true);
  LocalMap local;
  measure(state, [&] { local = select_local_map(*map, frame); });
  state.counters["keyframes"] = static_cast<double>(local.keyframes.size());
  state.counters["points"] = static_cast<double>(local.points.size());
}
BENCHMARK(BM_SelectLocalMap)->Unit(benchmark::kMillisecond);

void BM_SelectWholeMap(benchmark::State& state) {
  // Points of all ages, so that all 80 keyframes are voted for.
  const auto map = make_map();
  TrackedFrame frame(make_frame(kKeyFrames));
  const auto ids = map->point_ids();
  for (std::size_t i = 0; i < kKeypoints; ++i) {
    frame.map_points[i] = ids[i * ids.size() / kKeypoints];
  }
  LocalMap local;
  measure(state, [&] { local = select_local_map(*map, frame); });
  state.counters["keyframes"] = static_cast<double>(local.keyframes.size());
  state.counters["points"] = static_cast<double>(local.points.size());
}
BENCHMARK(BM_SelectWholeMap)->Unit(benchmark::kMillisecond);

void BM_GatherThousandPoints(benchmark::State& state) {
  const auto map = make_map();
  const TrackedFrame frame = track(*map, kKeyFrames, true);
  measure(state, [&] { benchmark::DoNotOptimize(gather_points(*map, frame.map_points)); });
}
BENCHMARK(BM_GatherThousandPoints)->Unit(benchmark::kMillisecond);

void BM_InsertKeyframe(benchmark::State& state) {
  measure_prepared(
      state,
      [] {
        auto map = make_map();
        TrackedFrame frame = track(*map, kKeyFrames, false);
        return std::pair(std::move(map), std::move(frame));
      },
      [](auto& given) { insert_keyframe(*given.first, given.second, true); });
}
BENCHMARK(BM_InsertKeyframe)->UseManualTime()->Unit(benchmark::kMillisecond)->Iterations(30);

void BM_ProcessNewKeyframe(benchmark::State& state) {
  measure_prepared(
      state,
      [] {
        auto map = make_map();
        TrackedFrame frame = track(*map, kKeyFrames, true);
        const KeyFrameId id = insert_keyframe(*map, frame, true);
        return std::pair(std::move(map), id);
      },
      [](auto& given) {
        std::vector<MapPointId> recent;
        process_new_keyframe(*given.first, given.second, recent);
      });
}
BENCHMARK(BM_ProcessNewKeyframe)->UseManualTime()->Unit(benchmark::kMillisecond)->Iterations(30);

void BM_UpdateConnections(benchmark::State& state) {
  const auto map = make_map();
  measure(state, [&] { map->update_connections(KeyFrameId(40)); });
}
BENCHMARK(BM_UpdateConnections)->Unit(benchmark::kMillisecond);

void BM_UpdateThousandPoints(benchmark::State& state) {
  const auto map = make_map();
  const auto slots = map->find(KeyFrameId(60))->map_points;
  measure(state, [&] {
    for (const MapPointId id : slots) map->update_point(id);
  });
}
BENCHMARK(BM_UpdateThousandPoints)->Unit(benchmark::kMillisecond);

void BM_CullKeyframes(benchmark::State& state) {
  double n_died = 0;
  measure_prepared(state, make_map, [&](auto& map) {
    n_died = static_cast<double>(cull_keyframes(*map, KeyFrameId(kKeyFrames - 1), true).size());
  });
  state.counters["died"] = n_died;
}
BENCHMARK(BM_CullKeyframes)->UseManualTime()->Unit(benchmark::kMillisecond)->Iterations(30);

void BM_EraseKeyframe(benchmark::State& state) {  // the longest write section of culling
  measure_prepared(state, make_map, [](auto& map) { map->erase_keyframe(KeyFrameId(40)); });
}
BENCHMARK(BM_EraseKeyframe)->UseManualTime()->Unit(benchmark::kMillisecond)->Iterations(30);

void BM_SnapshotMap(benchmark::State& state) {
  const auto map = make_map();
  measure(state, [&] { benchmark::DoNotOptimize(snapshot_map(*map)); });
}
BENCHMARK(BM_SnapshotMap)->Unit(benchmark::kMillisecond);

void BM_CheckInvariants(benchmark::State& state) {
  const auto map = make_map();
  measure(state, [&] { benchmark::DoNotOptimize(check_invariants(*map, false)); });
}
BENCHMARK(BM_CheckInvariants)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace orbslam

// SPDX-License-Identifier: BSD-3-Clause
// Following a map of 5000 keyframes and 500 000 points while it is mapped, and after a loop.
#include <benchmark/benchmark.h>

#include <memory>
#include <vector>

#include "map/changes.hpp"
#include "measure.hpp"
#include "support/synthetic_frames.hpp"

namespace orbslam {
namespace {

constexpr int kKeyFrames = 5000;
constexpr int kNewPoints = 100;  ///< per keyframe
constexpr int kObservers = 8;    ///< a point is seen by so many keyframes in a row
constexpr int kLocal = 25;       ///< keyframes of a local bundle adjustment
constexpr double kUpdatesPerSecond = 5;

/// A camera that goes straight on: keyframe k brings 100 points, and the next seven see them.
class StraightMap {
 public:
  StraightMap() {
    for (int k = 0; k < kKeyFrames; ++k) add_keyframe();
  }

  std::shared_ptr<Map> map = std::make_shared<Map>();

  /// As mapping does: a keyframe with new points, and observations of those before.
  void add_keyframe() {
    const auto k = static_cast<std::int64_t>(points_.size());
    const auto lock = map->write_lock();
    const KeyFrameId id = map->add_keyframe(frame_, pose_at(static_cast<double>(k)));
    points_.emplace_back();
    for (int i = 0; i < kNewPoints; ++i) {
      points_.back().push_back(map->add_point({static_cast<double>(k), i * 0.1, 5}, id, k));
    }
    const std::int64_t first = std::max<std::int64_t>(0, k + 1 - kObservers);
    for (std::int64_t maker = first; maker <= k; ++maker) {
      const std::size_t slot = static_cast<std::size_t>(maker % kObservers) * kNewPoints;
      for (std::size_t i = 0; i < kNewPoints; ++i) {
        const MapPointId point = points_[static_cast<std::size_t>(maker)][i];
        if (!map->find(point)) continue;
        map->add_observation(point, id, slot + i);
        map->update_point(point);
      }
    }
    map->update_connections(id);
    map->publish(id);
    map->mark_processed(id);
  }

  /// What the mapper does about a keyframe: takes it in, culls points, moves what is around.
  void map_a_keyframe() {
    add_keyframe();
    const auto lock = map->write_lock();
    for (std::size_t i = 0; i < 30; ++i) map->erase_point(points_[points_.size() - 3][i]);
    const auto last = static_cast<std::int64_t>(points_.size());
    for (std::int64_t k = last - kLocal; k < last; ++k) {
      map->set_pose(KeyFrameId(k), pose_at(static_cast<double>(k)));
      move_points_of(k);
    }
  }

  /// As a loop or a full bundle adjustment does.
  void move_everything() {
    const auto lock = map->write_lock();
    for (std::int64_t k = 0; k < static_cast<std::int64_t>(points_.size()); ++k) {
      map->set_pose(KeyFrameId(k), pose_at(static_cast<double>(k)));
      move_points_of(k);
    }
    map->count_big_change();
  }

  /// What tracking does at every image.
  void count_sightings() {
    const auto lock = map->write_lock();
    for (const MapPointId id : points_.back()) map->count_found(id);
  }

 private:
  static Pose pose_at(double x) { return {Eigen::Quaterniond::Identity(), {-x, 0, 0}}; }

  void move_points_of(std::int64_t k) {
    for (const MapPointId id : points_[static_cast<std::size_t>(k)]) {
      const MapPoint* point = map->find(id);
      if (!point) continue;
      map->set_position(id, point->position);
      map->update_geometry(id);
    }
  }

  std::shared_ptr<const Frame> frame_ =
      testing::make_raster_frame(0, static_cast<std::size_t>(kObservers) * kNewPoints);
  std::vector<std::vector<MapPointId>> points_;
};

StraightMap& straight_map() {
  static StraightMap map;
  return map;
}

/// Looks at the map after each `change`; counts the processor's time of the look alone, and its
/// share of one core at five looks a second.
template <class Change>
void measure_looks(benchmark::State& state, Change change) {
  StraightMap& straight = straight_map();
  MapFollower follower(straight.map);
  follower.update();
  std::vector<double> milliseconds, processor;
  double n_points = 0;
  for (auto _ : state) {
    change(straight);
    const double began = milliseconds_of(CLOCK_THREAD_CPUTIME_ID);
    const Stopwatch watch;
    const MapChanges changes = follower.update();
    milliseconds.push_back(watch.milliseconds());
    processor.push_back(milliseconds_of(CLOCK_THREAD_CPUTIME_ID) - began);
    state.SetIterationTime(1e-3 * milliseconds.back());
    n_points = static_cast<double>(changes.points_set.ids.size());
  }
  double total = 0;
  for (const double one : processor) total += one;
  state.counters["points_set"] = n_points;
  state.counters["percent_of_core"] =
      100 * kUpdatesPerSecond * 1e-3 * total / static_cast<double>(processor.size());
  report_times(state, milliseconds);
  report_times(state, processor, "cpu_");
}

void BM_FollowMapping(benchmark::State& state) {
  measure_looks(state, [](StraightMap& straight) { straight.map_a_keyframe(); });
}
BENCHMARK(BM_FollowMapping)->UseManualTime()->Unit(benchmark::kMillisecond)->Iterations(100);

void BM_FollowTracking(benchmark::State& state) {
  measure_looks(state, [](StraightMap& straight) { straight.count_sightings(); });
}
BENCHMARK(BM_FollowTracking)->UseManualTime()->Unit(benchmark::kMillisecond)->Iterations(100);

void BM_FollowLoop(benchmark::State& state) {
  measure_looks(state, [](StraightMap& straight) { straight.move_everything(); });
}
BENCHMARK(BM_FollowLoop)->UseManualTime()->Unit(benchmark::kMillisecond)->Iterations(5);

void BM_FirstLook(benchmark::State& state) {
  StraightMap& straight = straight_map();
  measure(state, [&] { benchmark::DoNotOptimize(MapFollower(straight.map).update()); });
}
BENCHMARK(BM_FirstLook)->Unit(benchmark::kMillisecond)->Iterations(5);

/// What the stamps cost those who change the map.
void BM_MapAKeyframe(benchmark::State& state) {
  StraightMap& straight = straight_map();
  measure(state, [&] { straight.map_a_keyframe(); });
}
BENCHMARK(BM_MapAKeyframe)->Unit(benchmark::kMillisecond)->Iterations(50);

}  // namespace
}  // namespace orbslam

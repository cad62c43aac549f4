// SPDX-License-Identifier: BSD-3-Clause
#include <benchmark/benchmark.h>

#include "measure.hpp"
#include "synthetic/paths.hpp"
#include "synthetic/world.hpp"

namespace {

using namespace orbslam::synthetic;

/// Renders one pose after the other.
template <class PoseAt>
void render_along(benchmark::State& state, const World& world, const RenderOptions& options,
                  PoseAt pose_at) {
  int i = 0;
  measure(state, [&] { benchmark::DoNotOptimize(render(world, pose_at(i++).inverse(), options)); });
}

void room_640x480(benchmark::State& state) {
  const Eigen::Vector3d size(6, 3, 6);
  RenderOptions options;
  options.noise = static_cast<double>(state.range(0));
  render_along(state, make_room(size, 1, 10), options,
               [&](int i) { return room_T_wc(size, i / 30.0); });
}
BENCHMARK(room_640x480)->Arg(0)->Arg(2)->ArgName("noise")->Unit(benchmark::kMillisecond);

void corridor_640x480(benchmark::State& state) {
  const Way way = corridor_way(16, 12, 2.4);
  render_along(state, make_corridor(16, 12, 2.4, 2.6, 1), {},
               [&](int i) { return way.T_wc(0.1 * i); });
}
BENCHMARK(corridor_640x480)->Unit(benchmark::kMillisecond);

void street_1241x376(benchmark::State& state) {
  const Way way = street_way(600);
  RenderOptions options{718.9, 718.9, 607.2, 185.2, {1241, 376}};
  render_along(state, make_street(600, 12, 1), options, [&](int i) { return way.T_wc(i % 600); });
}
BENCHMARK(street_1241x376)->Unit(benchmark::kMillisecond);

void paint_room(benchmark::State& state) {
  for (auto _ : state) benchmark::DoNotOptimize(make_room({6, 3, 6}, 1, 10));
}
BENCHMARK(paint_room)->Unit(benchmark::kMillisecond);

void paint_street(benchmark::State& state) {
  for (auto _ : state) benchmark::DoNotOptimize(make_street(600, 12, 1));
}
BENCHMARK(paint_street)->Unit(benchmark::kMillisecond);

}  // namespace

// SPDX-License-Identifier: BSD-3-Clause
#include <benchmark/benchmark.h>

#include <cstddef>
#include <vector>

#include "alignment/align_patch.hpp"
#include "alignment/made_up_image.hpp"
#include "alignment/patch_warp.hpp"

namespace {

using namespace orbslam;

constexpr std::size_t kPairs = 64;
const Eigen::Vector2d kCentre(32.3, 31.8);

/// Images of many textures and what they look like a little moved, turned and enlarged.
struct Pairs {
  Eigen::Matrix2d A = 1.05 * Eigen::Rotation2Dd(0.1).toRotationMatrix();
  std::vector<ReferencePatch> references{kPairs};
  std::vector<cv::Mat> images, moved;

  Pairs() {
    const Eigen::Matrix2d back = A.inverse();
    for (unsigned i = 0; i < kPairs; ++i) {
      const testing::Texture texture(i + 1, 7);
      images.push_back(
          testing::picture(texture, [](const Eigen::Vector2d& p) { return p; }, {1, 0, 2, i}));
      cut_patch(images.back(), kCentre, references[i]);
      const Eigen::Vector2d shift(0.7, -0.6);
      moved.push_back(testing::picture(texture,
                                       [&](const Eigen::Vector2d& p) -> Eigen::Vector2d {
                                         return kCentre + back * (p - kCentre - shift);
                                       },
                                       {1.1, 4, 2, i + 1000}));
    }
  }
};

const Pairs& pairs() {
  static const Pairs made;
  return made;
}

/// One patch: warp, template, all steps, judgement.
void align_one_patch(benchmark::State& state) {
  const Pairs& made = pairs();
  std::size_t i = 0;
  double steps = 0, aligned = 0, n = 0;
  for (auto _ : state) {
    const PatchAlignment found = align_patch(made.references[i], made.A, made.moved[i], kCentre);
    steps += found.iterations;
    aligned += found.ok() ? 1 : 0;
    n += 1;
    i = (i + 1) % kPairs;
  }
  state.counters["steps"] = steps / n;
  state.counters["aligned"] = aligned / n;
}
BENCHMARK(align_one_patch);

void cut_one_patch(benchmark::State& state) {
  const Pairs& made = pairs();
  ReferencePatch patch;
  std::size_t i = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(cut_patch(made.images[i], kCentre, patch));
    i = (i + 1) % kPairs;
  }
}
BENCHMARK(cut_one_patch);

void warp_of_one_patch(benchmark::State& state) {
  CameraOptions options;
  options.pinhole = {500, 500, 320, 240};
  options.image_size = {640, 480};
  if (state.range(0) == 1) options.distortion = {0.2, -0.5, 0.002, -0.001, 0.1};
  const Camera camera(options);
  const Pose T_cw(Eigen::Quaterniond(Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitY())),
                  {0.1, 0.2, 0.3});
  const auto patch = parallel_patch(camera, Pose(), {200, 100}, 3);
  for (auto _ : state) benchmark::DoNotOptimize(warp_of(*patch, camera, T_cw));
}
BENCHMARK(warp_of_one_patch)->ArgName("lens")->Arg(0)->Arg(1);

}  // namespace

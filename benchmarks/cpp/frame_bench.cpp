// SPDX-License-Identifier: BSD-3-Clause
#include <benchmark/benchmark.h>

#include <algorithm>
#include <vector>

#include "features/orb_extractor.hpp"
#include "frame/build_frame.hpp"
#include "frame/extract_pair.hpp"
#include "frame/image_input.hpp"
#include "frame/keypoint_colours.hpp"
#include "frame/stereo_kernels.hpp"
#include "frame/stereo_matching.hpp"
#include "measure.hpp"
#include "synthetic/paths.hpp"
#include "synthetic/world.hpp"

namespace {

using namespace orbslam;

/// A rendered pair and its features, of the sizes and numbers of well-known data sets.
struct Pair {
  OrbOptions options;
  CameraOptions camera;
  cv::Mat left_image, right_image, depth;
  Extraction left, right;

  Pair(const synthetic::World& world, const Pose& T_wc, const synthetic::RenderOptions& view,
       double baseline, int n_features) {
    options.n_features = n_features;
    camera.pinhole = {view.fx, view.fy, view.cx, view.cy};
    camera.image_size = view.size;
    camera.bf = baseline * view.fx;
    camera.depth_ratio = 35;
    auto rendering = synthetic::render(world, T_wc.inverse(), view);
    left_image = rendering.grey;
    depth = rendering.depth;
    const Pose T_lr(Eigen::Matrix3d::Identity(), Eigen::Vector3d(baseline, 0, 0));
    auto right_view = view;
    ++right_view.noise_seed;
    right_image = synthetic::render(world, (T_wc * T_lr).inverse(), right_view).grey;
    OrbExtractor extractor(options);
    left = extractor.extract(left_image);
    right = extractor.extract(right_image);
  }

  FrameContext context() const {
    return {std::make_shared<Camera>(camera),
            std::make_shared<ScalePyramid>(options.scale_factor, options.n_levels)};
  }
};

const Pair& euroc_like() {
  static const Pair pair = [] {
    const Eigen::Vector3d size(6, 3, 6);
    synthetic::RenderOptions view{435.2, 435.2, 367.5, 252.2, {752, 480}, 2, 1, 1, 1};
    return Pair(synthetic::make_room(size, 1, 10), synthetic::room_T_wc(size, 3), view, 0.11, 1200);
  }();
  return pair;
}

const Pair& kitti_like() {
  static const Pair pair = [] {
    synthetic::RenderOptions view{718.9, 718.9, 607.2, 185.2, {1241, 376}, 2, 1, 1, 1};
    return Pair(synthetic::make_street(300, 12, 1), synthetic::street_way(300).T_wc(20), view, 0.54,
                2000);
  }();
  return pair;
}

void stereo_matching(benchmark::State& state, const Pair& (*make)()) {
  const Pair& pair = make();
  const ScalePyramid scales(pair.options.scale_factor, pair.options.n_levels);
  StereoMatches matches;
  measure(state, [&] {
    matches = match_stereo(pair.left, pair.right, scales, pair.camera.bf, pair.camera.pinhole.fx);
  });
  state.counters["keypoints"] = static_cast<double>(pair.left.features.size());
  state.counters["matched"] = static_cast<double>(
      std::count_if(matches.depth.begin(), matches.depth.end(), [](float z) { return z > 0; }));
}
BENCHMARK_CAPTURE(stereo_matching, euroc_752x480, euroc_like)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(stereo_matching, kitti_1241x376, kitti_like)->Unit(benchmark::kMillisecond);

void stereo_frame(benchmark::State& state, const Pair& (*make)()) {
  const Pair& pair = make();
  const FrameContext context = pair.context();
  measure(state, [&] {
    benchmark::DoNotOptimize(build_stereo_frame(context, 0, 0, pair.left, pair.right));
  });
}
BENCHMARK_CAPTURE(stereo_frame, kitti_1241x376, kitti_like)->Unit(benchmark::kMillisecond);

void rgbd_frame_distorted(benchmark::State& state) {
  const Pair& pair = euroc_like();
  FrameContext context = pair.context();
  CameraOptions distorted = pair.camera;
  distorted.distortion = {0.26, -0.95, -0.005, 0.003, 1.16};
  context.camera = std::make_shared<Camera>(distorted);
  measure(state, [&] {
    benchmark::DoNotOptimize(build_rgbd_frame(context, 0, 0, pair.left.features, pair.depth));
  });
}
BENCHMARK(rgbd_frame_distorted)->Unit(benchmark::kMillisecond);

void extract_pair_in_two_threads(benchmark::State& state) {
  const Pair& pair = euroc_like();
  PairExtractor extractor(pair.options);
  measure(state,
          [&] { benchmark::DoNotOptimize(extractor.extract(pair.left_image, pair.right_image)); });
}
BENCHMARK(extract_pair_in_two_threads)->UseRealTime()->Unit(benchmark::kMillisecond);

void extract_pair_one_after_the_other(benchmark::State& state) {
  const Pair& pair = euroc_like();
  OrbExtractor extractor(pair.options);
  measure(state, [&] {
    benchmark::DoNotOptimize(extractor.extract(pair.left_image));
    benchmark::DoNotOptimize(extractor.extract(pair.right_image));
  });
}
BENCHMARK(extract_pair_one_after_the_other)->UseRealTime()->Unit(benchmark::kMillisecond);

void features_in_area(benchmark::State& state) {
  const auto& keypoints = kitti_like().left.features.keypoints;
  const KeypointGrid grid(keypoints, {0, 1241, 0, 376});
  std::vector<std::uint32_t> found;
  measure(state, [&] {
    for (const Keypoint& keypoint : keypoints) {
      grid.features_in_area(keypoints, keypoint.x, keypoint.y, 15, 0, 3, found);
      benchmark::DoNotOptimize(found.data());
    }
  });
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(keypoints.size()));
}
BENCHMARK(features_in_area)->Unit(benchmark::kMillisecond);

void shifted_sad(benchmark::State& state) {
  const VectorUnit unit = vector_units()[static_cast<std::size_t>(state.range(0))];
  const stereo::ShiftedSad kernel = stereo::shifted_sad_for(unit);
  state.SetLabel(name_of(unit));
  stereo::WindowPair windows{};
  for (int row = 0; row < stereo::kWindow; ++row) {
    for (int column = 0; column < 16; ++column) {
      windows.left[row][column] = static_cast<unsigned char>(37 * row + 11 * column);
      windows.right[row][column] = static_cast<unsigned char>(29 * row + 13 * column);
    }
  }
  int sums[stereo::kShifts];
  for (auto _ : state) {
    kernel(windows, sums);
    benchmark::DoNotOptimize(sums);
  }
}
BENCHMARK(shifted_sad)->ArgName("unit")->DenseRange(0, static_cast<int>(vector_units().size()) - 1);

void grey_of_rgb_1241x376(benchmark::State& state) {
  const cv::Mat image(376, 1241, CV_8UC3, cv::Scalar(10, 20, 30));
  cv::Mat grey;
  measure(state, [&] { to_grey(image, true, grey); });
}
BENCHMARK(grey_of_rgb_1241x376)->Unit(benchmark::kMillisecond);

void colours_of_keypoints_1241x376(benchmark::State& state) {
  const Pair& pair = kitti_like();
  const auto frame = build_monocular_frame(pair.context(), 0, 0, pair.left.features);
  const cv::Mat image(376, 1241, CV_8UC3, cv::Scalar(10, 20, 30));
  measure(state, [&] { sample_colours(image, true, *frame); });
}
BENCHMARK(colours_of_keypoints_1241x376)->Unit(benchmark::kMillisecond);

void metres_of_uint16_640x480(benchmark::State& state) {
  const cv::Mat raw(480, 640, CV_16UC1, cv::Scalar(5000));
  cv::Mat metres;
  measure(state, [&] { to_depth_metres(raw, 5000, metres); });
}
BENCHMARK(metres_of_uint16_640x480)->Unit(benchmark::kMillisecond);

}  // namespace

// SPDX-License-Identifier: BSD-3-Clause
// Stages of the extractor on one core. ORBSLAM2PY_BENCH_IMAGE may name a grey .pgm file and
// ORBSLAM2PY_BENCH_FEATURES the number of features; without them a synthetic image and 1000.
#include <benchmark/benchmark.h>

#include <cstdlib>
#include <fstream>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "features/corner_grid.hpp"
#include "features/gaussian_blur.hpp"
#include "features/orb_extractor.hpp"
#include "features/orientation.hpp"
#include "features/pyramid_builder.hpp"
#include "features/quadtree.hpp"
#include "measure.hpp"

namespace orbslam {
namespace {

/// Shaded rectangles with a little noise: about as many corners as a photograph of a room.
cv::Mat synthetic_image() {
  std::mt19937_64 generator(1);
  const auto draw = [&](int limit) {
    return static_cast<int>(generator() % static_cast<std::uint64_t>(limit));
  };
  cv::Mat grey(480, 640, CV_8UC1, cv::Scalar(110));
  for (int i = 0; i < 1500; ++i) {
    const cv::Rect box(draw(640), draw(480), 4 + draw(40), 4 + draw(40));
    grey(box & cv::Rect(0, 0, 640, 480)) = cv::Scalar(draw(256));
  }
  for (auto pixel = grey.begin<std::uint8_t>(); pixel != grey.end<std::uint8_t>(); ++pixel) {
    *pixel = cv::saturate_cast<std::uint8_t>(*pixel + draw(9) - 4);
  }
  cv::GaussianBlur(grey, grey, cv::Size(3, 3), 0.8);
  return grey;
}

/// Binary PGM without comments.
cv::Mat read_pgm(const char* path) {
  std::ifstream file(path, std::ios::binary);
  std::string magic;
  int width = 0, height = 0, white = 0;
  file >> magic >> width >> height >> white;
  file.get();
  if (magic != "P5" || white != 255) throw std::runtime_error(std::string("no 8-bit PGM: ") + path);
  cv::Mat grey(height, width, CV_8UC1);
  file.read(grey.ptr<char>(), static_cast<std::streamsize>(grey.total()));
  return grey;
}

const cv::Mat& image() {
  static const cv::Mat grey = [] {
    const char* named = std::getenv("ORBSLAM2PY_BENCH_IMAGE");
    return named ? read_pgm(named) : synthetic_image();
  }();
  return grey;
}

int n_features() {
  const char* named = std::getenv("ORBSLAM2PY_BENCH_FEATURES");
  return named ? std::atoi(named) : 1000;
}

VectorUnit unit_of(const benchmark::State& state) {
  return vector_units()[static_cast<std::size_t>(state.range(0))];
}

const Kernels& kernels_of(const benchmark::State& state) { return kernels_for(unit_of(state)); }

/// Names the vector unit that the benchmark runs with.
template <class Body>
void measure_kernels(benchmark::State& state, Body body) {
  state.SetLabel(name_of(unit_of(state)));
  measure(state, body);
}

/// What each stage gets from the one before.
struct Prepared {
  ScalePyramid scales{1.2F, 8};
  std::vector<int> quota = scales.features_per_level(n_features());
  ImagePyramid pyramid = build_pyramid(image(), scales);
  std::vector<std::vector<Corner>> corners, kept;
  std::vector<cv::Mat> blurred;

  Prepared() {
    const Kernels& kernels = kernels_for(best_vector_unit());
    for (std::size_t level = 0; level < pyramid.levels.size(); ++level) {
      const cv::Mat& grey = pyramid.levels[level];
      corners.push_back(CornerGrid().detect(grey, 20, 7, LevelMask{}, kernels));
      kept.push_back(
          Quadtree().distribute(corners.back(), grey.cols - 32, grey.rows - 32, quota[level]));
      blurred.push_back(GaussianBlur().blur(grey, kernels).clone());
    }
  }
};

const Prepared& prepared() {
  static const Prepared value;
  return value;
}

void extract(benchmark::State& state) {
  OrbOptions options;
  options.n_features = n_features();
  OrbExtractor extractor(options, unit_of(state));
  measure_kernels(state, [&] { benchmark::DoNotOptimize(extractor.extract(image())); });
}

void pyramid(benchmark::State& state) {
  PyramidBuilder builder;
  measure_kernels(state, [&] {
    benchmark::DoNotOptimize(builder.build(image(), prepared().scales, kernels_of(state)));
  });
}

void corners(benchmark::State& state) {
  CornerGrid grid;
  measure_kernels(state, [&] {
    for (const cv::Mat& level : prepared().pyramid.levels) {
      benchmark::DoNotOptimize(grid.detect(level, 20, 7, LevelMask{}, kernels_of(state)));
    }
  });
}

void quadtree(benchmark::State& state) {
  Quadtree tree;
  const Prepared& given = prepared();
  measure_kernels(state, [&] {
    for (std::size_t level = 0; level < given.corners.size(); ++level) {
      const cv::Mat& grey = given.pyramid.levels[level];
      benchmark::DoNotOptimize(tree.distribute(given.corners[level], grey.cols - 32, grey.rows - 32,
                                               given.quota[level]));
    }
  });
}

void blur(benchmark::State& state) {
  GaussianBlur gaussian;
  measure_kernels(state, [&] {
    for (const cv::Mat& level : prepared().pyramid.levels) {
      benchmark::DoNotOptimize(gaussian.blur(level, kernels_of(state)));
    }
  });
}

/// Calls `body` with every kept corner's pixel in the given images.
template <class Body>
void for_each_kept(const std::vector<cv::Mat>& levels, Body body) {
  for (std::size_t level = 0; level < levels.size(); ++level) {
    const auto stride = static_cast<std::ptrdiff_t>(levels[level].step[0]);
    for (const Corner& corner : prepared().kept[level]) {
      body(levels[level].ptr<std::uint8_t>(corner.y + corner_origin) + corner.x + corner_origin,
           stride);
    }
  }
}

void orientation(benchmark::State& state) {
  measure_kernels(state, [&] {
    for_each_kept(prepared().pyramid.levels, [&](const std::uint8_t* centre, auto stride) {
      std::int32_t m10 = 0, m01 = 0;
      kernels_of(state).moments(centre, stride, &m10, &m01);
      benchmark::DoNotOptimize(
          fast_atan2_degrees(static_cast<float>(m01), static_cast<float>(m10)));
    });
  });
}

void descriptors(benchmark::State& state) {
  std::uint8_t descriptor[32];
  measure_kernels(state, [&] {
    for_each_kept(prepared().blurred, [&](const std::uint8_t* centre, auto stride) {
      kernels_of(state).brief(centre, stride, 0.6F, 0.8F, descriptor);
      benchmark::DoNotOptimize(descriptor);
    });
  });
}

#define ORBSLAM_BENCHMARK(name)                                    \
  BENCHMARK(name)                                                  \
      ->ArgName("unit")                                            \
      ->DenseRange(0, static_cast<int>(vector_units().size()) - 1) \
      ->Unit(benchmark::kMillisecond)
ORBSLAM_BENCHMARK(extract);
ORBSLAM_BENCHMARK(pyramid);
ORBSLAM_BENCHMARK(corners);
ORBSLAM_BENCHMARK(quadtree);
ORBSLAM_BENCHMARK(blur);
ORBSLAM_BENCHMARK(orientation);
ORBSLAM_BENCHMARK(descriptors);

}  // namespace
}  // namespace orbslam

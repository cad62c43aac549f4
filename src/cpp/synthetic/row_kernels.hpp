// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "base/vector_unit.hpp"

// The inner loops of the renderer over the pixels of an image row. row_kernels.cpp is their one
// source, compiled for every vector unit.

namespace orbslam::synthetic {

/// value(x) = at_zero + slope * x along one image row.
struct Line {
  double at_zero, slope;
  double operator()(int x) const { return at_zero + slope * x; }
};

/// The bitmaps of a texture, finest first, as the kernels read them.
struct TextureLevels {
  static constexpr int kMost = 32;
  const std::uint8_t* pixels;  ///< of all levels; readable for 3 bytes more
  int count;
  std::int32_t offset[kMost], stride[kMost];
  float max_x[kMost], max_y[kMost];  ///< centre of the last pixel
};

/// One rectangle along one image row: inverse depth, and the plane coordinates a and b divided by
/// depth [1/m, and metres per metre], with their increments from one row to the next.
struct TexturedRow {
  Line inverse_depth, a, b;
  double inverse_depth_down, a_down, b_down;
  double texels_per_metre;
  const TextureLevels* levels;
};

/// Pixels by which every row buffer handed to a kernel must be longer than the image is wide.
inline constexpr int kRowPadding = 16;
/// Samples of a pixel whose footprint on the texture is long and narrow.
inline constexpr int kMostTaps = 4;

/// All inner loops for one vector unit. Each gives the same bytes.
struct RowKernels {
  /// Pixels first..last where inverse_depth is larger than in `nearest` are `owner`'s.
  void (*claim)(Line inverse_depth, int first, int last, std::int64_t owner, double* nearest,
                std::int64_t* owners);

  /// Grey level and depth [metres] of pixels begin..end - 1, as the mean of the texture over each
  /// pixel's footprint: a parallelogram of which a few samples along the longer side are taken,
  /// each over a square of the shorter one. May write up to kRowPadding pixels more.
  void (*shade)(const TexturedRow& row, int begin, int end, float* grey, float* depth);

  /// A row of the image from grey levels: times `exposure`, plus normal noise of deviation `noise`
  /// (the sum of four uniform 16-bit numbers, by the hash of `noise_seed` and the pixel), rounded.
  /// May write up to kRowPadding pixels more.
  void (*expose)(const float* grey, int width, float exposure, float noise,
                 std::uint64_t noise_seed, std::uint32_t y, std::uint8_t* out);
};

/// The ones for a unit that this processor has.
const RowKernels& row_kernels_for(VectorUnit unit);

}  // namespace orbslam::synthetic

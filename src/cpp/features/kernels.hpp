// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/vector_unit.hpp"

// The inner loops of the extractor as plain functions over pointers. kernels.cpp is their one
// source, compiled for every vector unit.

namespace orbslam {

/// A FAST corner of one pyramid level, in pixels relative to (16, 16) of that level.
struct Corner {
  std::uint16_t x;
  std::uint16_t y;
  std::int32_t response;  ///< largest threshold at which the pixel is still a corner
};

/// Half lengths of the rows of the orientation disc of radius 15, by distance from the centre row.
inline constexpr int disc_radius = 15;
inline constexpr std::uint8_t disc_half_length[disc_radius + 1] = {15, 15, 15, 15, 14, 14, 14, 13,
                                                                   13, 12, 11, 10, 9,  8,  6,  3};

/// Separable 7-tap Gaussian of sigma 2 in units of 1/256.
inline constexpr int blur_radius = 3;
inline constexpr std::uint8_t blur_taps[7] = {18, 34, 48, 56, 48, 34, 18};

/// Items by which every row buffer handed to a kernel must be longer than its pixels.
inline constexpr int row_padding = 64;

/// Columns of a bilinear resize: out[i] = source[index[i]] * weights[2i] +
/// source[index[i] + 1] * weights[2i + 1], weights in units of 1/2048.
struct ResizeColumns {
  int count = 0;
  const std::int32_t* index = nullptr;
  const std::int16_t* weights = nullptr;  ///< 2 per column, padded with zeros to whole blocks
  /// The same by blocks of 8 columns: 16 source pixels from block_begin[b] on are shuffled by
  /// block_shuffle[16 b ...] into 8 pairs. Null where some block needs more than 16 pixels.
  const std::int32_t* block_begin = nullptr;
  const std::uint8_t* block_shuffle = nullptr;
};

/// All inner loops for one vector unit. Each gives the same bytes. What they compute:
/// docs/method/features.md#pyramid and what follows it.
struct Kernels {
  /// FAST-9-16 scores of `count` neighbouring pixels from `centre` on; 0 for pixels that are no
  /// corner at `threshold` (>= 1). Reads 3 pixels around the run.
  void (*fast_scores)(const std::uint8_t* centre, std::ptrdiff_t stride, int count, int threshold,
                      std::uint8_t* scores);

  /// Pixels of a width x height block of scores that exceed all 8 neighbours, row-major.
  /// Reads one pixel around the block and `row_padding` behind each row. `out` has room for a
  /// quarter of the pixels, sides rounded up. Returns how many were written.
  int (*local_maxima)(const std::uint8_t* scores, std::ptrdiff_t stride, int width, int height,
                      Corner* out);

  /// One row of the resize, in units of 1/128 grey levels.
  void (*resize_row)(const std::uint8_t* source, const ResizeColumns& columns, std::int16_t* out);
  /// Blends two such rows, weights in units of 1/2048.
  void (*resize_blend)(const std::int16_t* upper, const std::int16_t* lower, int upper_weight,
                       int lower_weight, int count, std::uint8_t* out);

  /// Vertical pass of the blur: sums over 7 rows in units of 1/256, minus 32768.
  void (*blur_columns)(const std::uint8_t* const rows[7], int count, std::int16_t* sums);
  /// Horizontal pass over such sums, which start 3 pixels left of the row. May read and write up to
  /// `row_padding` too many.
  void (*blur_row)(const std::int16_t* sums, int count, std::uint8_t* out);

  /// First moments of the disc of radius 15: m10 = sum u I, m01 = sum v I.
  /// Reads the 32 x 31 pixels from (-15, -15) on.
  void (*moments)(const std::uint8_t* centre, std::ptrdiff_t stride, std::int32_t* m10,
                  std::int32_t* m01);

  /// The 256 tests of BRIEF, pattern rotated by the angle with this cosine and sine.
  /// Reads 18 pixels around the centre and up to 3 bytes behind each.
  void (*brief)(const std::uint8_t* centre, std::ptrdiff_t stride, float cosine, float sine,
                std::uint8_t* descriptor);
};

/// Those of a unit that this processor has.
const Kernels& kernels_for(VectorUnit unit);

}  // namespace orbslam

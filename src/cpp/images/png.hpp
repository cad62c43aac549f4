// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

namespace orbslam {

/// The bytes of a file.
struct FileContent {
  const std::uint8_t* data = nullptr;
  std::size_t size = 0;
};

/// What the pixels of a PNG file are.
struct PngKind {
  int width = 0, height = 0;
  int channels = 0;  ///< 1: grey, 3: colour, 4: colour and alpha
  int bits = 0;      ///< of a channel: 8 or 16

  std::size_t row_bytes() const {
    return static_cast<std::size_t>(width) * static_cast<std::size_t>(channels * bits / 8);
  }
  std::size_t bytes() const { return row_bytes() * static_cast<std::size_t>(height); }
};

/// A PNG file whose pixels are not decoded yet.
struct PngFile {
  PngKind kind;
  std::vector<std::uint8_t> compressed;  ///< the pixels, as one stream
};

/// Open a PNG file as cameras and data sets write it: grey, colour or colour with alpha, 8 or 16
/// bits, not interlaced, one image without a palette or a transparent colour. Nothing for any other
/// file, also a broken one: those are left to a library that knows every kind and says what is
/// wrong. See docs/decisions.md#d51.
std::optional<PngFile> open_png(FileContent content);

/// Decode it: rows from the top, colours in the order blue, green, red, alpha as OpenCV has them,
/// numbers of 16 bits in the machine's order. `pixels` holds kind.bytes(). Returns false where the
/// stream is broken; then the pixels mean nothing.
bool decode_png(const PngFile& file, std::uint8_t* pixels);

}  // namespace orbslam

// SPDX-License-Identifier: BSD-3-Clause
// W3C, "Portable Network Graphics (PNG) Specification (Second Edition)", 2003: chunks (section 5),
// filters (section 9). Inflating and checksums are libdeflate's.
#include "images/png.hpp"

#include <libdeflate.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <utility>
#include <vector>

namespace orbslam {
namespace {

constexpr std::array<std::uint8_t, 8> kSignature = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1A, '\n'};
constexpr std::size_t kChunkFrame = 12;  // length, name and checksum around a chunk's bytes
constexpr std::size_t kHeaderBytes = 13;
constexpr std::uint32_t kLargestSide = 1U << 20;  // OpenCV's
constexpr std::size_t kMostBytes = std::size_t{1} << 30;
// Deflate writes at least one bit for 258 bytes: no file holds more than that.
constexpr std::size_t kLargestRatio = 1032;

std::uint32_t big_endian(const std::uint8_t* bytes) {
  return static_cast<std::uint32_t>(bytes[0]) << 24 | static_cast<std::uint32_t>(bytes[1]) << 16 |
         static_cast<std::uint32_t>(bytes[2]) << 8 | bytes[3];
}

struct Chunk {
  const std::uint8_t* name = nullptr;
  const std::uint8_t* data = nullptr;
  std::size_t size = 0;

  bool is(const char* wanted) const { return std::memcmp(name, wanted, 4) == 0; }
  /// Whether a reader must know the chunk.
  bool critical() const { return (name[0] & 0x20) == 0; }
};

/// The chunks of a file one after the other.
class Chunks {
 public:
  explicit Chunks(FileContent file) : at_(file.data), left_(file.size) {
    const bool png =
        left_ >= kSignature.size() && std::memcmp(at_, kSignature.data(), kSignature.size()) == 0;
    png ? skip(kSignature.size()) : skip(left_);
  }

  /// None at the end of the file, or at a damaged chunk.
  std::optional<Chunk> next() {
    if (left_ < kChunkFrame) return std::nullopt;
    const std::size_t size = big_endian(at_);
    if (size > left_ - kChunkFrame) return std::nullopt;
    const Chunk chunk{at_ + 4, at_ + 8, size};
    const std::uint32_t told = big_endian(chunk.data + size);
    if (libdeflate_crc32(0, chunk.name, size + 4) != told) return std::nullopt;
    skip(kChunkFrame + size);
    return chunk;
  }

 private:
  void skip(std::size_t n) {
    at_ += n;
    left_ -= n;
  }

  const std::uint8_t* at_;
  std::size_t left_;
};

std::optional<PngKind> kind_of_header(const Chunk& header) {
  if (!header.is("IHDR") || header.size != kHeaderBytes) return std::nullopt;
  const std::uint32_t width = big_endian(header.data), height = big_endian(header.data + 4);
  if (width < 1 || height < 1 || width > kLargestSide || height > kLargestSide) return std::nullopt;
  const int bits = header.data[8], colour = header.data[9];
  const bool plain = header.data[10] == 0 && header.data[11] == 0 && header.data[12] == 0;
  if (!plain || (bits != 8 && bits != 16)) return std::nullopt;
  const int channels = colour == 0 ? 1 : colour == 2 ? 3 : colour == 6 ? 4 : 0;
  if (channels == 0) return std::nullopt;
  return PngKind{static_cast<int>(width), static_cast<int>(height), channels, bits};
}

/// Fills `out`, whose size is known.
bool inflate(const std::vector<std::uint8_t>& data, std::vector<std::uint8_t>& out) {
  const std::unique_ptr<libdeflate_decompressor, void (*)(libdeflate_decompressor*)> inflater(
      libdeflate_alloc_decompressor(), libdeflate_free_decompressor);
  if (inflater == nullptr) return false;
  return libdeflate_zlib_decompress(inflater.get(), data.data(), data.size(), out.data(),
                                    out.size(), nullptr) == LIBDEFLATE_SUCCESS;
}

// ---- filters: what was subtracted from each byte of a row before it was compressed
// --------------------------

/// Of left, above and above left the one that is next to left + above - above left, in this order
/// of equals. Without branches: their outcome would be unpredictable, and the next pixel depends on
/// this one.
inline int paeth(int left, int above, int corner) {
  const int to_left = std::abs(above - corner), to_above = std::abs(left - corner);
  const int to_corner = std::abs(above + left - 2 * corner);
  const int use_above = -static_cast<int>(to_above < to_left);  // all bits or none
  const int side = left ^ ((left ^ above) & use_above);
  const int use_corner = -static_cast<int>(to_corner < std::min(to_left, to_above));
  return side ^ ((side ^ corner) & use_corner);
}

template <int kPixel>
void add_left(std::uint8_t* row, std::size_t n) {
  std::array<std::uint8_t, kPixel> left{};
  for (std::size_t i = 0; i < n; i += kPixel) {
    for (int c = 0; c < kPixel; ++c) {
      left[c] = static_cast<std::uint8_t>(left[c] + row[i + c]);
      row[i + c] = left[c];
    }
  }
}

void add_above(std::uint8_t* row, const std::uint8_t* above, std::size_t n) {
  for (std::size_t i = 0; i < n; ++i) row[i] = static_cast<std::uint8_t>(row[i] + above[i]);
}

template <int kPixel>
void add_average(std::uint8_t* row, const std::uint8_t* above, std::size_t n) {
  std::array<std::uint8_t, kPixel> left{};
  for (std::size_t i = 0; i < n; i += kPixel) {
    for (int c = 0; c < kPixel; ++c) {
      left[c] = static_cast<std::uint8_t>(row[i + c] + (left[c] + above[i + c]) / 2);
      row[i + c] = left[c];
    }
  }
}

template <int kPixel>
void add_paeth(std::uint8_t* row, const std::uint8_t* above, std::size_t n) {
  std::array<int, kPixel> left{}, corner{};
  for (std::size_t i = 0; i < n; i += kPixel) {
    for (int c = 0; c < kPixel; ++c) {
      const int up = above[i + c];
      left[c] = (row[i + c] + paeth(left[c], up, corner[c])) & 0xFF;
      corner[c] = up;
      row[i + c] = static_cast<std::uint8_t>(left[c]);
    }
  }
}

/// Grey pixels of a row, one after the other.
struct PaethChain {
  std::uint8_t* row;
  const std::uint8_t* above;
  int left = 0, corner = 0;

  void restore(std::size_t x) {
    const int up = above[x];
    left = (row[x] + paeth(left, up, corner)) & 0xFF;
    corner = up;
    row[x] = static_cast<std::uint8_t>(left);
  }
};

/// Two rows of grey pixels, the lower one a pixel behind: while one waits for its neighbour, so
/// does the other.
void add_paeth_to_two(std::uint8_t* row, std::uint8_t* below, const std::uint8_t* above,
                      std::size_t n) {
  PaethChain upper{row, above}, lower{below, row};
  upper.restore(0);
  for (std::size_t x = 1; x < n; ++x) {
    upper.restore(x);
    lower.restore(x - 1);
  }
  lower.restore(n - 1);
}

constexpr int kPaeth = 4;

template <int kPixel>
bool unfilter_row(int filter, std::uint8_t* row, const std::uint8_t* above, std::size_t n) {
  switch (filter) {
    case 0:
      return true;
    case 1:
      add_left<kPixel>(row, n);
      return true;
    case 2:
      add_above(row, above, n);
      return true;
    case 3:
      add_average<kPixel>(row, above, n);
      return true;
    case 4:
      add_paeth<kPixel>(row, above, n);
      return true;
    default:
      return false;
  }
}

// ---- from a file's order of bytes to ours
// --------------------------------------------------------------------

template <int kChannels>
void copy_row_8(const std::uint8_t* row, std::uint8_t* out, std::size_t n) {
  if constexpr (kChannels == 1) {
    std::memcpy(out, row, n);
  } else {
    for (std::size_t i = 0; i < n; i += kChannels) {
      out[i] = row[i + 2];
      out[i + 1] = row[i + 1];
      out[i + 2] = row[i];
      if constexpr (kChannels == 4) out[i + 3] = row[i + 3];
    }
  }
}

template <int kChannels>
void copy_row_16(const std::uint8_t* row, std::uint8_t* out, std::size_t n) {
  for (std::size_t i = 0; i < n; i += 2 * kChannels) {
    for (int c = 0; c < kChannels; ++c) {
      const int from = kChannels >= 3 && c < 3 ? 2 - c : c;
      const std::uint8_t* bytes = row + i + 2 * from;
      const auto value = static_cast<std::uint16_t>(bytes[0] << 8 | bytes[1]);
      std::memcpy(out + i + 2 * c, &value, sizeof value);
    }
  }
}

/// Takes the filters off the rows, each with the number of its filter in front.
template <int kPixel>
bool unfilter(const PngKind& kind, std::vector<std::uint8_t>& rows) {
  const std::size_t n = kind.row_bytes();
  const std::vector<std::uint8_t> zeros(n);
  const std::uint8_t* above = zeros.data();
  std::uint8_t* row = rows.data();
  for (int y = 0; y < kind.height; ++y) {
    const bool two = kPixel == 1 && y + 1 < kind.height && row[0] == kPaeth && row[n + 1] == kPaeth;
    if (two) {
      add_paeth_to_two(row + 1, row + n + 2, above, n);
      ++y;
      row += n + 1;
    } else if (!unfilter_row<kPixel>(row[0], row + 1, above, n)) {
      return false;
    }
    above = row + 1;
    row += n + 1;
  }
  return true;
}

template <int kChannels, int kBytes>
bool restore(const PngKind& kind, std::vector<std::uint8_t>& rows, std::uint8_t* out) {
  if (!unfilter<kChannels * kBytes>(kind, rows)) return false;
  const std::size_t n = kind.row_bytes();
  const std::uint8_t* row = rows.data() + 1;
  for (int y = 0; y < kind.height; ++y, row += n + 1, out += n) {
    kBytes == 1 ? copy_row_8<kChannels>(row, out, n) : copy_row_16<kChannels>(row, out, n);
  }
  return true;
}

}  // namespace

std::optional<PngFile> open_png(FileContent content) {
  Chunks chunks(content);
  const auto header = chunks.next();
  if (!header) return std::nullopt;
  const auto kind = kind_of_header(*header);
  if (!kind || kind->bytes() > kMostBytes || kind->bytes() / kLargestRatio > content.size) {
    return std::nullopt;
  }
  PngFile file{*kind, {}};
  file.compressed.reserve(content.size);
  while (const auto chunk = chunks.next()) {
    if (chunk->is("IEND")) return file;
    if (chunk->is("IDAT")) {
      file.compressed.insert(file.compressed.end(), chunk->data, chunk->data + chunk->size);
    } else if (chunk->critical() || chunk->is("tRNS") || chunk->is("acTL")) {
      return std::nullopt;  // a palette or something new; a transparent colour; several images
    }
  }
  return std::nullopt;  // the end is missing
}

bool decode_png(const PngFile& file, std::uint8_t* pixels) {
  const PngKind& kind = file.kind;
  std::vector<std::uint8_t> rows(kind.bytes() + static_cast<std::size_t>(kind.height));
  if (!inflate(file.compressed, rows)) return false;
  const bool deep = kind.bits == 16;
  switch (kind.channels) {
    case 1:
      return deep ? restore<1, 2>(kind, rows, pixels) : restore<1, 1>(kind, rows, pixels);
    case 3:
      return deep ? restore<3, 2>(kind, rows, pixels) : restore<3, 1>(kind, rows, pixels);
    default:
      return deep ? restore<4, 2>(kind, rows, pixels) : restore<4, 1>(kind, rows, pixels);
  }
}

}  // namespace orbslam

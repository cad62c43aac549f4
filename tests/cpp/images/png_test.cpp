// SPDX-License-Identifier: BSD-3-Clause
#include "images/png.hpp"

#include <gtest/gtest.h>
#include <libdeflate.h>

#include <array>
#include <cstdlib>
#include <cstring>
#include <random>
#include <string>
#include <vector>

namespace orbslam {
namespace {

using Bytes = std::vector<std::uint8_t>;

void append_number(Bytes& out, std::uint32_t value) {
  for (int shift = 24; shift >= 0; shift -= 8)
    out.push_back(static_cast<std::uint8_t>(value >> shift));
}

void append_chunk(Bytes& out, const std::string& name, const Bytes& data) {
  append_number(out, static_cast<std::uint32_t>(data.size()));
  const std::size_t start = out.size();
  out.insert(out.end(), name.begin(), name.end());
  out.insert(out.end(), data.begin(), data.end());
  append_number(out, libdeflate_crc32(0, out.data() + start, out.size() - start));
}

Bytes deflated(const Bytes& data) {
  libdeflate_compressor* compressor = libdeflate_alloc_compressor(6);
  Bytes out(libdeflate_zlib_compress_bound(compressor, data.size()));
  out.resize(
      libdeflate_zlib_compress(compressor, data.data(), data.size(), out.data(), out.size()));
  libdeflate_free_compressor(compressor);
  return out;
}

Bytes header_of(const PngKind& kind, std::uint8_t interlace = 0) {
  Bytes header;
  append_number(header, static_cast<std::uint32_t>(kind.width));
  append_number(header, static_cast<std::uint32_t>(kind.height));
  const int colour = kind.channels == 1 ? 0 : kind.channels == 3 ? 2 : 6;
  for (const int value : {kind.bits, colour, 0, 0, static_cast<int>(interlace)}) {
    header.push_back(static_cast<std::uint8_t>(value));
  }
  return header;
}

// What the standard says is predicted of a byte, in its own words (section 9.2).
int predicted(int filter, int a, int b, int c) {
  const int p = a + b - c;
  const int pa = std::abs(p - a), pb = std::abs(p - b), pc = std::abs(p - c);
  switch (filter) {
    case 1:
      return a;
    case 2:
      return b;
    case 3:
      return (a + b) / 2;
    case 4:
      return pa <= pb && pa <= pc ? a : pb <= pc ? b : c;
    default:
      return 0;
  }
}

// Rows as a file holds them: big-endian, red first. `filters` are taken in turns.
Bytes filtered(const PngKind& kind, const Bytes& rows, const std::vector<int>& filters) {
  const auto pixel = static_cast<std::size_t>(kind.channels * kind.bits / 8);
  const std::size_t n = kind.row_bytes();
  Bytes out;
  for (std::size_t y = 0; y < static_cast<std::size_t>(kind.height); ++y) {
    const int filter = filters[y % filters.size()];
    out.push_back(static_cast<std::uint8_t>(filter));
    for (std::size_t i = 0; i < n; ++i) {
      const int a = i >= pixel ? rows[y * n + i - pixel] : 0;
      const int b = y > 0 ? rows[(y - 1) * n + i] : 0;
      const int c = y > 0 && i >= pixel ? rows[(y - 1) * n + i - pixel] : 0;
      out.push_back(static_cast<std::uint8_t>(rows[y * n + i] - predicted(filter, a, b, c)));
    }
  }
  return out;
}

Bytes file_of(const Bytes& header, const Bytes& stream, std::size_t part = 1U << 20,
              const std::string& other = "tEXt") {
  Bytes file = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1A, '\n'};
  append_chunk(file, "IHDR", header);
  append_chunk(file, other, {'a', 0, 'b'});
  for (std::size_t at = 0; at < stream.size(); at += part) {
    const auto begin = stream.begin() + static_cast<std::ptrdiff_t>(at);
    append_chunk(
        file, "IDAT",
        Bytes(begin, begin + static_cast<std::ptrdiff_t>(std::min(part, stream.size() - at))));
  }
  append_chunk(file, "IEND", {});
  return file;
}

// Smooth with some noise, so that every filter is of use and every branch of the last one is taken.
Bytes rows_of(const PngKind& kind, std::uint32_t seed) {
  std::mt19937 generator(seed);
  Bytes rows(kind.bytes());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    rows[i] = static_cast<std::uint8_t>(i / 7 + i / kind.row_bytes() * 3 + generator() % 19);
  }
  return rows;
}

// What is expected in memory: blue first, the machine's order of bytes.
Bytes in_memory(const PngKind& kind, const Bytes& rows) {
  const auto bytes = static_cast<std::size_t>(kind.bits / 8);
  const auto channels = static_cast<std::size_t>(kind.channels);
  Bytes out(rows.size());
  for (std::size_t i = 0; i < rows.size(); i += bytes) {
    const std::size_t channel = i / bytes % channels;
    const std::size_t to = channels >= 3 && channel < 3 ? i + bytes * 2 - 2 * bytes * channel : i;
    if (bytes == 1) {
      out[to] = rows[i];
    } else {
      const auto value = static_cast<std::uint16_t>(rows[i] << 8 | rows[i + 1]);
      std::memcpy(out.data() + to, &value, 2);
    }
  }
  return out;
}

FileContent content_of(const Bytes& bytes) { return {bytes.data(), bytes.size()}; }

std::optional<Bytes> decoded(const Bytes& bytes) {
  const auto file = open_png(content_of(bytes));
  if (!file) return std::nullopt;
  Bytes pixels(file->kind.bytes());
  return decode_png(*file, pixels.data()) ? std::optional(pixels) : std::nullopt;
}

TEST(Png, EveryKindWithEveryFilterGivesItsPixels) {
  const std::vector<std::vector<int>> choices = {{0}, {1},       {2},          {3},
                                                 {4}, {4, 4, 1}, {4, 4, 4, 0}, {3, 1, 4, 2, 0}};
  for (const int channels : {1, 3, 4}) {
    for (const int bits : {8, 16}) {
      for (const auto& filters : choices) {
        for (const int width : {1, 2, 33}) {
          const PngKind kind{width, 21, channels, bits};
          const Bytes rows = rows_of(kind, static_cast<std::uint32_t>(width + bits));
          const Bytes file = file_of(header_of(kind), deflated(filtered(kind, rows, filters)));
          EXPECT_EQ(decoded(file), in_memory(kind, rows))
              << channels << " channels of " << bits << " bits";
        }
      }
    }
  }
}

TEST(Png, AStreamMayComeInManyParts) {
  const PngKind kind{40, 30, 1, 8};
  const Bytes rows = rows_of(kind, 3);
  const Bytes stream = deflated(filtered(kind, rows, {4}));
  EXPECT_EQ(decoded(file_of(header_of(kind), stream, 7)), rows);
}

TEST(Png, OtherKindsAreLeftToOthers) {
  const PngKind kind{8, 8, 1, 8};
  const Bytes stream = deflated(filtered(kind, rows_of(kind, 4), {0}));
  ASSERT_TRUE(decoded(file_of(header_of(kind), stream)));
  EXPECT_FALSE(open_png(content_of(file_of(header_of(kind, 1), stream))));  // interlaced
  for (const char* other : {"tRNS", "acTL", "PLTE", "NewX"}) {
    EXPECT_FALSE(open_png(content_of(file_of(header_of(kind), stream, 1000, other)))) << other;
  }
  for (const auto& [bits, colour] : {std::pair{4, 0}, {8, 3}, {8, 4}, {8, 9}, {1, 0}}) {
    Bytes header = header_of(kind);
    header[8] = static_cast<std::uint8_t>(bits);
    header[9] = static_cast<std::uint8_t>(colour);
    EXPECT_FALSE(open_png(content_of(file_of(header, stream)))) << bits << ", " << colour;
  }
  EXPECT_FALSE(open_png({}));
  const Bytes jpeg = {0xFF, 0xD8, 0xFF, 0xE0, 0, 16, 'J', 'F', 'I', 'F',
                      0,    1,    1,    0,    0, 1,  0,   1,   0,   0};
  EXPECT_FALSE(open_png(content_of(jpeg)));
}

TEST(Png, ALieAboutTheSizeIsNotBelieved) {
  PngKind kind{8, 8, 1, 8};
  const Bytes stream = deflated(filtered(kind, rows_of(kind, 5), {0}));
  for (const int side : {0, 1 << 20, 0x7FFFFFFF}) {
    kind.width = kind.height = side;
    EXPECT_FALSE(open_png(content_of(file_of(header_of(kind), stream)))) << side;
  }
  for (const int height : {7, 9}) {  // too much in the stream, too little
    const PngKind other{8, height, 1, 8};
    EXPECT_FALSE(decoded(file_of(header_of(other), stream))) << height;
  }
}

TEST(Png, AnUnknownFilterIsRefused) {
  const PngKind kind{4, 2, 1, 8};
  Bytes data = filtered(kind, rows_of(kind, 6), {0});
  data[0] = 5;
  EXPECT_FALSE(decoded(file_of(header_of(kind), deflated(data))));
}

// Every checksum is looked at: what is spoilt is refused, wherever it is, and nothing is read
// beyond the end.
TEST(Png, SpoiltFilesAreRefused) {
  const PngKind kind{37, 19, 3, 8};
  const Bytes whole =
      file_of(header_of(kind), deflated(filtered(kind, rows_of(kind, 7), {4, 3})), 200);
  const auto right = decoded(whole);
  ASSERT_TRUE(right);
  std::mt19937 generator(8);
  for (int turn = 0; turn < 3000; ++turn) {
    Bytes spoilt = whole;
    if (turn % 3 == 0) spoilt.resize(generator() % whole.size());
    if (turn % 3 != 0)
      spoilt[generator() % spoilt.size()] ^= static_cast<std::uint8_t>(1U << generator() % 8);
    if (turn % 3 == 2) spoilt[generator() % spoilt.size()] = static_cast<std::uint8_t>(generator());
    const auto pixels = decoded(spoilt);
    EXPECT_TRUE(!pixels || pixels == right);
  }
}

// The same where the checksums of chunks are right again, as of a file written so on purpose.
TEST(Png, SpoiltStreamsWithRightChecksumsDoNoHarm) {
  const PngKind kind{37, 19, 1, 16};
  const Bytes stream = deflated(filtered(kind, rows_of(kind, 9), {4, 3, 1}));
  const auto right = decoded(file_of(header_of(kind), stream));
  std::mt19937 generator(10);
  for (int turn = 0; turn < 2000; ++turn) {
    Bytes spoilt = stream;
    spoilt[generator() % spoilt.size()] ^= static_cast<std::uint8_t>(1U << generator() % 8);
    // The stream has a checksum of its own, which the bits that fill its last byte are no part of.
    const auto pixels = decoded(file_of(header_of(kind), spoilt));
    EXPECT_TRUE(!pixels || pixels == right);
  }
}

}  // namespace
}  // namespace orbslam

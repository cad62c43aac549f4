// SPDX-License-Identifier: BSD-3-Clause
#include "synthetic/texture.hpp"

#include <algorithm>
#include <array>

#include "synthetic/hash.hpp"
#include "synthetic/pi.hpp"

namespace orbslam::synthetic {
namespace {

constexpr int kOctaves = 7;
constexpr double kFinestCell = 8;  // texels
// Shapes per cell, finest octave first. Sparse in the small: walls are not gravel.
constexpr std::array<double, kOctaves> kDensity = {0.10, 0.16, 0.24, 0.34, 0.45, 0.6, 0.7};
// Small things come in clusters: the density of a cell depends on the block of 8 x 8 cells of its
// octave it lies in. The factors have mean 1.
constexpr std::array<double, 4> kClutter = {0.15, 0.45, 1.0, 2.4};
constexpr int kFirstEvenOctave = 4;  // from 0.5 m on there are no clusters

/// A picture while it is painted; grey levels times 16, so that blending does not lose steps.
struct Canvas {
  int width, height;
  std::vector<std::int16_t> pixels;
};

struct Polygon {
  static constexpr int kMaxCorners = 6;
  int corners = 0;
  std::array<double, kMaxCorners> x{}, y{};  // texels, counter-clockwise seen with y down
};

/// A rectangle, mostly hanging straight, sometimes askew: posters, doors, tiles.
Polygon random_panel(HashStream& random, double cx, double cy, double radius) {
  Polygon polygon;
  polygon.corners = 4;
  const double flatness = random.uniform(0.35, 1.0);
  const bool upright = random.below(2) == 0;
  const double a = radius * (upright ? flatness : 1.0);
  const double b = radius * (upright ? 1.0 : flatness);
  const double most = random.below(3) == 0 ? 0.6 : 0.04;
  const double turn = random.uniform(-most, most);
  const double cosine = std::cos(turn);
  const double sine = std::sin(turn);
  const std::array<double, 4> along = {-a, a, a, -a};
  const std::array<double, 4> down = {-b, -b, b, b};
  for (std::size_t i = 0; i < 4; ++i) {
    polygon.x[i] = cx + cosine * along[i] - sine * down[i];
    polygon.y[i] = cy + sine * along[i] + cosine * down[i];
  }
  return polygon;
}

/// A convex polygon inscribed in an ellipse, hence never degenerate or self-crossing.
Polygon random_polygon(HashStream& random, double cx, double cy, double radius) {
  Polygon polygon;
  polygon.corners = 3 + random.below(Polygon::kMaxCorners - 2);
  const double flatness = random.uniform(0.45, 1.0);
  const double turn = random.uniform(0, kPi);
  const double start = random.uniform(0, 2 * kPi);
  const double cosine = std::cos(turn);
  const double sine = std::sin(turn);
  for (int i = 0; i < polygon.corners; ++i) {
    const double angle = start + 2 * kPi * (i + random.uniform(-0.25, 0.25)) / polygon.corners;
    const double a = radius * std::cos(angle);
    const double b = radius * flatness * std::sin(angle);
    polygon.x[static_cast<std::size_t>(i)] = cx + cosine * a - sine * b;
    polygon.y[static_cast<std::size_t>(i)] = cy + sine * a + cosine * b;
  }
  return polygon;
}

/// The columns of row `y` inside the polygon, as [first, last].
void columns_inside(const Polygon& polygon, double y, double& first, double& last) {
  first = 1e18;
  last = -1e18;
  for (int i = 0; i < polygon.corners; ++i) {
    const auto a = static_cast<std::size_t>(i);
    const auto b = static_cast<std::size_t>((i + 1) % polygon.corners);
    if ((polygon.y[a] <= y) == (polygon.y[b] <= y)) continue;
    const double f = (y - polygon.y[a]) / (polygon.y[b] - polygon.y[a]);
    const double x = polygon.x[a] + f * (polygon.x[b] - polygon.x[a]);
    first = std::min(first, x);
    last = std::max(last, x);
  }
}

void paint(Canvas& canvas, const Polygon& polygon, int grey, int opacity) {
  const auto end = static_cast<std::ptrdiff_t>(polygon.corners);
  const auto [low, high] = std::minmax_element(polygon.y.begin(), polygon.y.begin() + end);
  const int y_begin = std::max(0, static_cast<int>(std::ceil(*low)));
  const int y_end = std::min(canvas.height - 1, static_cast<int>(std::floor(*high)));
  for (int y = y_begin; y <= y_end; ++y) {
    double first = 0;
    double last = 0;
    columns_inside(polygon, y, first, last);
    if (first > last) continue;
    const int x_begin = std::max(0, static_cast<int>(std::ceil(first)));
    const int x_end = std::min(canvas.width - 1, static_cast<int>(std::floor(last)));
    std::int16_t* row = canvas.pixels.data() + static_cast<std::ptrdiff_t>(y) * canvas.width;
    for (int x = x_begin; x <= x_end; ++x) {
      row[x] = static_cast<std::int16_t>(row[x] + ((grey * 16 - row[x]) * opacity) / 256);
    }
  }
}

/// The lattice of one octave over the endless wall.
struct Lattice {
  double cell;          // metres
  std::int64_t period;  // cells along u after which the picture comes again; 0: never
  int octave;
  std::uint64_t seed;

  Lattice(const Rectangle& rectangle, int octave_in)
      : cell(kFinestCell * rectangle.texel * std::ldexp(1.0, octave_in)),
        period(0),
        octave(octave_in),
        seed(mix(rectangle.texture, static_cast<std::uint64_t>(octave_in))) {
    if (rectangle.texture_repeat > 0) {
      period = std::max<std::int64_t>(1, std::llround(rectangle.texture_repeat / cell));
      cell = rectangle.texture_repeat / static_cast<double>(period);
    }
  }

  std::int64_t index(double metres) const {
    return static_cast<std::int64_t>(std::floor(metres / cell));
  }
  std::uint64_t hash(std::int64_t i, std::int64_t j) const {
    const std::int64_t column = period > 0 ? ((i % period) + period) % period : i;
    return mix(mix(seed, static_cast<std::uint64_t>(column)), static_cast<std::uint64_t>(j));
  }
  double density(std::int64_t i, std::int64_t j) const {
    const double mean = kDensity[static_cast<std::size_t>(octave)];
    if (octave >= kFirstEvenOctave) return mean;
    const std::int64_t column = period > 0 ? ((i % period) + period) % period : i;
    // >> rounds down for negative cells too.
    const std::uint64_t block = mix(mix(~seed, static_cast<std::uint64_t>(column >> 3)),
                                    static_cast<std::uint64_t>(j >> 3));
    return mean * kClutter[block & 3];
  }
};

/// The shapes of one size. Each cell of the lattice owns at most one, so that any cut-out of the
/// wall shows the same picture.
void paint_octave(Canvas& canvas, const Rectangle& rectangle, int octave) {
  const Lattice lattice(rectangle, octave);
  const double u = rectangle.texture_offset;
  const double v = rectangle.texture_offset_v;
  const double cell = lattice.cell;
  const double texel = rectangle.texel;
  for (std::int64_t j = lattice.index(v) - 1; j <= lattice.index(v + rectangle.height) + 1; ++j) {
    for (std::int64_t i = lattice.index(u) - 1; i <= lattice.index(u + rectangle.width) + 1; ++i) {
      HashStream random(lattice.hash(i, j));
      if (random.uniform(0, 1) > lattice.density(i, j)) continue;
      // Pixel centres are at half texels.
      const double x =
          ((static_cast<double>(i) + random.uniform(0.1, 0.9)) * cell - u) / texel - 0.5;
      const double y =
          ((static_cast<double>(j) + random.uniform(0.1, 0.9)) * cell - v) / texel - 0.5;
      const double radius = cell / texel * random.uniform(0.25, 0.6);
      const int grey = 8 + random.below(240);
      const int opacity = 110 + random.below(130);
      if (random.below(5) < 3) {
        paint(canvas, random_panel(random, x, y, radius), grey, opacity);
      } else {
        paint(canvas, random_polygon(random, x, y, radius), grey, opacity);
      }
    }
  }
}

/// Binomial filter over 3 x 3 texels: takes the staircase off the polygons' edges.
std::vector<std::uint8_t> smoothed(const Canvas& canvas) {
  const auto width = static_cast<std::size_t>(canvas.width);
  const auto height = static_cast<std::size_t>(canvas.height);
  std::vector<std::uint8_t> result(width * height);
  std::vector<int> column(width);
  for (std::size_t y = 0; y < height; ++y) {
    const std::int16_t* above = canvas.pixels.data() + (y > 0 ? y - 1 : y) * width;
    const std::int16_t* here = canvas.pixels.data() + y * width;
    const std::int16_t* below = canvas.pixels.data() + (y + 1 < height ? y + 1 : y) * width;
    for (std::size_t x = 0; x < width; ++x) column[x] = above[x] + 2 * here[x] + below[x];
    for (std::size_t x = 0; x < width; ++x) {
      const int left = column[x > 0 ? x - 1 : x];
      const int right = column[x + 1 < width ? x + 1 : x];
      result[y * width + x] = static_cast<std::uint8_t>((left + 2 * column[x] + right + 128) / 256);
    }
  }
  return result;
}

std::vector<std::uint8_t> halved(const std::vector<std::uint8_t>& pixels, int& width, int& height) {
  const int new_width = (width + 1) / 2;
  const int new_height = (height + 1) / 2;
  std::vector<std::uint8_t> result(static_cast<std::size_t>(new_width) *
                                   static_cast<std::size_t>(new_height));
  for (int y = 0; y < new_height; ++y) {
    const std::uint8_t* top = pixels.data() + static_cast<std::ptrdiff_t>(2 * y) * width;
    const std::uint8_t* bottom = 2 * y + 1 < height ? top + width : top;
    std::uint8_t* out = result.data() + static_cast<std::ptrdiff_t>(y) * new_width;
    for (int x = 0; x < new_width; ++x) {
      const int right = std::min(2 * x + 1, width - 1);
      out[x] = static_cast<std::uint8_t>(
          (top[2 * x] + top[right] + bottom[2 * x] + bottom[right] + 2) / 4);
    }
  }
  width = new_width;
  height = new_height;
  return result;
}

}  // namespace

Texture::Texture(const Rectangle& rectangle) : texel_(rectangle.texel) {
  int width = std::max(2, static_cast<int>(std::ceil(rectangle.width / texel_)));
  int height = std::max(2, static_cast<int>(std::ceil(rectangle.height / texel_)));
  Canvas canvas{width, height, {}};
  HashStream random(rectangle.texture);
  canvas.pixels.assign(static_cast<std::size_t>(width) * static_cast<std::size_t>(height),
                       static_cast<std::int16_t>(16 * (80 + random.below(100))));
  for (int octave = kOctaves - 1; octave >= 0; --octave) paint_octave(canvas, rectangle, octave);
  std::vector<std::uint8_t> pixels = smoothed(canvas);
  add_level(width, height, pixels);
  while (std::max(width, height) > 2) {
    pixels = halved(pixels, width, height);
    add_level(width, height, pixels);
  }
  pixels_.resize(pixels_.size() + 3);
  levels_.pixels = pixels_.data();
}

void Texture::add_level(int width, int height, const std::vector<std::uint8_t>& pixels) {
  const auto level = static_cast<std::size_t>(levels_.count++);
  const std::size_t begin = pixels_.size();
  const std::size_t stride = static_cast<std::size_t>(width) + 1;
  pixels_.resize(begin + stride * (static_cast<std::size_t>(height) + 1));
  for (int y = 0; y <= height; ++y) {
    const std::uint8_t* source =
        pixels.data() + static_cast<std::ptrdiff_t>(std::min(y, height - 1)) * width;
    std::uint8_t* row = pixels_.data() + begin + static_cast<std::size_t>(y) * stride;
    std::copy(source, source + width, row);
    row[width] = source[width - 1];
  }
  levels_.offset[level] = static_cast<std::int32_t>(begin);
  levels_.stride[level] = static_cast<std::int32_t>(stride);
  levels_.max_x[level] = static_cast<float>(width - 1);
  levels_.max_y[level] = static_cast<float>(height - 1);
}

}  // namespace orbslam::synthetic

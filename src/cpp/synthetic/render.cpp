// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cstring>
#include <limits>
#include <thread>

#include "base/errors.hpp"
#include "synthetic/hash.hpp"
#include "synthetic/texture.hpp"
#include "synthetic/world.hpp"

namespace orbslam::synthetic {
namespace {

constexpr double kNearest = 0.01;      // metres
constexpr double kFarthest = 10000.0;  // metres
// Neighbouring rectangles overlap by this much, so that no ray slips between them.
constexpr double kEdgeTolerance = 1e-6;  // metres
constexpr float kSky = 205;              // grey level where nothing is hit
constexpr int kMaxTaps = 4;

/// value(x) = at_zero + slope * x along one image row.
struct Line {
  double at_zero, slope;
  double operator()(int x) const { return at_zero + slope * x; }
};

/// A quantity that is affine in the pixel coordinates: dot(coefficients, (x, y, 1)).
struct Affine {
  double x, y, one;
  Line row(int row) const { return {y * row + one, x}; }
};

/// A rectangle in front of the camera. Inverse depth, and a and b divided by depth, are affine in
/// the pixel coordinates, which makes the cast of a whole row a loop over additions.
struct Facet {
  Affine inverse_depth, a, b;
  double width, height;
  const Texture* texture;
};

Affine to_pixels(const Eigen::Vector3d& along_ray, const RenderOptions& camera) {
  const double x = along_ray.x() / camera.fx;
  const double y = along_ray.y() / camera.fy;
  return {x, y, along_ray.z() - x * camera.cx - y * camera.cy};
}

/// Whether all corners are behind the camera or beyond the same border of the image.
bool outside_view(const Rectangle& rectangle, const Pose& T_cw, const RenderOptions& camera) {
  int out[5] = {0, 0, 0, 0, 0};
  for (int corner = 0; corner < 4; ++corner) {
    const double a = (corner & 1) != 0 ? rectangle.width : 0.0;
    const double b = (corner & 2) != 0 ? rectangle.height : 0.0;
    const Eigen::Vector3d p =
        T_cw * Eigen::Vector3d(rectangle.origin + a * rectangle.u_axis + b * rectangle.v_axis);
    const double x = camera.fx * p.x() + camera.cx * p.z();
    const double y = camera.fy * p.y() + camera.cy * p.z();
    out[0] += static_cast<int>(p.z() <= kNearest);
    out[1] += static_cast<int>(x < -p.z());
    out[2] += static_cast<int>(y < -p.z());
    out[3] += static_cast<int>(x > camera.size.width * p.z());
    out[4] += static_cast<int>(y > camera.size.height * p.z());
  }
  return std::any_of(std::begin(out), std::end(out), [](int count) { return count == 4; });
}

std::vector<Facet> facets_in_view(const World& world, const Pose& T_cw,
                                  const RenderOptions& camera) {
  std::vector<Facet> facets;
  const Eigen::Matrix3d R_cw = T_cw.rotation_matrix();
  for (std::size_t i = 0; i < world.rectangles().size(); ++i) {
    const Rectangle& rectangle = world.rectangles()[i];
    if (outside_view(rectangle, T_cw, camera)) continue;
    const Eigen::Vector3d origin = T_cw * rectangle.origin;
    const Eigen::Vector3d u = R_cw * rectangle.u_axis;
    const Eigen::Vector3d v = R_cw * rectangle.v_axis;
    const Eigen::Vector3d normal = u.cross(v);
    const double distance = normal.dot(origin);
    if (std::abs(distance) < 1e-9) continue;  // seen edge on
    const Eigen::Vector3d inverse_depth = normal / distance;
    facets.push_back({to_pixels(inverse_depth, camera),
                      to_pixels(u - u.dot(origin) * inverse_depth, camera),
                      to_pixels(v - v.dot(origin) * inverse_depth, camera), rectangle.width,
                      rectangle.height, &world.texture(i)});
  }
  return facets;
}

/// The pixels of one row on which all of a few lines are not negative.
struct Span {
  double first, last;

  void keep_where_positive(Line line) {
    if (line.slope > 0) {
      first = std::max(first, -line.at_zero / line.slope);
    } else if (line.slope < 0) {
      last = std::min(last, -line.at_zero / line.slope);
    } else if (line.at_zero < 0) {
      last = -1;
    }
  }
};

Line combined(double f, Line a, double g, Line b) {
  return {f * a.at_zero + g * b.at_zero, f * a.slope + g * b.slope};
}

Span covered_span(const Facet& facet, int y, int width) {
  const Line w = facet.inverse_depth.row(y);
  const Line a = facet.a.row(y);
  const Line b = facet.b.row(y);
  Span span{0, static_cast<double>(width - 1)};
  span.keep_where_positive({w.at_zero - 1 / kFarthest, w.slope});
  span.keep_where_positive({1 / kNearest - w.at_zero, -w.slope});
  span.keep_where_positive(combined(1, a, kEdgeTolerance, w));
  span.keep_where_positive(combined(-1, a, facet.width + kEdgeTolerance, w));
  span.keep_where_positive(combined(1, b, kEdgeTolerance, w));
  span.keep_where_positive(combined(-1, b, facet.height + kEdgeTolerance, w));
  return span;
}

/// log2 for positive normal numbers, linear between powers of two (error below 0.09).
float rough_log2(float value) {
  std::uint32_t bits = 0;
  std::memcpy(&bits, &value, sizeof(bits));
  return static_cast<float>(bits) * 0x1p-23F - 127.0F;
}

float trilinear(const Texture& texture, float detail, float u, float v) {
  if (detail <= 0) return texture.sample(0, u, v);
  const int level = static_cast<int>(detail);
  if (level + 1 >= texture.levels()) return texture.sample(texture.levels() - 1, u, v);
  const float fine = texture.sample(level, u, v);
  return fine + (detail - static_cast<float>(level)) * (texture.sample(level + 1, u, v) - fine);
}

/// Mean of the texture over the footprint of a pixel, the parallelogram spanned by (ux, vx) and
/// (uy, vy) [texels]: a few samples along its longer side, each over a square of the shorter one.
float filtered(const Texture& texture, float u, float v, float ux, float vx, float uy, float vy) {
  const float length_x = std::sqrt(ux * ux + vx * vx);
  const float length_y = std::sqrt(uy * uy + vy * vy);
  const float longer = std::max(length_x, length_y);
  if (longer <= 1) return texture.sample(0, u, v);
  const float shorter = std::abs(ux * vy - uy * vx) / longer;
  const int taps = longer >= kMaxTaps * shorter
                       ? kMaxTaps
                       : std::max(1, static_cast<int>(longer / shorter + 0.5F));
  const auto count = static_cast<float>(taps);
  const float detail = rough_log2(std::max(shorter, longer / count));
  if (taps == 1) return trilinear(texture, detail, u, v);
  const float du = (length_x > length_y ? ux : uy) / count;
  const float dv = (length_x > length_y ? vx : vy) / count;
  float sum = 0;
  for (int i = 0; i < taps; ++i) {
    const float offset = static_cast<float>(i) - 0.5F * (count - 1);
    sum += trilinear(texture, detail, u + offset * du, v + offset * dv);
  }
  return sum / count;
}

/// Normal noise from the bits of one hash: the sum of four uniform 16-bit numbers.
float unit_noise(std::uint64_t seed, int x, int y) {
  const auto pixel = (static_cast<std::uint64_t>(static_cast<std::uint32_t>(y)) << 32) |
                     static_cast<std::uint32_t>(x);
  const std::uint64_t bits = mix(seed + pixel * 0x9e3779b97f4a7c15ULL);
  const std::uint64_t sum =
      (bits & 0xffff) + ((bits >> 16) & 0xffff) + ((bits >> 32) & 0xffff) + (bits >> 48);
  constexpr float kMean = 2 * 65535.0F;
  constexpr float kDeviation = 37837.2F;  // sqrt(4 * (65536^2 - 1) / 12)
  return (static_cast<float>(sum) - kMean) / kDeviation;
}

class RowCaster {
 public:
  RowCaster(const std::vector<Facet>& facets, const RenderOptions& options)
      : facets_(facets),
        options_(options),
        noise_seed_(mix(options.noise_seed)),
        nearest_(static_cast<std::size_t>(options.size.width)),
        owner_(nearest_.size()),
        values_(nearest_.size()) {}

  void cast(int y, std::uint8_t* grey, float* depth) {
    const int width = options_.size.width;
    find_owners(y);
    for (int x = 0; x < width;) {
      const int owner = owner_[static_cast<std::size_t>(x)];
      int end = x + 1;
      while (end < width && owner_[static_cast<std::size_t>(end)] == owner) ++end;
      shade(owner, y, x, end, depth);
      x = end;
    }
    const auto exposure = static_cast<float>(options_.exposure);
    const auto noise = static_cast<float>(options_.noise);
    for (int x = 0; x < width; ++x) {
      float value = values_[static_cast<std::size_t>(x)] * exposure;
      if (noise > 0) value += noise * unit_noise(noise_seed_, x, y);
      value = std::min(std::max(value, 0.0F), 255.0F);
      grey[x] = static_cast<std::uint8_t>(value + 0.5F);
    }
  }

 private:
  void find_owners(int y) {
    std::fill(nearest_.begin(), nearest_.end(), 0.0);
    std::fill(owner_.begin(), owner_.end(), -1);
    for (std::size_t i = 0; i < facets_.size(); ++i) {
      const Span span = covered_span(facets_[i], y, options_.size.width);
      if (!(span.first <= span.last)) continue;
      const Line inverse_depth = facets_[i].inverse_depth.row(y);
      const int end = static_cast<int>(std::floor(span.last));
      for (int x = static_cast<int>(std::ceil(span.first)); x <= end; ++x) {
        const double w = inverse_depth(x);
        if (w > nearest_[static_cast<std::size_t>(x)]) {
          nearest_[static_cast<std::size_t>(x)] = w;
          owner_[static_cast<std::size_t>(x)] = static_cast<int>(i);
        }
      }
    }
  }

  void shade(int owner, int y, int begin, int end, float* depth) {
    if (owner < 0) {
      std::fill(depth + begin, depth + end, 0.0F);
      std::fill(values_.begin() + begin, values_.begin() + end, kSky);
      return;
    }
    const Facet& facet = facets_[static_cast<std::size_t>(owner)];
    const Line a = facet.a.row(y);
    const Line b = facet.b.row(y);
    const double per_texel = 1 / facet.texture->texel();
    for (int x = begin; x < end; ++x) {
      const double z = 1 / nearest_[static_cast<std::size_t>(x)];
      depth[x] = static_cast<float>(z);
      const double u = a(x) * z;
      const double v = b(x) * z;
      const double scale = z * per_texel;
      const auto slope = [scale](double value, double of_value, double of_depth) {
        return static_cast<float>((of_value - value * of_depth) * scale);
      };
      const Affine& w = facet.inverse_depth;
      values_[static_cast<std::size_t>(x)] =
          filtered(*facet.texture, static_cast<float>(u * per_texel),
                   static_cast<float>(v * per_texel), slope(u, facet.a.x, w.x),
                   slope(v, facet.b.x, w.x), slope(u, facet.a.y, w.y), slope(v, facet.b.y, w.y));
    }
  }

  const std::vector<Facet>& facets_;
  const RenderOptions& options_;
  std::uint64_t noise_seed_;
  std::vector<double> nearest_;  // inverse depth
  std::vector<int> owner_;
  std::vector<float> values_;
};

void check(const RenderOptions& options) {
  const auto require = [](bool fine, const char* message) {
    if (!fine) throw SettingsError(message);
  };
  require(options.size.width > 0 && options.size.height > 0,
          "render: size must be at least 1 x 1 pixels");
  require(options.fx > 0 && options.fy > 0, "render: fx and fy must be positive");
  require(options.noise >= 0 && std::isfinite(options.noise),
          "render: noise must be a standard deviation of 0 or more grey levels");
  require(options.exposure > 0 && std::isfinite(options.exposure),
          "render: exposure must be positive");
  require(options.threads >= 1, "render: threads must be at least 1");
}

}  // namespace

Rendering render(const World& world, const Pose& T_cw, const RenderOptions& options) {
  check(options);
  const std::vector<Facet> facets = facets_in_view(world, T_cw, options);
  Rendering image{cv::Mat(options.size.height, options.size.width, CV_8UC1),
                  cv::Mat(options.size.height, options.size.width, CV_32FC1)};
  const int bands = std::min(options.threads, options.size.height);
  const auto cast_band = [&](int band) {
    RowCaster caster(facets, options);
    const int end = options.size.height * (band + 1) / bands;
    for (int y = options.size.height * band / bands; y < end; ++y) {
      caster.cast(y, image.grey.ptr<std::uint8_t>(y), image.depth.ptr<float>(y));
    }
  };
  std::vector<std::thread> helpers;
  for (int band = 1; band < bands; ++band) helpers.emplace_back(cast_band, band);
  cast_band(0);
  for (std::thread& helper : helpers) helper.join();
  return image;
}

}  // namespace orbslam::synthetic

// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <limits>

#include "base/errors.hpp"
#include "base/parallel.hpp"
#include "synthetic/hash.hpp"
#include "synthetic/row_kernels.hpp"
#include "synthetic/texture.hpp"
#include "synthetic/world.hpp"

namespace orbslam::synthetic {
namespace {

constexpr double kNearest = 0.01;      // metres
constexpr double kFarthest = 10000.0;  // metres
// Neighbouring rectangles overlap by this much, so that no ray slips between them.
constexpr double kEdgeTolerance = 1e-6;  // metres
constexpr float kSky = 205;              // grey level where nothing is hit

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

class RowCaster {
 public:
  RowCaster(const std::vector<Facet>& facets, const RenderOptions& options)
      : facets_(facets),
        options_(options),
        kernels_(row_kernels_for(best_vector_unit())),
        noise_seed_(mix(options.noise_seed)),
        nearest_(static_cast<std::size_t>(options.size.width)),
        owners_(nearest_.size()),
        values_(nearest_.size() + kRowPadding),
        depth_(values_.size()),
        grey_(values_.size()) {}

  void cast(int y, std::uint8_t* grey, float* depth) {
    const int width = options_.size.width;
    find_owners(y);
    for (int x = 0; x < width;) {
      const std::int64_t owner = owners_[static_cast<std::size_t>(x)];
      int end = x + 1;
      while (end < width && owners_[static_cast<std::size_t>(end)] == owner) ++end;
      shade(owner, y, x, end);
      x = end;
    }
    kernels_.expose(values_.data(), width, static_cast<float>(options_.exposure),
                    static_cast<float>(options_.noise), noise_seed_, static_cast<std::uint32_t>(y),
                    grey_.data());
    std::copy_n(grey_.begin(), width, grey);
    std::copy_n(depth_.begin(), width, depth);
  }

 private:
  void find_owners(int y) {
    std::fill(nearest_.begin(), nearest_.end(), 0.0);
    std::fill(owners_.begin(), owners_.end(), kNobody);
    for (std::size_t i = 0; i < facets_.size(); ++i) {
      const Span span = covered_span(facets_[i], y, options_.size.width);
      if (!(span.first <= span.last)) continue;
      kernels_.claim(facets_[i].inverse_depth.row(y), static_cast<int>(std::ceil(span.first)),
                     static_cast<int>(std::floor(span.last)), static_cast<std::int64_t>(i),
                     nearest_.data(), owners_.data());
    }
  }

  void shade(std::int64_t owner, int y, int begin, int end) {
    if (owner == kNobody) {
      std::fill(depth_.begin() + begin, depth_.begin() + end, 0.0F);
      std::fill(values_.begin() + begin, values_.begin() + end, kSky);
      return;
    }
    const Facet& facet = facets_[static_cast<std::size_t>(owner)];
    const TexturedRow row{facet.inverse_depth.row(y),
                          facet.a.row(y),
                          facet.b.row(y),
                          facet.inverse_depth.y,
                          facet.a.y,
                          facet.b.y,
                          1 / facet.texture->texel(),
                          &facet.texture->levels()};
    kernels_.shade(row, begin, end, values_.data(), depth_.data());
  }

  static constexpr std::int64_t kNobody = -1;

  const std::vector<Facet>& facets_;
  const RenderOptions& options_;
  const RowKernels& kernels_;
  std::uint64_t noise_seed_;
  std::vector<double> nearest_;  // inverse depth
  std::vector<std::int64_t> owners_;
  std::vector<float> values_, depth_;  // of one row
  std::vector<std::uint8_t> grey_;
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
  const auto n_bands = static_cast<std::size_t>(bands);
  for_each_in_parallel(n_bands, n_bands, [&](std::size_t i) {
    const auto band = static_cast<int>(i);
    RowCaster caster(facets, options);
    const int end = options.size.height * (band + 1) / bands;
    for (int y = options.size.height * band / bands; y < end; ++y) {
      caster.cast(y, image.grey.ptr<std::uint8_t>(y), image.depth.ptr<float>(y));
    }
  });
  return image;
}

}  // namespace orbslam::synthetic

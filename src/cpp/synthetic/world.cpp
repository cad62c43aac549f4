// SPDX-License-Identifier: BSD-3-Clause
#include "synthetic/world.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <string>
#include <tuple>

#include "base/errors.hpp"
#include "synthetic/texture.hpp"

namespace orbslam::synthetic {
namespace {

// 2^29 texels are 700 MB; a larger world is probably a typing error.
constexpr double kMostTexels = 536870912.0;

void check(const Rectangle& rectangle, std::size_t index) {
  const std::string name = "World: rectangle " + std::to_string(index);
  Eigen::Matrix<double, 3, 2> axes;
  axes << rectangle.u_axis, rectangle.v_axis;
  const double error = (axes.transpose() * axes - Eigen::Matrix2d::Identity()).norm();
  if (!rectangle.origin.allFinite() || !(error < 1e-9)) {
    throw SettingsError(name + ": u_axis and v_axis must be orthonormal and origin finite");
  }
  if (!(rectangle.width > 0 && rectangle.height > 0 && rectangle.texel > 0 &&
        rectangle.texture_repeat >= 0)) {
    throw SettingsError(name + ": width, height and texel must be positive, repeat not negative");
  }
}

}  // namespace

World::World(std::vector<Rectangle> rectangles) : rectangles_(std::move(rectangles)) {
  double texels = 0;
  for (std::size_t i = 0; i < rectangles_.size(); ++i) {
    const Rectangle& r = rectangles_[i];
    check(r, i);
    texels += std::max(2.0, r.width / r.texel) * std::max(2.0, r.height / r.texel);
  }
  if (!(texels < kMostTexels)) {
    throw SettingsError("World: the pictures would need more than 2^29 texels; use larger texels");
  }
  using Look = std::tuple<std::uint64_t, double, double, double, double, double, double>;
  std::map<Look, std::shared_ptr<const Texture>> pictures;
  textures_.reserve(rectangles_.size());
  for (const Rectangle& r : rectangles_) {
    auto& picture = pictures[Look{r.texture, r.width, r.height, r.texture_offset,
                                  r.texture_offset_v, r.texture_repeat, r.texel}];
    if (!picture) picture = std::make_shared<const Texture>(r);
    textures_.push_back(picture);
  }
}

}  // namespace orbslam::synthetic

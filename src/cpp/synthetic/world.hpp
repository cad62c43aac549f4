// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "base/pose.hpp"
#include "base/scale_pyramid.hpp"

namespace orbslam::synthetic {

class Texture;

/// A textured rectangle in space: origin + a * u_axis + b * v_axis with a in [0, width] and b in
/// [0, height]. Axes are orthonormal. Both sides are visible.
struct Rectangle {
  Eigen::Vector3d origin, u_axis, v_axis;
  double width = 1, height = 1;  ///< metres
  std::uint64_t texture = 0;     ///< seed of its texture; equal seeds look alike
  double texture_offset = 0;     ///< metres along u; lets long walls be cut into pieces
  double texture_offset_v = 0;   ///< metres along v
  double texture_repeat = 0;     ///< metres along u after which the picture comes again; 0: never
  double texel = 0.004;          ///< metres; size of the finest detail (shapes are >= 3 texels)
};

/// Rectangles with their baked textures. Immutable, cheap to copy; baking takes about 15 ns per
/// texel. Pictures are shared between rectangles that look the same.
class World {
 public:
  /// Throws SettingsError for axes that are not orthonormal or sizes that are not positive.
  explicit World(std::vector<Rectangle> rectangles);

  const std::vector<Rectangle>& rectangles() const { return rectangles_; }
  const Texture& texture(std::size_t rectangle) const { return *textures_[rectangle]; }

 private:
  std::vector<Rectangle> rectangles_;
  std::vector<std::shared_ptr<const Texture>> textures_;
};

// World frame of all worlds below: x right, y down, z forward. Floors are at y = +height / 2.

/// A closed room of the given inner size [m] (x, y, z), centred on the origin, with `n_boxes`
/// boxes along its walls. The middle (0.6 of the size in x and z) stays free for the camera.
World make_room(const Eigen::Vector3d& size, std::uint64_t seed, int n_boxes);

/// A corridor around a rectangular block: outer size `length` (z) by `breadth` (x), centred on
/// the origin. `repeat` > 0: the walls show the same picture again after that many metres.
World make_corridor(double length, double breadth, double width, double height, std::uint64_t seed,
                    double repeat = 0);

/// Two such corridors that share their middle leg, which runs along z at x = 0: outer size
/// `length` (z) by `breadth` (x).
World make_figure_eight(double length, double breadth, double width, double height,
                        std::uint64_t seed, double repeat = 0);

/// A street along z from z = 0 to `length`, `width` [m] between the fronts, the road at
/// y = 1.65 (a camera at the origin drives 1.65 m above it); open above.
World make_street(double length, double width, std::uint64_t seed);

/// Streets around a block of houses: their middle lines are `length` (z) by `breadth` (x), centred
/// on the origin; `width` [m] between the fronts on both sides, the road at y = 1.65; open above.
World make_street_lap(double length, double breadth, double width, std::uint64_t seed);

/// Two rooms of `size` that look alike, the second one turned by 180 degrees about y and centred
/// on (0, 0, size.z + passage), joined by a passage 1.6 m wide that looks different.
World make_two_rooms(const Eigen::Vector3d& size, double passage, std::uint64_t seed, int n_boxes);

struct RenderOptions {
  double fx = 400, fy = 400, cx = 320, cy = 240;
  ImageSize size{640, 480};
  double noise = 0;       ///< standard deviation, grey levels
  double exposure = 1.0;  ///< grey values are multiplied
  std::uint64_t noise_seed = 0;
  int threads = 1;
};

struct Rendering {
  cv::Mat grey;   ///< CV_8UC1
  cv::Mat depth;  ///< CV_32FC1, metres along z; 0 where nothing is hit
};

/// Ray casts the world: pixel (x, y) shows the first rectangle along the ray through its centre,
/// filtered over the pixel's footprint; exactly on the edge between two, the one listed first.
/// The same arguments give the same bytes, for any number of threads. Throws SettingsError for
/// sizes, focal lengths, exposure or noise out of range.
Rendering render(const World& world, const Pose& T_cw, const RenderOptions& options);

}  // namespace orbslam::synthetic

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "base/pose.hpp"
#include "base/scale_pyramid.hpp"

namespace orbslam::synthetic {

/// A textured rectangle in space: origin + a * u_axis + b * v_axis with a in [0, width] and b in
/// [0, height]. Axes are orthonormal.
struct Rectangle {
  Eigen::Vector3d origin, u_axis, v_axis;
  double width = 1, height = 1;        ///< metres
  std::uint64_t texture = 0;           ///< seed of its texture; equal seeds look alike
  double texture_offset = 0;           ///< metres along u; lets long walls be cut into pieces
};

struct World {
  std::vector<Rectangle> rectangles;
};

/// A closed room of the given inner size [m], centred on the origin, with boxes in it. x right,
/// y down, z forward like a camera at the origin.
World make_room(const Eigen::Vector3d& size, std::uint64_t seed, int n_boxes);
/// A corridor around a rectangular block; `repeat` > 0: the walls show the same picture again
/// after that many metres.
World make_corridor(double length, double breadth, double width, double height, std::uint64_t seed,
                    double repeat = 0);

struct RenderOptions {
  double fx = 400, fy = 400, cx = 320, cy = 240;
  ImageSize size{640, 480};
  double noise = 0;       ///< standard deviation, grey levels
  double exposure = 1.0;  ///< grey values are multiplied
  std::uint64_t noise_seed = 0;
};

struct Rendering {
  cv::Mat grey;   ///< CV_8UC1
  cv::Mat depth;  ///< CV_32FC1, metres along z; 0 where nothing is hit
};

/// Ray casts the world. The same arguments give the same bytes, for any number of threads.
Rendering render(const World& world, const Pose& T_cw, const RenderOptions& options);

}  // namespace orbslam::synthetic

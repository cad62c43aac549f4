// SPDX-License-Identifier: BSD-3-Clause
#include "synthetic/carpentry.hpp"

#include <cmath>

#include "synthetic/hash.hpp"

namespace orbslam::synthetic {

std::uint64_t Carpenter::next_texture() { return mix(seed_, rectangles_.size()); }

void Carpenter::wall(double x0, double z0, double x1, double z1, double top, double bottom,
                     double repeat) {
  const Eigen::Vector3d along(x1 - x0, 0, z1 - z0);
  Rectangle wall;
  wall.origin = {x0, top, z0};
  wall.u_axis = along.normalized();
  wall.v_axis = Eigen::Vector3d::UnitY();
  wall.width = along.norm();
  wall.height = bottom - top;
  wall.texture = next_texture();
  wall.texture_repeat = repeat;
  wall.texel = texel_;
  rectangles_.push_back(wall);
}

void Carpenter::slab(double x0, double z0, double x1, double z1, double y) {
  Rectangle slab;
  slab.origin = {x0, y, z0};
  slab.u_axis = Eigen::Vector3d::UnitX();
  slab.v_axis = Eigen::Vector3d::UnitZ();
  slab.width = x1 - x0;
  slab.height = z1 - z0;
  slab.texture = next_texture();
  slab.texel = texel_;
  rectangles_.push_back(slab);
}

void Carpenter::box(double x, double z, double size_x, double size_z, double top, double bottom,
                    double yaw) {
  const Eigen::Vector3d right(std::cos(yaw), 0, -std::sin(yaw));
  const Eigen::Vector3d ahead(std::sin(yaw), 0, std::cos(yaw));
  const Eigen::Vector3d centre(x, 0, z);
  const auto corner = [&](double a, double b) {
    return Eigen::Vector3d(centre + a * 0.5 * size_x * right + b * 0.5 * size_z * ahead);
  };
  const Eigen::Vector3d corners[4] = {corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)};
  for (int i = 0; i < 4; ++i) {
    const Eigen::Vector3d& a = corners[i];
    const Eigen::Vector3d& b = corners[(i + 1) % 4];
    wall(a.x(), a.z(), b.x(), b.z(), top, bottom);
  }
  Rectangle lid;
  lid.origin = {corners[0].x(), top, corners[0].z()};
  lid.u_axis = right;
  lid.v_axis = ahead;
  lid.width = size_x;
  lid.height = size_z;
  lid.texture = next_texture();
  lid.texel = texel_;
  rectangles_.push_back(lid);
}

void Carpenter::block(double x0, double z0, double x1, double z1, double top, double bottom,
                      double repeat) {
  wall(x0, z0, x1, z0, top, bottom, repeat);
  wall(x1, z0, x1, z1, top, bottom, repeat);
  wall(x1, z1, x0, z1, top, bottom, repeat);
  wall(x0, z1, x0, z0, top, bottom, repeat);
}

}  // namespace orbslam::synthetic

// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <string>

#include "base/errors.hpp"
#include "synthetic/carpentry.hpp"
#include "synthetic/hash.hpp"
#include "synthetic/world.hpp"

namespace orbslam::synthetic {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kRoomTexel = 0.004;
constexpr double kCorridorTexel = 0.005;
constexpr double kStreetTexel = 0.02;
constexpr double kCarTexel = 0.01;
constexpr double kCameraAboveRoad = 1.65;
constexpr double kDoorWidth = 1.6;

void require(bool fine, const std::string& message) {
  if (!fine) throw SettingsError(message);
}

/// Boxes of all sizes, centred on a ring between the free middle of a room and its walls.
void furnish(Carpenter& carpenter, const Eigen::Vector3d& size, std::uint64_t seed, int n_boxes) {
  HashStream random(mix(seed, 0xb0e5));
  const double floor = size.y() / 2;
  const double margin = 0.18 * std::min(size.x(), size.z());
  for (int i = 0; i < n_boxes; ++i) {
    // One box per equal sector, so that they do not pile up.
    const double angle = 2 * kPi * (i + random.uniform(0.2, 0.8)) / n_boxes;
    const double c = std::cos(angle);
    const double s = std::sin(angle);
    // The point of the ring's rectangle in that direction.
    const double reach = std::min((size.x() / 2 - 0.5 * margin) / std::max(std::abs(c), 1e-9),
                                  (size.z() / 2 - 0.5 * margin) / std::max(std::abs(s), 1e-9));
    const double most = margin / std::sqrt(2.0);  // still clear of the middle when turned
    const double size_x = most * random.uniform(0.45, 0.95);
    const double size_z = most * random.uniform(0.45, 0.95);
    const double height = size.y() * random.uniform(0.12, 0.6);
    carpenter.box(reach * c, reach * s, size_x, size_z, floor - height, floor,
                  random.uniform(0, kPi / 2));
  }
}

/// Floor, ceiling, furniture and three walls; the wall at z = +size.z / 2 has a door if
/// `door_width` > 0.
std::vector<Rectangle> room(const Eigen::Vector3d& size, std::uint64_t seed, int n_boxes,
                            double door_width) {
  require(size.minCoeff() >= 1 && size.maxCoeff() <= 100, "room: sizes must be 1 to 100 m");
  require(n_boxes >= 0 && n_boxes <= 1000, "room: n_boxes must be 0 to 1000");
  Carpenter carpenter(seed, kRoomTexel);
  const double x = size.x() / 2;
  const double y = size.y() / 2;
  const double z = size.z() / 2;
  carpenter.slab(-x, -z, x, z, y);
  carpenter.slab(-x, -z, x, z, -y);
  carpenter.wall(-x, -z, x, -z, -y, y);
  carpenter.wall(-x, z, -x, -z, -y, y);
  carpenter.wall(x, -z, x, z, -y, y);
  if (door_width > 0) {
    carpenter.wall(-x, z, -door_width / 2, z, -y, y);
    carpenter.wall(door_width / 2, z, x, z, -y, y);
  } else {
    carpenter.wall(-x, z, x, z, -y, y);
  }
  furnish(carpenter, size, seed, n_boxes);
  return carpenter.rectangles();
}

}  // namespace

World make_room(const Eigen::Vector3d& size, std::uint64_t seed, int n_boxes) {
  return World(room(size, seed, n_boxes, 0));
}

World make_two_rooms(const Eigen::Vector3d& size, double passage, std::uint64_t seed, int n_boxes) {
  require(passage > 0 && passage <= 100, "two rooms: passage must be longer than 0, up to 100 m");
  require(size.x() > 2 * kDoorWidth, "two rooms: rooms must be wider than two doors (3.2 m)");
  std::vector<Rectangle> all = room(size, seed, n_boxes, kDoorWidth);
  // A box before the door would be in the way.
  const auto in_the_way = [&](const Rectangle& r) {
    const Eigen::Vector3d centre = r.origin + 0.5 * (r.width * r.u_axis + r.height * r.v_axis);
    const bool furniture = r.width < 0.2 * size.x() && std::abs(centre.z()) < 0.499 * size.z();
    return furniture && centre.z() > 0 && std::abs(centre.x()) < kDoorWidth;
  };
  all.erase(std::remove_if(all.begin(), all.end(), in_the_way), all.end());
  const std::size_t one_room = all.size();
  const Eigen::Vector3d turn(-1, 1, -1);  // 180 degrees about y
  const Eigen::Vector3d centre(0, 0, size.z() + passage);
  for (std::size_t i = 0; i < one_room; ++i) {
    Rectangle twin = all[i];
    twin.origin = turn.cwiseProduct(twin.origin) + centre;
    twin.u_axis = turn.cwiseProduct(twin.u_axis);
    twin.v_axis = turn.cwiseProduct(twin.v_axis);
    all.push_back(twin);
  }
  Carpenter carpenter(mix(seed, 0xd002), kRoomTexel);
  const double x = kDoorWidth / 2;
  const double y = size.y() / 2;
  const double z = size.z() / 2;
  carpenter.wall(-x, z + passage, -x, z, -y, y);
  carpenter.wall(x, z, x, z + passage, -y, y);
  carpenter.slab(-x, z, x, z + passage, y);
  carpenter.slab(-x, z, x, z + passage, -y);
  const auto& joint = carpenter.rectangles();
  all.insert(all.end(), joint.begin(), joint.end());
  return World(std::move(all));
}

World make_corridor(double length, double breadth, double width, double height, std::uint64_t seed,
                    double repeat) {
  require(width > 0 && height > 0 && length > 2 * width && breadth > 2 * width,
          "corridor: length and breadth must exceed twice the width");
  require(repeat >= 0, "corridor: repeat must not be negative");
  Carpenter carpenter(seed, kCorridorTexel);
  const double x = breadth / 2;
  const double y = height / 2;
  const double z = length / 2;
  carpenter.block(-x, -z, x, z, -y, y, repeat);
  carpenter.block(-x + width, -z + width, x - width, z - width, -y, y, repeat);
  for (const double level : {y, -y}) {
    carpenter.slab(-x, -z, -x + width, z, level);
    carpenter.slab(x - width, -z, x, z, level);
    carpenter.slab(-x + width, -z, x - width, -z + width, level);
    carpenter.slab(-x + width, z - width, x - width, z, level);
  }
  return World(std::move(carpenter.rectangles()));
}

World make_figure_eight(double length, double breadth, double width, double height,
                        std::uint64_t seed, double repeat) {
  require(width > 0 && height > 0 && length > 2 * width && breadth > 3 * width,
          "figure of eight: length must exceed twice, breadth three times the width");
  require(repeat >= 0, "figure of eight: repeat must not be negative");
  Carpenter carpenter(seed, kCorridorTexel);
  const double x = breadth / 2;
  const double y = height / 2;
  const double z = length / 2;
  carpenter.block(-x, -z, x, z, -y, y, repeat);
  carpenter.block(-x + width, -z + width, -width / 2, z - width, -y, y, repeat);
  carpenter.block(width / 2, -z + width, x - width, z - width, -y, y, repeat);
  for (const double level : {y, -y}) {
    carpenter.slab(-x, -z, -x + width, z, level);
    carpenter.slab(x - width, -z, x, z, level);
    carpenter.slab(-x + width, -z, x - width, -z + width, level);
    carpenter.slab(-x + width, z - width, x - width, z, level);
    carpenter.slab(-width / 2, -z + width, width / 2, z - width, level);
  }
  return World(std::move(carpenter.rectangles()));
}

World make_street(double length, double width, std::uint64_t seed) {
  require(length >= 10 && length <= 5000, "street: length must be 10 to 5000 m");
  require(width >= 6 && width <= 40, "street: width must be 6 to 40 m");
  Carpenter carpenter(seed, kStreetTexel);
  HashStream random(mix(seed, 0x57ee));
  constexpr double kBehind = 5;   // the street goes on behind the start
  constexpr double kBeyond = 60;  // and past the end
  constexpr double kPiece = 60;   // floors in pieces: cheap to cull
  const double bottom = kCameraAboveRoad;
  const double end = length + kBeyond;
  const double half = width / 2 + 3;  // houses stand back by up to 3 m
  for (double z = -kBehind; z < end; z += kPiece) {
    carpenter.slab(-half, z, half, std::min(z + kPiece, end), bottom);
  }
  for (const double side : {-1.0, 1.0}) {
    double z = -kBehind;
    while (z < end) {
      const double next = std::min(z + random.uniform(7, 18), end);
      const double front = side * (width / 2 + random.uniform(0, 2.5));
      const double top = bottom - random.uniform(5, 13);
      carpenter.wall(front, z, front, next, top, bottom);
      carpenter.wall(front, z, side * half, z, top, bottom);
      carpenter.wall(side * half, next, front, next, top, bottom);
      z = next;
    }
    for (z = random.uniform(3, 12); z < end; z += random.uniform(8, 25)) {
      const double x = side * (width / 2 - 1.1);  // parked along the kerb
      carpenter.use_texel(kCarTexel);
      carpenter.box(x, z, random.uniform(1.6, 1.9), random.uniform(3.6, 5.2),
                    bottom - random.uniform(1.3, 2.2), bottom, 0);
      carpenter.use_texel(kStreetTexel);
    }
  }
  carpenter.wall(-half, end, half, end, bottom - 12, bottom);
  return World(std::move(carpenter.rectangles()));
}

}  // namespace orbslam::synthetic

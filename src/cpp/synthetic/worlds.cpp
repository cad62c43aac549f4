// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <string>

#include "base/errors.hpp"
#include "synthetic/carpentry.hpp"
#include "synthetic/hash.hpp"
#include "synthetic/pi.hpp"
#include "synthetic/world.hpp"

namespace orbslam::synthetic {
namespace {

constexpr double kRoomTexel = 0.004;
constexpr double kCorridorTexel = 0.005;
constexpr double kStreetTexel = 0.02;
constexpr double kCarTexel = 0.01;
constexpr double kCameraAboveRoad = 1.65;
constexpr double kHouseDepth = 3;  // of what can be seen of a house's sides
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

/// One side of a street: a point (x, z) on it, the direction of the street, and the direction from
/// the road to the houses.
struct Kerb {
  Eigen::Vector2d start, along, away;

  Eigen::Vector2d at(double distance, double depth) const {
    return start + distance * along + depth * away;
  }
};

/// The road between two corners (x, z), in pieces: cheap to cull.
void pave(Carpenter& carpenter, double x0, double z0, double x1, double z1) {
  constexpr double kPiece = 60;
  for (double x = x0; x < x1; x += kPiece) {
    for (double z = z0; z < z1; z += kPiece) {
      carpenter.slab(x, z, std::min(x + kPiece, x1), std::min(z + kPiece, z1), kCameraAboveRoad);
    }
  }
}

/// House after house, set back from the kerb by up to 2.5 m.
void build_houses(Carpenter& carpenter, const Kerb& kerb, double begin, double end,
                  HashStream& random) {
  double s = begin;
  while (s < end) {
    const double next = std::min(s + random.uniform(7, 18), end);
    const double front = random.uniform(0, 2.5);
    const double top = kCameraAboveRoad - random.uniform(5, 13);
    const auto wall = [&](const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
      carpenter.wall(a.x(), a.y(), b.x(), b.y(), top, kCameraAboveRoad);
    };
    wall(kerb.at(s, front), kerb.at(next, front));
    wall(kerb.at(s, front), kerb.at(s, kHouseDepth));
    wall(kerb.at(next, kHouseDepth), kerb.at(next, front));
    s = next;
  }
}

/// Cars along the kerb, with gaps of all sizes.
void park_cars(Carpenter& carpenter, const Kerb& kerb, double begin, double end,
               HashStream& random) {
  const double yaw = std::atan2(kerb.along.x(), kerb.along.y());
  carpenter.use_texel(kCarTexel);
  for (double s = begin + random.uniform(3, 12); s < end; s += random.uniform(8, 25)) {
    const Eigen::Vector2d centre = kerb.at(s, -1.1);
    const double height = random.uniform(1.3, 2.2);
    const double length = random.uniform(3.6, 5.2);
    const double width = random.uniform(1.6, 1.9);
    carpenter.box(centre.x(), centre.y(), width, length, kCameraAboveRoad - height,
                  kCameraAboveRoad, yaw);
  }
  carpenter.use_texel(kStreetTexel);
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
  const double end = length + kBeyond;
  const double half = width / 2 + kHouseDepth;
  pave(carpenter, -half, -kBehind, half, end);
  for (const double side : {-1.0, 1.0}) {
    const Kerb kerb{{side * width / 2, 0}, {0, 1}, {side, 0}};
    build_houses(carpenter, kerb, -kBehind, end, random);
    park_cars(carpenter, kerb, 0, end, random);
  }
  carpenter.wall(-half, end, half, end, kCameraAboveRoad - 12, kCameraAboveRoad);
  return World(std::move(carpenter.rectangles()));
}

World make_street_lap(double length, double breadth, double width, std::uint64_t seed) {
  require(width >= 6 && width <= 40, "street lap: width must be 6 to 40 m");
  require(std::min(length, breadth) >= 3 * width && std::max(length, breadth) <= 2000,
          "street lap: length and breadth must be 3 times the width to 2000 m");
  Carpenter carpenter(seed, kStreetTexel);
  HashStream random(mix(seed, 0x57ee));
  const double half = width / 2 + kHouseDepth;
  const double x = breadth / 2;
  const double z = length / 2;
  for (const double side : {-1.0, 1.0}) {
    pave(carpenter, side * x - half, -z - half, side * x + half, z + half);
    pave(carpenter, -x + half, side * z - half, x - half, side * z + half);
  }
  // Clockwise seen from above: the block is always on the right.
  const Eigen::Vector2d corners[4] = {{-x, -z}, {-x, z}, {x, z}, {x, -z}};
  for (int i = 0; i < 4; ++i) {
    const Eigen::Vector2d leg = corners[(i + 1) % 4] - corners[i];
    const Eigen::Vector2d along = leg.normalized();
    const Eigen::Vector2d right(along.y(), -along.x());
    const Kerb outer{corners[i] - width / 2 * right, along, -right};
    const Kerb inner{corners[i] + width / 2 * right, along, right};
    // Rows of the outer side meet behind the corner, those of the block at its corner.
    build_houses(carpenter, outer, -half, leg.norm() + half, random);
    build_houses(carpenter, inner, width / 2, leg.norm() - width / 2, random);
    for (const Kerb& kerb : {outer, inner}) {
      park_cars(carpenter, kerb, width, leg.norm() - width, random);  // not in the bends
    }
  }
  return World(std::move(carpenter.rectangles()));
}

}  // namespace orbslam::synthetic

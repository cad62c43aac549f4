// SPDX-License-Identifier: BSD-3-Clause
#include "synthetic/paths.hpp"

#include <algorithm>
#include <cmath>

#include "base/errors.hpp"
#include "synthetic/pi.hpp"

namespace orbslam::synthetic {
namespace {

Eigen::Vector2d direction(double heading) { return {std::sin(heading), std::cos(heading)}; }

double turn_between(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  // Positive from z towards x, i.e. a right turn for a camera with y down.
  return std::atan2(b.x() * a.y() - b.y() * a.x(), a.dot(b));
}

Pose camera_to_world(const Eigen::Vector3d& position, double yaw, double pitch, double roll) {
  using Eigen::AngleAxisd;
  const Eigen::Quaterniond rotation = AngleAxisd(yaw, Eigen::Vector3d::UnitY()) *
                                      AngleAxisd(pitch, Eigen::Vector3d::UnitX()) *
                                      AngleAxisd(roll, Eigen::Vector3d::UnitZ());
  return {rotation, position};
}

/// Starts in the middle of the left leg, clockwise seen from above.
Way rounded_rectangle(double length, double breadth, double radius) {
  const double x = breadth / 2;
  const double z = length / 2;
  return Way({{-x, z}, {x, z}, {x, -z}, {-x, -z}}, radius, true);
}

}  // namespace

Way::Way(const std::vector<Eigen::Vector2d>& corners, double radius, bool closed)
    : smoothing_(0.75 * radius), closed_(closed) {
  const std::size_t n = corners.size();
  if (n < (closed ? 3U : 2U) || !(radius > 0)) {
    throw SettingsError("Way: needs two corners (three if closed) and a positive radius");
  }
  const auto corner = [&](std::size_t i) -> const Eigen::Vector2d& { return corners[i % n]; };
  const Eigen::Vector2d start = closed ? 0.5 * (corner(n - 1) + corner(0)) : corner(0);
  const Eigen::Vector2d first_leg = closed ? corner(0) - start : corner(1) - start;
  pieces_.push_back({0, 0, start, std::atan2(first_leg.x(), first_leg.y()), 0, 0});
  Eigen::Vector2d from = start;
  double used = 0;  // of the present leg by the arc before it
  const std::size_t begin = closed ? 0 : 1;
  const std::size_t end = closed ? n : n - 1;
  for (std::size_t i = begin; i < end; ++i) {
    const Eigen::Vector2d in = corner(i) - from;
    const Eigen::Vector2d out = corner(i + 1) - corner(i);
    const double turn = turn_between(in, out);
    const double cut = radius * std::tan(std::abs(turn) / 2);
    const double straight = in.norm() - used - cut;
    if (straight < 0) throw SettingsError("Way: a leg is too short for its rounded corners");
    add_piece(straight, 0);
    if (std::abs(turn) > 1e-12) add_piece(radius * std::abs(turn), (turn > 0 ? 1 : -1) / radius);
    used = cut;
    from = corner(i);
  }
  const double rest = ((closed ? start : corner(n - 1)) - from).norm() - used;
  if (rest < 0) throw SettingsError("Way: the last leg is too short for its rounded corner");
  add_piece(rest, 0);
  pieces_.erase(pieces_.begin());
}

void Way::add_piece(double length, double curvature) {
  const Piece& before = pieces_.back();
  Piece piece{};
  const double l = before.length;
  piece.begin = before.begin + l;
  piece.heading = before.heading + before.curvature * l;
  piece.heading_integral =
      before.heading_integral + before.heading * l + 0.5 * before.curvature * l * l;
  // The chord of an arc has the mean heading.
  const double half_turn = 0.5 * before.curvature * l;
  const double chord = std::abs(half_turn) < 1e-12 ? l : l * std::sin(half_turn) / half_turn;
  piece.start = before.start + chord * direction(before.heading + half_turn);
  piece.length = length;
  piece.curvature = curvature;
  pieces_.push_back(piece);
  length_ = piece.begin + length;
}

const Way::Piece& Way::piece_at(double distance) const {
  const auto after = std::upper_bound(pieces_.begin(), pieces_.end(), distance,
                                      [](double s, const Piece& p) { return s < p.begin; });
  return after == pieces_.begin() ? pieces_.front() : *(after - 1);
}

double Way::wrapped(double distance, double& laps) const {
  laps = closed_ ? std::floor(distance / length_) : 0;
  return distance - laps * length_;
}

Eigen::Vector2d Way::position(double distance) const {
  double laps = 0;
  const double s = wrapped(distance, laps);
  const Piece& piece = piece_at(s);
  const double l = s - piece.begin;
  const double half_turn = 0.5 * piece.curvature * l;
  const double chord = std::abs(half_turn) < 1e-12 ? l : l * std::sin(half_turn) / half_turn;
  return piece.start + chord * direction(piece.heading + half_turn);
}

double Way::heading_integral(double distance) const {
  double laps = 0;
  const double s = wrapped(distance, laps);
  const auto within = [this](double at) {
    const Piece& piece = piece_at(at);
    const double l = at - piece.begin;
    return piece.heading_integral + piece.heading * l + 0.5 * piece.curvature * l * l;
  };
  if (laps == 0) return within(s);
  const Piece& last = pieces_.back();
  const double per_lap = last.heading + last.curvature * last.length - pieces_.front().heading;
  // Each lap starts with the heading the lap before ended with.
  return within(s) + laps * within(length_) +
         per_lap * (laps * s + length_ * laps * (laps - 1) / 2);
}

Pose Way::T_wc(double distance, const PathOptions& options) const {
  if (!(options.stride > 0)) throw SettingsError("Way: stride must be positive");
  const double look =
      (heading_integral(distance + smoothing_) - heading_integral(distance - smoothing_)) /
      (2 * smoothing_);
  const double gait = 2 * kPi * distance / options.stride;
  const double side = options.lateral + options.sway * std::sin(gait);
  const Eigen::Vector2d at = position(distance);
  // To the right of the direction (x, z) = (sin h, cos h) lies (cos h, -sin h).
  const Eigen::Vector3d p(at.x() + side * std::cos(look), 0.5 * options.sway * std::sin(1.3 * gait),
                          at.y() - side * std::sin(look));
  const double tilt = 0.2 * options.sway;
  return camera_to_world(p, look + options.yaw, tilt * std::sin(0.7 * gait), tilt * std::sin(gait));
}

Pose room_T_wc(const Eigen::Vector3d& size, double seconds, double period) {
  if (!(period > 0)) throw SettingsError("room path: period must be positive");
  const double phase = 2 * kPi * seconds / period;
  const Eigen::Vector3d reach = 0.16 * size;
  const Eigen::Vector3d position(reach.x() * std::sin(2 * phase),
                                 0.6 * reach.y() * std::sin(3 * phase),
                                 reach.z() * std::sin(phase));
  return camera_to_world(position, phase + 0.35 * std::sin(2 * phase), 0.12 * std::sin(3 * phase),
                         0.05 * std::sin(4 * phase));
}

Way corridor_way(double length, double breadth, double width) {
  return rounded_rectangle(length - width, breadth - width, width / 2);
}

Way figure_eight_way(double length, double breadth, double width) {
  const double x = (breadth - width) / 2;
  const double z = (length - width) / 2;
  return Way({{0, z}, {-x, z}, {-x, -z}, {0, -z}, {0, z}, {x, z}, {x, -z}, {0, -z}}, width / 2,
             true);
}

Way street_way(double length) { return Way({{0, 0}, {0, length}}, 1, false); }

Way street_lap_way(double length, double breadth, double width) {
  return rounded_rectangle(length, breadth, width);
}

Way two_rooms_way(const Eigen::Vector3d& size, double passage) {
  const double x = 0.2 * size.x();
  const double z = 0.2 * size.z();
  const double far = size.z() + passage;
  return Way({{-x, z},
              {-x, -z},
              {x, -z},
              {x, 0},
              {0, z},
              {0, far - z},
              {-x, far},
              {-x, far + z},
              {x, far + z},
              {x, far - z}},
             std::min(0.8, 0.5 * std::min(x, z)), false);
}

}  // namespace orbslam::synthetic

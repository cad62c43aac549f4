// SPDX-License-Identifier: BSD-3-Clause
#include "synthetic/paths.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "base/errors.hpp"

namespace orbslam::synthetic {
namespace {

constexpr double kDegree = 3.14159265358979323846 / 180;

/// Largest step between poses that follow each other.
struct Pace {
  double metres = 0, radians = 0, turn_change = 0;
};

template <class PoseAt>
Pace pace(PoseAt pose_at, int count) {
  Pace most;
  Vector6d before = Vector6d::Zero();
  for (int i = 0; i + 1 < count; ++i) {
    const Pose a = pose_at(i);
    const Pose b = pose_at(i + 1);
    const Vector6d step = (a.inverse() * b).log();
    most.metres = std::max(most.metres, (b.translation() - a.translation()).norm());
    most.radians = std::max(most.radians, step.head<3>().norm());
    if (i > 0) {
      most.turn_change = std::max(most.turn_change, (step - before).head<3>().norm());
    }
    before = step;
  }
  return most;
}

TEST(RoomPath, IsAsFastAsAPerson) {
  const Pace most = pace([](int i) { return room_T_wc({6, 3, 6}, i / 30.0); }, 30 * 30 + 2);
  EXPECT_LT(most.metres * 30, 0.8);
  EXPECT_GT(most.metres * 30, 0.3);
  EXPECT_LT(most.radians * 30, 30 * kDegree);
  EXPECT_LT(most.turn_change * 30, 1 * kDegree);
}

TEST(RoomPath, ComesBackAfterAPeriodAndStaysInTheMiddle) {
  for (double t = 0; t < 30; t += 0.37) {
    const Pose a = room_T_wc({6, 3, 6}, t);
    EXPECT_LT((a.inverse() * room_T_wc({6, 3, 6}, t + 30)).log().norm(), 1e-9);
    EXPECT_LT(std::abs(a.translation().x()), 1.0);
    EXPECT_LT(std::abs(a.translation().z()), 1.0);
  }
}

TEST(Way, IsClosedAndSmoothAlsoAcrossLaps) {
  for (const Way& way :
       {corridor_way(16, 12, 2.4), figure_eight_way(16, 20, 2.4), street_lap_way(20, 14, 1.2)}) {
    const PathOptions still{0, 0, 0, 1};
    EXPECT_LT(
        (way.T_wc(1.5, still).inverse() * way.T_wc(1.5 + 2 * way.length(), still)).log().norm(),
        1e-9);
    const int count = static_cast<int>(2.2 * way.length() / 0.02);
    const Pace most = pace([&](int i) { return way.T_wc(0.02 * i); }, count);
    EXPECT_LT(most.metres, 0.04);
    EXPECT_GT(most.metres, 0.02);
    EXPECT_LT(most.radians, 1.1 * kDegree);       // at 0.6 m/s: 33 degrees/s
    EXPECT_LT(most.turn_change, 0.05 * kDegree);  // an edge in the heading would give 0.9
  }
}

TEST(Way, LengthOfTheRoundedRectangle) {
  // Legs of 14 and 10 m, corners of radius 1 instead of two legs of 1 m each.
  EXPECT_NEAR(corridor_way(16, 12, 2).length(), 2 * (14 + 10) - 8 + 2 * std::acos(-1.0), 1e-9);
}

TEST(Way, StaysInTheMiddleOfTheCorridor) {
  const Way way = corridor_way(16, 12, 2.4);
  for (double s = 0; s < 60; s += 0.1) {
    const Eigen::Vector3d p = way.T_wc(s).translation();
    const bool inside = std::abs(p.x()) < 5.6 && std::abs(p.z()) < 7.6;
    const bool in_block = std::abs(p.x()) < 4.0 && std::abs(p.z()) < 6.0;
    EXPECT_TRUE(inside && !in_block) << s;
  }
}

TEST(Way, DrivesOnItsStreetAroundTheBlock) {
  const double width = 14;
  const Way way = street_lap_way(208, 104, width);
  EXPECT_NEAR(way.length(), 600, 0.1);
  double nearest_to_block = 1e9;
  for (double s = 0; s < way.length(); s += 0.25) {
    const Eigen::Vector3d p = way.T_wc(s, {0, 0, 0, 1}).translation().cwiseAbs();
    EXPECT_TRUE(p.x() <= 52 + 1e-9 && p.z() <= 104 + 1e-9) << s;  // middle lines or inside of them
    const double dx = std::max(p.x() - (52 - width / 2), 0.0);
    const double dz = std::max(p.z() - (104 - width / 2), 0.0);
    nearest_to_block = std::min(nearest_to_block, std::hypot(dx, dz));
  }
  // In the bends the way is nearest to the block's corners.
  EXPECT_NEAR(nearest_to_block, width * (1 / std::sqrt(2.0) - (std::sqrt(2.0) - 1)), 0.01);
}

TEST(Way, FigureOfEightUsesTheMiddleLegTwiceInTheSameDirection) {
  const Way way = figure_eight_way(16, 20, 2.4);
  const PathOptions still{0, 0, 0, 1};
  const Pose first = way.T_wc(0, still);
  const Pose second = way.T_wc(way.length() / 2, still);
  EXPECT_LT((first.inverse() * second).log().norm(), 1e-9);
  EXPECT_LT(way.T_wc(way.length() / 4, still).translation().x(), -5);
  EXPECT_GT(way.T_wc(3 * way.length() / 4, still).translation().x(), 5);
}

TEST(Way, LooksWhereItGoes) {
  const Way way = street_way(600);
  EXPECT_NEAR(way.length(), 600, 1e-9);
  const Pose T_wc = way.T_wc(100, {0, 0, 0, 1});
  EXPECT_LT((T_wc.translation() - Eigen::Vector3d(0, 0, 100)).norm(), 1e-9);
  EXPECT_LT((T_wc.rotation() * Eigen::Vector3d::UnitZ() - Eigen::Vector3d::UnitZ()).norm(), 1e-9);
  const Pose beside = way.T_wc(100, {1.5, 0.5, 0, 1});
  EXPECT_LT((beside.translation() - Eigen::Vector3d(1.5, 0, 100)).norm(), 1e-9);
  EXPECT_GT((beside.rotation() * Eigen::Vector3d::UnitZ()).x(), 0.4);
}

TEST(Way, SwaysOncePerStride) {
  const Way way = street_way(100);
  const PathOptions options{0, 0, 0.05, 40};
  EXPECT_NEAR(way.T_wc(10, options).translation().x(), 0.05, 1e-9);
  EXPECT_NEAR(way.T_wc(20, options).translation().x(), 0, 1e-9);
  EXPECT_NEAR(way.T_wc(30, options).translation().x(), -0.05, 1e-9);
}

TEST(Way, GoesFromOneRoomIntoTheOtherWhateverTheirSize) {
  for (const Eigen::Vector3d& size :
       {Eigen::Vector3d(6, 3, 6), Eigen::Vector3d(5, 3, 12), Eigen::Vector3d(12, 3, 5)}) {
    const Way way = two_rooms_way(size, 3);
    EXPECT_LT(way.T_wc(0).translation().z(), size.z() / 2);
    EXPECT_GT(way.T_wc(way.length()).translation().z(), size.z() / 2 + 3);
  }
}

TEST(Way, RefusesLegsThatAreTooShort) {
  EXPECT_THROW(Way({{0, 0}, {0, 1}, {1, 1}}, 2, true), SettingsError);
  EXPECT_THROW(Way({{0, 0}}, 1, false), SettingsError);
  EXPECT_THROW(Way({{0, 0}, {0, 5}}, 0, false), SettingsError);
  EXPECT_THROW(street_way(10).T_wc(1, {0, 0, 0.1, 0}), SettingsError);
}

}  // namespace
}  // namespace orbslam::synthetic

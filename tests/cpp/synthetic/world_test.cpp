// SPDX-License-Identifier: BSD-3-Clause
#include "synthetic/world.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "base/errors.hpp"
#include "synthetic/paths.hpp"

namespace orbslam::synthetic {
namespace {

bool same_bytes(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() &&
         std::memcmp(a.data, b.data, a.total() * a.elemSize()) == 0;
}

const World& room() {
  static const World world = make_room({6, 3, 6}, 1, 8);
  return world;
}

Rectangle facing_wall(double z) {
  Rectangle wall;
  wall.origin = {-20, -20, z};
  wall.u_axis = Eigen::Vector3d::UnitX();
  wall.v_axis = Eigen::Vector3d::UnitY();
  wall.width = wall.height = 40;
  wall.texel = 0.02;
  return wall;
}

/// Depth along z of the nearest rectangle by brute force; 0 where nothing is hit.
double nearest_depth(const World& world, const Pose& T_wc, const RenderOptions& camera, double x,
                     double y) {
  const Eigen::Vector3d ray_c((x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy, 1);
  const Eigen::Vector3d ray = T_wc.rotation() * ray_c;
  double nearest = std::numeric_limits<double>::infinity();
  for (const Rectangle& r : world.rectangles()) {
    const Eigen::Vector3d normal = r.u_axis.cross(r.v_axis);
    const double z = normal.dot(r.origin - T_wc.translation()) / normal.dot(ray);
    if (!(z > 0.01 && z < nearest)) continue;
    const Eigen::Vector3d hit = T_wc.translation() + z * ray - r.origin;
    const double a = hit.dot(r.u_axis);
    const double b = hit.dot(r.v_axis);
    if (a >= -1e-6 && a <= r.width + 1e-6 && b >= -1e-6 && b <= r.height + 1e-6) nearest = z;
  }
  return std::isinf(nearest) ? 0.0 : nearest;
}

float bilinear(const cv::Mat& grey, double x, double y) {
  const int x0 = static_cast<int>(x);
  const int y0 = static_cast<int>(y);
  const double fx = x - x0;
  const double fy = y - y0;
  const auto at = [&](int dx, int dy) {
    return static_cast<double>(grey.at<std::uint8_t>(y0 + dy, x0 + dx));
  };
  return static_cast<float>((1 - fy) * ((1 - fx) * at(0, 0) + fx * at(1, 0)) +
                            fy * ((1 - fx) * at(0, 1) + fx * at(1, 1)));
}

TEST(Render, GivesTheSameBytesForAnyNumberOfThreads) {
  RenderOptions options;
  options.noise = 3;
  options.noise_seed = 7;
  const Pose T_cw = room_T_wc({6, 3, 6}, 4).inverse();
  const Rendering one = render(room(), T_cw, options);
  for (const int threads : {1, 2, 5}) {
    options.threads = threads;
    const Rendering other = render(make_room({6, 3, 6}, 1, 8), T_cw, options);
    EXPECT_TRUE(same_bytes(one.grey, other.grey)) << threads;
    EXPECT_TRUE(same_bytes(one.depth, other.depth)) << threads;
  }
}

TEST(Render, DiffersForAnotherSeed) {
  const Pose T_cw;
  EXPECT_FALSE(
      same_bytes(render(room(), T_cw, {}).grey, render(make_room({6, 3, 6}, 2, 8), T_cw, {}).grey));
}

TEST(Render, DepthOfAFacingWallIsItsDistance) {
  const Rendering image = render(World({facing_wall(4.25)}), Pose(), {});
  for (int y = 0; y < image.depth.rows; ++y) {
    for (int x = 0; x < image.depth.cols; ++x) ASSERT_EQ(image.depth.at<float>(y, x), 4.25F);
  }
}

TEST(Render, DepthAgreesWithBruteForceRayCasting) {
  const RenderOptions options;
  for (const double seconds : {0.0, 5.0, 11.0, 17.5, 23.0}) {
    const Pose T_wc = room_T_wc({6, 3, 6}, seconds);
    const Rendering image = render(room(), T_wc.inverse(), options);
    int edges = 0;
    for (int y = 0; y < 480; y += 7) {
      for (int x = 0; x < 640; x += 5) {
        const double expected = nearest_depth(room(), T_wc, options, x, y);
        if (std::abs(image.depth.at<float>(y, x) - expected) > 1e-6 * expected) ++edges;
      }
    }
    // A ray through a silhouette may be rounded to either side.
    EXPECT_LE(edges, 1) << seconds;
  }
}

TEST(Render, IndoorsEveryPixelHitsSomething) {
  const auto expect_closed = [](const World& world, const Pose& T_wc) {
    const Rendering image = render(world, T_wc.inverse(), {});
    for (int y = 0; y < image.depth.rows; ++y) {
      for (int x = 0; x < image.depth.cols; ++x) ASSERT_GT(image.depth.at<float>(y, x), 0.2F);
    }
  };
  const World corridor = make_corridor(10, 8, 2, 2.5, 3);
  const World eight = make_figure_eight(10, 12, 2, 2.5, 3);
  const World two = make_two_rooms({6, 3, 6}, 2, 3, 6);
  const Way round = corridor_way(10, 8, 2);
  const Way twice = figure_eight_way(10, 12, 2);
  const Way through = two_rooms_way({6, 3, 6}, 2);
  for (int i = 0; i < 23; ++i) {
    expect_closed(room(), room_T_wc({6, 3, 6}, 30.0 * i / 23));
    expect_closed(corridor, round.T_wc(round.length() * i / 23));
    expect_closed(eight, twice.T_wc(twice.length() * i / 23));
    expect_closed(two, through.T_wc(through.length() * i / 23));
  }
}

TEST(Render, TwoViewsShowTheSameGreyAtTheSamePoint) {
  const RenderOptions options;
  const Pose T_wl = room_T_wc({6, 3, 6}, 3);
  const Pose T_lr(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.1, 0, 0));
  const Rendering left = render(room(), T_wl.inverse(), options);
  const Rendering right = render(room(), (T_wl * T_lr).inverse(), options);
  double sum = 0;
  int count = 0;
  int far_off = 0;
  for (int y = 0; y < 480; ++y) {
    for (int x = 0; x < 640; ++x) {
      const double z = left.depth.at<float>(y, x);
      const double x_right = x - options.fx * 0.1 / z;
      if (x_right < 0 || x_right > 638 || y > 478) continue;
      const float z_right = right.depth.at<float>(y, static_cast<int>(std::lround(x_right)));
      if (std::abs(z_right - z) > 0.02 * z) continue;  // hidden
      const double error =
          std::abs(bilinear(right.grey, x_right, y) - left.grey.at<std::uint8_t>(y, x));
      sum += error;
      far_off += static_cast<int>(error > 30);
      ++count;
    }
  }
  ASSERT_GT(count, 200000);
  EXPECT_LT(sum / count, 2.5);
  EXPECT_LT(far_off, count / 200);
}

TEST(Render, ExposureScalesAndNoiseHasItsDeviation) {
  RenderOptions options;
  const Rendering plain = render(room(), Pose(), options);
  options.exposure = 0.5;
  const Rendering dark = render(room(), Pose(), options);
  options.exposure = 1;
  options.noise = 4;
  options.noise_seed = 1;
  const Rendering noisy = render(room(), Pose(), options);
  options.noise_seed = 2;
  EXPECT_FALSE(same_bytes(noisy.grey, render(room(), Pose(), options).grey));
  EXPECT_TRUE(same_bytes(noisy.depth, plain.depth));
  double mean = 0;
  double square = 0;
  int count = 0;
  for (int y = 0; y < 480; ++y) {
    for (int x = 0; x < 640; ++x) {
      const int value = plain.grey.at<std::uint8_t>(y, x);
      ASSERT_NEAR(dark.grey.at<std::uint8_t>(y, x), 0.5 * value, 0.76);
      if (value < 30 || value > 225) continue;
      const double difference = noisy.grey.at<std::uint8_t>(y, x) - value;
      mean += difference;
      square += difference * difference;
      ++count;
    }
  }
  EXPECT_NEAR(mean / count, 0, 0.05);
  EXPECT_NEAR(std::sqrt(square / count), 4, 0.05);
}

TEST(Render, StreetIsOpenAbove) {
  const World street = make_street(50, 12, 1);
  const Rendering image = render(street, Pose(), {});
  EXPECT_EQ(image.depth.at<float>(0, 320), 0);
  EXPECT_GT(image.depth.at<float>(479, 320), 1);
}

TEST(Render, StreetsAroundABlockAreOpenAboveAndClosedAhead) {
  const World streets = make_street_lap(120, 80, 14, 2);
  const Way way = street_lap_way(120, 80, 14);
  int open = 0;
  for (int i = 0; i < 40; ++i) {
    const Rendering image = render(streets, way.T_wc(way.length() * i / 40).inverse(), {});
    open += static_cast<int>(image.depth.at<float>(0, 320) == 0);
    // Just above the road, whatever the direction, there is a house: no gaps at the corners.
    for (int x = 0; x < 640; ++x) ASSERT_GT(image.depth.at<float>(225, x), 1) << i << ' ' << x;
  }
  EXPECT_GT(open, 20);  // a house close ahead in a bend may fill the view
}

TEST(World, NothingStandsInTheWayAroundTheBlock) {
  const Way way = street_lap_way(208, 104, 14);
  std::vector<Eigen::Vector3d> places;
  for (double d = 0; d < way.length(); d += 2) {
    places.emplace_back(way.T_wc(d, {0, 0, 0, 1}).translation());
  }
  for (const std::uint64_t seed : {0, 1}) {
    const World streets = make_street_lap(208, 104, 14, seed);
    double nearest = 1e9;
    for (const Rectangle& r : streets.rectangles()) {
      if (r.v_axis.y() != 1) continue;  // roads and roofs
      for (double a = 0; a < r.width; a += 0.5) {
        const Eigen::Vector3d p = r.origin + a * r.u_axis;
        for (const Eigen::Vector3d& c : places) {
          nearest = std::min(nearest, std::hypot(p.x() - c.x(), p.z() - c.z()));
        }
      }
    }
    EXPECT_GT(nearest, 3.9) << seed;  // a car may be driven by up to 3 m beside the middle
  }
}

TEST(World, StreetsAroundABlockDifferBySeedAndHaveCarsOnBothSides) {
  const World one = make_street_lap(208, 104, 14, 1);
  const World other = make_street_lap(208, 104, 14, 2);
  EXPECT_NE(one.rectangles().size(), other.rectangles().size());
  int inside = 0;
  int outside = 0;
  for (const Rectangle& r : one.rectangles()) {
    const bool roof = r.v_axis.y() == 0 && r.origin.y() < 1.6;
    if (!roof) continue;
    const Eigen::Vector3d centre = r.origin + 0.5 * (r.width * r.u_axis + r.height * r.v_axis);
    const bool within = std::abs(centre.x()) < 52 && std::abs(centre.z()) < 104;
    ++(within ? inside : outside);
  }
  EXPECT_GT(inside, 15);
  EXPECT_GT(outside, 15);
}

TEST(Render, TwoRoomsLookAlike) {
  const Eigen::Vector3d size(6, 3, 6);
  const World world = make_two_rooms(size, 2, 5, 6);
  const Pose in_first(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.3, 0, -1));
  const Pose turned(Eigen::Quaterniond(Eigen::AngleAxisd(2.5, Eigen::Vector3d::UnitY())),
                    Eigen::Vector3d::Zero());
  const Pose first_to_second(
      Eigen::Quaterniond(Eigen::AngleAxisd(3.14159265358979323846, Eigen::Vector3d::UnitY())),
      Eigen::Vector3d(0, 0, size.z() + 2));
  const Pose T_wc = in_first * turned;  // looks away from the door
  const Rendering here = render(world, T_wc.inverse(), {});
  const Rendering there = render(world, (first_to_second * T_wc).inverse(), {});
  int different = 0;
  for (int y = 0; y < 480; ++y) {
    for (int x = 0; x < 640; ++x) {
      different += static_cast<int>(
          std::abs(here.grey.at<std::uint8_t>(y, x) - there.grey.at<std::uint8_t>(y, x)) > 1);
    }
  }
  EXPECT_LT(different, 300);  // rounding at edges
}

TEST(World, SharesThePicturesOfEqualWalls) {
  Rectangle wall = facing_wall(3);
  Rectangle other = facing_wall(5);
  Rectangle third = facing_wall(5);
  third.texture = 9;
  const World world({wall, other, third});
  EXPECT_EQ(&world.texture(0), &world.texture(1));
  EXPECT_NE(&world.texture(0), &world.texture(2));
}

TEST(World, BoxesLeaveTheMiddleOfARoomFreeAndStayInside) {
  const Eigen::Vector3d size(6, 3, 8);
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const World world = make_room(size, seed, 12);
    ASSERT_EQ(world.rectangles().size(), 6U + 12U * 5U);
    for (std::size_t i = 6; i < world.rectangles().size(); ++i) {
      const Rectangle& r = world.rectangles()[i];
      for (const double f : {0.0, 0.25, 0.5, 0.75, 1.0}) {
        const Eigen::Vector3d p = r.origin + f * r.width * r.u_axis;
        EXPECT_TRUE(std::abs(p.x()) > 0.3 * size.x() || std::abs(p.z()) > 0.3 * size.z());
        EXPECT_TRUE(std::abs(p.x()) < 0.5 * size.x() && std::abs(p.z()) < 0.5 * size.z());
      }
    }
  }
}

TEST(World, RefusesWhatCannotBe) {
  Rectangle skewed = facing_wall(3);
  skewed.v_axis = Eigen::Vector3d(0.1, 1, 0);
  EXPECT_THROW(World({skewed}), SettingsError);
  Rectangle empty = facing_wall(3);
  empty.width = 0;
  EXPECT_THROW(World({empty}), SettingsError);
  Rectangle endless = facing_wall(3);
  endless.width = 1e9;
  EXPECT_THROW(World({endless}), SettingsError);
  endless.height = 1e-9;  // a thread of one texel's breadth
  EXPECT_THROW(World({endless}), SettingsError);
  EXPECT_THROW(make_corridor(4, 10, 2, 2, 1), SettingsError);
  EXPECT_THROW(make_room({0, 3, 3}, 1, 1), SettingsError);
  EXPECT_THROW(make_street(5, 12, 1), SettingsError);
  EXPECT_THROW(make_street_lap(208, 30, 14, 1), SettingsError);
  EXPECT_THROW(make_street_lap(208, 104, 5, 1), SettingsError);
  RenderOptions options;
  options.noise = -1;
  EXPECT_THROW(render(room(), Pose(), options), SettingsError);
  options = {};
  options.size = {0, 480};
  EXPECT_THROW(render(room(), Pose(), options), SettingsError);
}

}  // namespace
}  // namespace orbslam::synthetic

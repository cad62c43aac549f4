// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <random>
#include <set>

#include "base/errors.hpp"
#include "support/rigs.hpp"

namespace orbslam {
namespace {

using testing::make_camera;
using testing::make_rig;
using testing::mounted;
using testing::TestLens;

/// Points all around the body.
std::vector<Eigen::Vector3d> points_around(int n) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> coordinate(0, 1);
  std::uniform_real_distribution<double> distance(1.5, 8);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < n; ++i) {
    const Eigen::Vector3d p(coordinate(random), 0.3 * coordinate(random), coordinate(random));
    points.push_back(distance(random) * p.normalized());
  }
  return points;
}

TEST(RigCamera, PixelsAndRaysOfAllCamerasAreInverse) {
  const auto rig = make_rig();
  std::set<std::size_t> cameras;
  for (const Eigen::Vector3d& p : points_around(500)) {
    Eigen::Vector2d uv;
    double disparity = 0;
    if (!rig->project(p, uv, disparity)) continue;
    EXPECT_TRUE(rig->bounds().contains(uv.x(), uv.y()));
    const std::size_t camera = rig->camera_at(uv.x());
    cameras.insert(camera);
    const RigMember& member = rig->members()[camera];
    const Eigen::Vector3d p_c = member.T_bc.inverse() * p;
    EXPECT_TRUE(rig->centre(uv.x()).isApprox(member.T_bc.translation()));
    const Eigen::Vector3d direction = (p - rig->centre(uv.x())).normalized();
    EXPECT_LT((rig->ray(uv.x(), uv.y()) - direction).norm(), 1e-8);
    const double depth = member.camera->is_flat() ? p_c.z() : p_c.norm();
    EXPECT_LT((rig->unproject(uv.x(), uv.y(), depth) - p).norm(), 1e-7);
    EXPECT_NEAR(disparity, rig->disparity(uv.x(), uv.y(), depth), 1e-7);
  }
  EXPECT_EQ(cameras.size(), 4U);
}

TEST(RigCamera, SightsGiveTheErrorsAndDisparitiesOfEachCamera) {
  const auto rig = make_rig();
  for (const Eigen::Vector3d& p : points_around(300)) {
    Eigen::Vector2d uv;
    double disparity = 0;
    if (!rig->project(p, uv, disparity)) continue;
    const Sight B = rig->sight(uv.x(), uv.y());
    const Eigen::Vector3d q = apply(B, p);
    ASSERT_GT(q.z(), 0);
    EXPECT_NEAR(q.head<2>().norm() / q.z(), 0, 1e-6);
    EXPECT_NEAR(rig->bf() / q.z(), disparity, 1e-6);
    EXPECT_NEAR(rig->right_error(p, {0, 0}, uv.x(), uv.y(), uv.x() - disparity), 0, 1e-6);

    const Eigen::Vector3d moved = p + 1e-4 * p.norm() * Eigen::Vector3d(0.5, -0.7, 0.4);
    Eigen::Vector2d error;
    ASSERT_TRUE(rig->error(moved, uv.x(), uv.y(), error));
    const Eigen::Vector3d q_moved = apply(B, moved);
    EXPECT_LT((q_moved.head<2>() / q_moved.z() - error).norm(), 1e-3);
    const RigMember& member = rig->members()[rig->camera_at(uv.x())];
    Eigen::Vector2d own;
    ASSERT_TRUE(member.camera->error(member.T_bc.inverse() * moved,
                                     uv.x() - rig->column_of(rig->camera_at(uv.x())), uv.y(), own));
    EXPECT_LT((own - error).norm(), 1e-9);
  }
}

TEST(RigCamera, ThePlaneHasRoomForAllPlanesAndImages) {
  const auto rig = make_rig();
  EXPECT_TRUE(rig->distorts());
  for (std::size_t i = 0; i < rig->n_cameras(); ++i) {
    const Camera& camera = *rig->members()[i].camera;
    for (const double u : {static_cast<double>(camera.bounds().min_x), 0.0, 639.0,
                           static_cast<double>(camera.bounds().max_x)}) {
      EXPECT_EQ(rig->camera_at(u + rig->column_of(i)), i);
    }
    const Eigen::Vector2f raw(30, 50), at(30 + static_cast<float>(rig->column_of(i)), 50);
    const Eigen::Vector2f own = camera.from_image(raw);
    EXPECT_NEAR(rig->from_image(at).x() - own.x(), rig->column_of(i), 1e-3);
    EXPECT_NEAR(rig->to_image(rig->from_image(at).cast<double>()).x(), at.x(), 1e-2);
  }
}

TEST(RigCamera, ThePointBelongsToTheCameraThatSeesItMostCentrally) {
  CameraOptions options;
  const auto camera = make_camera(TestLens::none);
  options.members = {{camera, Pose(), true}, {camera, mounted(30, {0.1, 0, 0}), true}};
  const Camera rig(options);
  Eigen::Vector2d uv;
  ASSERT_TRUE(rig.project({0.1, 0, 5}, uv));
  EXPECT_EQ(rig.camera_at(uv.x()), 0U);
  ASSERT_TRUE(rig.project({2.5, 0, 5}, uv));
  EXPECT_EQ(rig.camera_at(uv.x()), 1U);
  EXPECT_FALSE(rig.project({0, 0, -5}, uv));

  const Camera without = rig.with_active({true, false});
  ASSERT_TRUE(without.project({2.5, 0, 5}, uv));
  EXPECT_EQ(without.camera_at(uv.x()), 0U);
  EXPECT_EQ(without.column_of(1), rig.column_of(1));
}

TEST(RigCamera, CloseDepthsAreThoseOfTheCamera) {
  const auto rig = make_rig();
  for (std::size_t i = 0; i < rig->n_cameras(); ++i) {
    EXPECT_EQ(rig->close_depth(rig->column_of(i)), rig->members()[i].camera->close_depth());
  }
}

TEST(RigCamera, RefusesWhatIsNoRig) {
  CameraOptions options;
  const auto camera = make_camera(TestLens::none);
  options.members = {{camera, Pose(), true}};
  EXPECT_THROW(Camera{options}, SettingsError);
  options.members.push_back({nullptr, Pose(), true});
  EXPECT_THROW(Camera{options}, SettingsError);
  options.members.back().camera = make_rig();
  EXPECT_THROW(Camera{options}, SettingsError);
  options.members = {{camera, Pose(), false}, {camera, Pose(), false}};
  EXPECT_THROW(Camera{options}, SettingsError);
  options.members.assign(9, {camera, Pose(), true});
  EXPECT_THROW(Camera{options}, SettingsError);
}

}  // namespace
}  // namespace orbslam

// SPDX-License-Identifier: BSD-3-Clause
#include "geometry/two_view.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <stdexcept>
#include <utility>

#include "scenes.hpp"

namespace orbslam {
namespace {

using testing::make_two_view_scene;
using testing::SceneShape;
using testing::sideways_motion;
using testing::TwoViewScene;

TwoViewResult reconstruct(const TwoViewScene& scene, std::uint64_t seed = 0,
                          WorkerThread* helper = nullptr, const TwoViewOptions& options = {}) {
  return reconstruct_two_views({scene.initial, scene.current, scene.matches, *scene.camera},
                               options, seed, helper);
}

void expect_motion(const TwoViewResult& result, const TwoViewScene& scene) {
  ASSERT_TRUE(result.success()) << to_string(result.outcome);
  EXPECT_LT(testing::rotation_error_degrees(result.T_21, scene.T_21), 0.5);
  EXPECT_LT(testing::degrees_between(result.T_21.translation(), scene.T_21.translation()), 2);
  EXPECT_NEAR(result.T_21.translation().norm(), 1, 1e-12);
  const double scale = 1 / scene.T_21.translation().norm();
  std::size_t close = 0, count = 0;
  for (std::size_t i = 0; i < scene.points.size(); ++i) {
    if (!result.triangulated[i]) continue;
    ++count;
    close += (result.points[i] - scale * scene.points[i]).norm() < 0.15 * result.points[i].norm();
  }
  EXPECT_GT(count, 100U);
  EXPECT_GT(close, count * 9 / 10);
}

bool same_bytes(const TwoViewResult& a, const TwoViewResult& b) {
  const auto equal = [](const auto& x, const auto& y) {
    return x.size() == y.size() &&
           std::memcmp(x.data(), y.data(), x.size() * sizeof(*x.data())) == 0;
  };
  const Eigen::Matrix4d T_a = a.T_21.matrix(), T_b = b.T_21.matrix();
  return a.outcome == b.outcome && a.homography_score == b.homography_score &&
         a.fundamental_score == b.fundamental_score && a.best_hypothesis == b.best_hypothesis &&
         a.parallax == b.parallax && equal(T_a, T_b) && equal(a.points, b.points) &&
         equal(a.triangulated, b.triangulated) && equal(a.homography_inlier, b.homography_inlier) &&
         equal(a.fundamental_inlier, b.fundamental_inlier);
}

TEST(TwoViews, PlaneByHomography) {
  int accepted = 0;
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    const auto scene = make_two_view_scene(
        SceneShape::planar,
        Pose(Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitY())),
             Eigen::Vector3d(-2.2, 0.3, 0.8)),
        400, 0.5, seed, 0.1);
    const TwoViewResult result = reconstruct(scene, seed);
    EXPECT_EQ(result.model, TwoViewModel::homography);
    EXPECT_EQ(result.hypotheses.size(), 8U);
    if (!result.success()) {
      // Two motions of one homography may both see the plane from the front.
      EXPECT_EQ(result.outcome, TwoViewOutcome::ambiguous_motion);
      // A third view may choose: the true one is among them.
      EXPECT_TRUE(std::any_of(
          result.alternatives.begin(), result.alternatives.end(), [&](const TwoViewMotion& motion) {
            return testing::rotation_error_degrees(motion.T_21, scene.T_21) < 1.0;
          }));
      continue;
    }
    ++accepted;
    expect_motion(result, scene);
  }
  EXPECT_GE(accepted, 3);
}

TEST(TwoViews, GeneralSceneByFundamentalMatrix) {
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    const auto scene =
        make_two_view_scene(SceneShape::general, sideways_motion(), 400, 0.25, seed, 0.1);
    const TwoViewResult result = reconstruct(scene, seed);
    EXPECT_EQ(result.model, TwoViewModel::fundamental);
    EXPECT_EQ(result.hypotheses.size(), 4U);
    expect_motion(result, scene);
  }
}

TEST(TwoViews, PureRotationFails) {
  const Pose rotation(Eigen::Quaterniond(Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitY())),
                      Eigen::Vector3d::Zero());
  for (const double noise : {0.0, 0.5}) {
    for (std::uint64_t seed = 0; seed < 10; ++seed) {
      const auto scene = make_two_view_scene(SceneShape::general, rotation, 300, noise, seed);
      const TwoViewResult result = reconstruct(scene, seed);
      EXPECT_FALSE(result.success());
      EXPECT_EQ(result.model, TwoViewModel::homography);
      EXPECT_TRUE(result.outcome == TwoViewOutcome::degenerate_plane ||
                  result.outcome == TwoViewOutcome::low_parallax ||
                  result.outcome == TwoViewOutcome::too_few_points)
          << to_string(result.outcome);
      EXPECT_EQ(std::count(result.triangulated.begin(), result.triangulated.end(), 1), 0);
    }
  }
}

TEST(TwoViews, SmallMotionIsLowParallax) {
  const Pose small(Eigen::Quaterniond::Identity(), Eigen::Vector3d(-0.06, 0, 0));
  const auto scene = make_two_view_scene(SceneShape::general, small, 400, 0.2, 3);
  EXPECT_EQ(reconstruct(scene).outcome, TwoViewOutcome::low_parallax);
}

TEST(TwoViews, NeedsAHundredMatches) {
  auto scene = make_two_view_scene(SceneShape::general, sideways_motion(), 150, 0.3, 1);
  for (std::size_t i = 100; i < 150; ++i) scene.matches[i] = -1;
  const TwoViewResult enough = reconstruct(scene);
  EXPECT_EQ(enough.n_matches, 100U);
  EXPECT_TRUE(enough.success()) << to_string(enough.outcome);
  scene.matches[99] = -1;
  const TwoViewResult refused = reconstruct(scene);
  EXPECT_EQ(refused.outcome, TwoViewOutcome::too_few_matches);
  EXPECT_EQ(refused.n_matches, 99U);
  EXPECT_EQ(refused.model, TwoViewModel::none);
  EXPECT_EQ(refused.triangulated.size(), 150U);
  TwoViewOptions options;
  options.min_matches = 90;
  EXPECT_TRUE(reconstruct(scene, 0, nullptr, options).success());
}

TEST(TwoViews, ResultsBelongToTheInitialKeypoints) {
  // The same matches, with unmatched keypoints in between.
  const auto scene = make_two_view_scene(SceneShape::general, sideways_motion(), 200, 0.3, 2);
  const TwoViewResult dense = reconstruct(scene);
  TwoViewScene sparse = scene;
  sparse.initial.clear();
  sparse.matches.clear();
  for (std::size_t i = 0; i < 200; ++i) {
    for (int copy = 0; copy < 2; ++copy) {
      sparse.initial.push_back(scene.initial[i]);  // keeps the normalisation
      sparse.matches.push_back(copy == 0 ? -1 : scene.matches[i]);
    }
  }
  const TwoViewResult result = reconstruct(sparse);
  ASSERT_TRUE(dense.success() && result.success());
  for (std::size_t i = 0; i < 200; ++i) {
    EXPECT_EQ(result.triangulated[2 * i], 0);
    EXPECT_EQ(result.triangulated[2 * i + 1], dense.triangulated[i]);
    EXPECT_LT((result.points[2 * i + 1] - dense.points[i]).norm(), 1e-6);
    EXPECT_EQ(result.fundamental_inlier[2 * i + 1], dense.fundamental_inlier[i]);
  }
}

TEST(TwoViews, AKnownMotionPlacesWhatTheReconstructionPlaced) {
  const auto scene = make_two_view_scene(SceneShape::general, sideways_motion(), 200, 0.3, 2);
  const TwoViewResult found = reconstruct(scene);
  ASSERT_TRUE(found.success());
  const TwoViewInput input{scene.initial, scene.current, scene.matches, *scene.camera};
  // Of any length: it becomes 1.
  const Pose longer(found.T_21.rotation(), 3.0 * found.T_21.translation());
  const TwoViewMotion placed = place_points(input, longer, 1.0);
  EXPECT_NEAR(placed.T_21.translation().norm(), 1, 1e-12);
  EXPECT_NEAR(placed.parallax, found.parallax, 0.2);
  ASSERT_EQ(placed.triangulated.size(), found.triangulated.size());
  for (std::size_t i = 0; i < placed.points.size(); ++i) {
    // The matrix' inliers are asked there, all matches here.
    EXPECT_GE(placed.triangulated[i], found.triangulated[i]);
    if (found.triangulated[i] == 1) {
      EXPECT_LT((placed.points[i] - found.points[i]).norm(), 1e-9 * found.points[i].norm());
    }
  }
  const Pose still(found.T_21.rotation(), Eigen::Vector3d::Zero());
  EXPECT_THROW(place_points(input, still, 1.0), std::invalid_argument);
}

// OD-64: no score above 0 is no model. OD-67: keypoints in one column are degenerate.
TEST(TwoViews, DegenerateInputsFailWithAReason) {
  auto scene = make_two_view_scene(SceneShape::general, sideways_motion(), 150, 0.3, 1);
  auto column = scene;
  for (auto& point : column.initial) point.x() = 100;
  EXPECT_EQ(reconstruct(column).outcome, TwoViewOutcome::degenerate_points);

  auto line = scene;  // every sample is rank deficient
  for (std::size_t i = 0; i < line.initial.size(); ++i) {
    line.initial[i].y() = line.initial[i].x();
    line.current[i] = line.initial[i];
  }
  EXPECT_FALSE(reconstruct(line).success());

  auto same = scene;  // identical views
  same.current = same.initial;
  const TwoViewResult still = reconstruct(same);
  EXPECT_FALSE(still.success());
  EXPECT_NE(still.outcome, TwoViewOutcome::too_few_matches);

  std::mt19937_64 random(4);  // nothing fits
  auto noise = scene;
  for (auto& point : noise.current) {
    point = {static_cast<float>(testing::uniform(random, 0, 640)),
             static_cast<float>(testing::uniform(random, 0, 480))};
  }
  EXPECT_EQ(reconstruct(noise).outcome, TwoViewOutcome::too_few_points);
  EXPECT_EQ(reconstruct_two_views({scene.initial, scene.current, scene.matches, *scene.camera}, {},
                                  std::vector<EightPairs>(), nullptr)
                .outcome,
            TwoViewOutcome::no_model);
}

TEST(TwoViews, RefusesBadArguments) {
  const auto scene = make_two_view_scene(SceneShape::general, sideways_motion(), 150, 0.3, 1);
  TwoViewOptions options;
  options.sigma = 0;
  EXPECT_THROW(reconstruct(scene, 0, nullptr, options), std::invalid_argument);
  const TwoViewInput input{scene.initial, scene.current, scene.matches, *scene.camera};
  const std::vector<EightPairs> samples{{0, 1, 2, 3, 4, 5, 6, 150}};
  EXPECT_THROW(reconstruct_two_views(input, {}, samples, nullptr), std::invalid_argument);
}

// OD-66: every reconstruction has its own seeded generator.
TEST(TwoViews, TwoThreadsAndTheSameSeedGiveTheSameBytes) {
  WorkerThread helper;
  for (const SceneShape shape : {SceneShape::general, SceneShape::planar}) {
    const auto scene = make_two_view_scene(shape, sideways_motion(), 300, 0.5, 7, 0.2);
    const TwoViewResult first = reconstruct(scene, 11);
    EXPECT_TRUE(same_bytes(first, reconstruct(scene, 11)));
    EXPECT_TRUE(same_bytes(first, reconstruct(scene, 11, &helper)));
    const TwoViewResult other = reconstruct(scene, 12);
    EXPECT_NE(first.fundamental_score, other.fundamental_score);
  }
}

TEST(TwoViews, SigmaWidensTheGates) {
  const auto scene = make_two_view_scene(SceneShape::general, sideways_motion(), 300, 1.5, 7);
  TwoViewOptions wide;
  wide.sigma = 2;
  EXPECT_GT(reconstruct(scene, 1, nullptr, wide).n_fundamental_inliers,
            reconstruct(scene, 1).n_fundamental_inliers);
}

class GoldenTwoViews : public ::testing::TestWithParam<const char*> {
 protected:
  template <class T>
  testing::Array<T> golden(const std::string& array) const {
    return testing::golden<T>(GetParam(), array);
  }

  /// Signs of singular vectors are arbitrary, so the order within each four is, too.
  void expect_hypotheses(std::vector<MotionScore> found) const {
    const auto array = golden<double>("out_hyp_ngood_parallax");
    ASSERT_EQ(found.size(), array.rows());
    std::vector<MotionScore> expected;
    for (std::size_t i = 0; i < array.rows(); ++i) {
      expected.push_back({static_cast<std::size_t>(array.at(i, 0)), array.at(i, 1)});
    }
    for (std::size_t first = 0; first < found.size(); first += 4) {
      for (auto* scores : {&found, &expected}) {
        const auto begin = scores->begin() + static_cast<std::ptrdiff_t>(first);
        std::sort(begin, begin + 4, [](const MotionScore& a, const MotionScore& b) {
          return std::pair(a.n_good, a.parallax) < std::pair(b.n_good, b.parallax);
        });
      }
    }
    for (std::size_t i = 0; i < found.size(); ++i) {
      // A pair of init_lowparallax lies 2e-8 from the cosine below which depths must be positive;
      // the reference rounds to float32.
      EXPECT_NEAR(static_cast<double>(found[i].n_good), static_cast<double>(expected[i].n_good), 1)
          << i;
      EXPECT_NEAR(found[i].parallax, expected[i].parallax, 1e-2) << i;
    }
  }
};

TEST_P(GoldenTwoViews, AgreeWithTheReference) {
  const TwoViewScene scene = testing::golden_two_views(GetParam());
  const auto sets = golden<int>("out_sets");
  std::vector<EightPairs> samples(sets.rows());
  for (std::size_t k = 0; k < 8 * sets.rows(); ++k) samples[k / 8][k % 8] = sets.values[k];

  WorkerThread helper;
  const TwoViewResult result = reconstruct_two_views(
      {scene.initial, scene.current, scene.matches, *testing::golden_camera(GetParam())}, {},
      samples, &helper);
  const double S_H = golden<double>("out_SH").values[0], S_F = golden<double>("out_SF").values[0];
  EXPECT_NEAR(result.homography_score, S_H, 1e-3 * S_H);
  EXPECT_NEAR(result.fundamental_score, S_F, 1e-3 * S_F);
  EXPECT_NEAR(result.homography_ratio, golden<double>("out_RH").values[0], 1e-3);
  const bool planar = golden<int>("out_choseH").values[0] != 0;
  EXPECT_EQ(result.model, planar ? TwoViewModel::homography : TwoViewModel::fundamental);
  EXPECT_EQ(result.homography_inlier, golden<std::uint8_t>("out_inlierH").values);
  EXPECT_EQ(result.fundamental_inlier, golden<std::uint8_t>("out_inlierF").values);

  expect_hypotheses(result.hypotheses);
  const auto counts = golden<int>("out_hyp_ngood_parallax");
  int most = 0;
  for (std::size_t i = 0; i < counts.rows(); ++i) most = std::max(most, counts.at(i, 0));
  EXPECT_EQ(result.hypotheses[result.best_hypothesis].n_good, static_cast<std::size_t>(most));
  ASSERT_EQ(result.success(), golden<int>("out_ok").values[0] != 0) << to_string(result.outcome);
  if (!result.success()) {
    EXPECT_EQ(result.outcome,
              planar ? TwoViewOutcome::ambiguous_motion : TwoViewOutcome::low_parallax);
    return;
  }
  const auto R = golden<double>("out_R21"), t = golden<double>("out_t21");
  const auto P = golden<double>("out_P3D");
  for (std::size_t i = 0; i < 9; ++i) {
    EXPECT_NEAR(result.T_21.rotation_matrix()(static_cast<int>(i / 3), static_cast<int>(i % 3)),
                R.values[i], 1e-4);
  }
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(result.T_21.translation()[static_cast<int>(i)], t.values[i], 1e-4);
  }
  EXPECT_EQ(result.triangulated, golden<std::uint8_t>("out_triangulated").values);
  for (std::size_t i = 0; i < P.rows(); ++i) {
    if (!result.triangulated[i]) continue;
    const Eigen::Vector3d expected(P.at(i, 0), P.at(i, 1), P.at(i, 2));
    EXPECT_LT((result.points[i] - expected).norm(), 1e-3 * expected.norm()) << i;
  }
}

INSTANTIATE_TEST_SUITE_P(Sets, GoldenTwoViews,
                         ::testing::Values("init_planar", "init_planar_ok", "init_nonplanar",
                                           "init_lowparallax"));

}  // namespace
}  // namespace orbslam

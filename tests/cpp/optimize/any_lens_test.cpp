// SPDX-License-Identifier: BSD-3-Clause
// Poses and bundles by sights: the same results through every kind of lens.
#include <gtest/gtest.h>

#include <random>

#include "optimize/bundle_adjustment.hpp"
#include "optimize/pose_optimization.hpp"
#include "random_bundles.hpp"

namespace orbslam {
namespace {

using testing::make_camera;
using testing::TestLens;
using testing::uniform;

class AnyLens : public ::testing::TestWithParam<TestLens> {};

struct Observed {
  std::vector<PoseObservation> observations;
  Pose T_cw;
};

/// Points around the camera; the noise is in raw pixels, as that of real keypoints.
Observed observed(const Camera& camera, double noise, bool with_depth) {
  std::mt19937_64 random(4);
  Observed all;
  all.T_cw = Pose::exp((Vector6d() << 0.3, -0.5, 0.2, 0.4, -1, 0.7).finished());
  while (all.observations.size() < 300) {
    const Eigen::Vector2f raw(static_cast<float>(uniform(random, 1, 639)),
                              static_cast<float>(uniform(random, 1, 479)));
    const Eigen::Vector2d uv = camera.from_image(raw).cast<double>();
    const Eigen::Vector3d ray = camera.ray(uv.x(), uv.y());
    const Eigen::Vector3d p = uniform(random, 2, 9) * ray.normalized();
    const Eigen::Vector2d shift(noise * uniform(random, -1, 1), noise * uniform(random, -1, 1));
    const Eigen::Vector2d seen =
        camera.from_image((camera.to_image(uv) + shift).cast<float>()).cast<double>();
    PoseObservation o;
    o.position = all.T_cw.inverse() * p;
    o.u = seen.x();
    o.v = seen.y();
    o.has_depth = with_depth && p.z() > 0.5 && all.observations.size() % 2 == 0;
    // Disparities are measured beside the error of the pixel.
    o.right_u = o.u - camera.disparity(p);
    all.observations.push_back(o);
  }
  return all;
}

TEST_P(AnyLens, APoseIsFoundAndOutliersAreLeftOut) {
  const auto camera = make_camera(GetParam(), 40);
  for (const bool with_depth : {false, true}) {
    Observed all = observed(*camera, 0, with_depth);
    for (std::size_t i = 0; i < all.observations.size(); i += 5) all.observations[i].u += 30;
    Vector6d off;
    off << 0.02, -0.03, 0.01, 0.1, -0.1, 0.05;
    const PoseEstimate estimate =
        optimize_pose(Pose::exp(off) * all.T_cw, *camera, all.observations);
    EXPECT_LT((estimate.T_cw * all.T_cw.inverse()).log().norm(), 1e-4);
    EXPECT_EQ(estimate.n_inliers, 240);
    for (std::size_t i = 0; i < 300; ++i) EXPECT_EQ(estimate.outlier[i], i % 5 == 0 ? 1 : 0) << i;
  }
}

// Of a flat plane with distortion the border would be trusted too much without its sight.
TEST_P(AnyLens, AsManyAreInliersAsTheNoiseAllows) {
  const auto camera = make_camera(GetParam());
  const Observed all = observed(*camera, 1.7, false);  // at most 5.8, below the gate
  const PoseEstimate estimate = optimize_pose(all.T_cw, *camera, all.observations);
  EXPECT_GE(estimate.n_inliers, 297);
}

TEST_P(AnyLens, BothSolversOfBundlesFindTheSameMinimum) {
  for (const bool with_depth : {false, true}) {
    const BundleProblem start = testing::random_bundle(9, 5, 60, 2, with_depth, GetParam());
    BundleProblem by_blocks = start, with_ceres = start;
    BundleOptions options;
    options.final_iterations = 30;
    const auto summary = solve_bundle(by_blocks, options, nullptr);
    options.solver = BundleSolver::kCeres;
    const auto other = solve_bundle(with_ceres, options, nullptr);
    EXPECT_LT(summary.final_cost, 0.2 * summary.initial_cost);
    EXPECT_NEAR(summary.final_cost, other.final_cost, 2e-3 * other.final_cost);
    for (std::size_t i = 0; i < start.cameras.size(); ++i) {
      const Pose difference = by_blocks.cameras[i].T_cw * with_ceres.cameras[i].T_cw.inverse();
      EXPECT_LT(difference.log().norm(), 2e-3) << i;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Lenses, AnyLens, ::testing::ValuesIn(testing::kTestLenses));

}  // namespace
}  // namespace orbslam

// SPDX-License-Identifier: BSD-3-Clause
// Two-view reconstruction of 2000 keypoints with 400 matches, and RANSAC over EPnP with 100
// correspondences, 40 % of them wrong.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <vector>

#include "geometry/epnp.hpp"
#include "geometry/pnp_ransac.hpp"
#include "geometry/two_view.hpp"
#include "measure.hpp"
#include "support/cameras.hpp"

namespace {

using namespace orbslam;

const auto camera = testing::make_camera({520, 525, 320, 240});

double uniform(RandomIntegers& random, double low, double high) {
  return low + (high - low) * static_cast<double>(random.below(1U << 30U)) / (1U << 30U);
}

void BM_ReconstructTwoViews(benchmark::State& state, bool planar) {
  RandomIntegers random(1);
  const Pose T_21(Eigen::Quaterniond(Eigen::AngleAxisd(0.06, Eigen::Vector3d::UnitY())),
                  Eigen::Vector3d(-0.8, 0.1, 0.15));
  std::vector<Eigen::Vector2f> initial, current;
  std::vector<int> matches(2000, -1);
  for (int i = 0; i < 2000; ++i) {
    const double u = uniform(random, 0, 640), v = uniform(random, 0, 480);
    const double depth = planar ? 4 + u / 200 : uniform(random, 3, 9);
    const Eigen::Vector2d x = camera->pinhole().project(T_21 * camera->unproject(u, v, depth));
    const auto noisy = [&](double value) {
      return static_cast<float>(value + uniform(random, -0.6, 0.6));
    };
    initial.emplace_back(noisy(u), noisy(v));
    current.emplace_back(noisy(x.x()), noisy(x.y()));
    if (i % 5 != 0) continue;
    const bool outlier = i % 50 == 0;
    matches[static_cast<std::size_t>(i)] = outlier ? i / 2 : i;
  }
  WorkerThread worker;
  WorkerThread* const helper = state.range(0) == 2 ? &worker : nullptr;
  TwoViewResult result;
  measure(state, [&] {
    result = reconstruct_two_views({initial, current, matches, *camera}, {}, 1, helper);
  });
  state.SetLabel(to_string(result.outcome));
}
BENCHMARK_CAPTURE(BM_ReconstructTwoViews, general, false)
    ->ArgName("threads")
    ->Arg(1)
    ->Arg(2)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(BM_ReconstructTwoViews, planar, true)
    ->ArgName("threads")
    ->Arg(1)
    ->Arg(2)
    ->Unit(benchmark::kMillisecond);

PnpProblem make_problem(int n, double outlier_share) {
  RandomIntegers random(2);
  PnpProblem problem;
  problem.camera = camera;
  problem.points.resize(3, n);
  problem.pixels.resize(2, n);
  problem.sigma2 = Eigen::VectorXd::Ones(n);
  for (int i = 0; i < n; ++i) {
    const double u = uniform(random, 0, 640), v = uniform(random, 0, 480);
    problem.points.col(i) = camera->unproject(u, v, uniform(random, 2, 8));
    problem.pixels.col(i) << u + uniform(random, -1, 1), v + uniform(random, -1, 1);
    if (uniform(random, 0, 1) < outlier_share) {
      problem.pixels.col(i) << uniform(random, 0, 640), uniform(random, 0, 480);
    }
  }
  return problem;
}

void BM_SolveEpnp(benchmark::State& state) {
  const PnpProblem problem = make_problem(static_cast<int>(state.range(0)), 0);
  measure(state, [&] {
    benchmark::DoNotOptimize(solve_epnp(problem.points, problem.pixels, *problem.camera));
  });
}
BENCHMARK(BM_SolveEpnp)->Arg(4)->Arg(100)->Unit(benchmark::kMicrosecond);

void BM_PnpRansac(benchmark::State& state, double outlier_share) {
  const PnpProblem problem = make_problem(100, outlier_share);
  measure(state, [&] {
    PnpRansac ransac(problem, {}, 1);
    benchmark::DoNotOptimize(ransac.iterate(ransac.max_iterations()));
  });
}
BENCHMARK_CAPTURE(BM_PnpRansac, outliers_40, 0.4)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(BM_PnpRansac, all_35_iterations, 1.0)->Unit(benchmark::kMillisecond);

}  // namespace

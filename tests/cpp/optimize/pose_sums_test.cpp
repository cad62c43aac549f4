// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/pose_sums.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "random_bundles.hpp"

namespace orbslam {
namespace {

using pose_sums::Task;
using testing::uniform;

std::vector<const pose_sums::Kernels*> all_pose_kernels() {
  std::vector<const pose_sums::Kernels*> kernels{&pose_sums::portable_kernels()};
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx2")) kernels.push_back(pose_sums::avx2_kernels());
#endif
  return kernels;
}

/// Points before a camera at the origin, and where they would be seen but for some pixels.
struct Seen {
  std::vector<double> x, y, z, u, v, right_u, weight, right_factor;

  explicit Seen(std::size_t n) {
    std::mt19937_64 random(n);
    for (std::size_t i = 0; i < n; ++i) {
      x.push_back(uniform(random, -2, 2));
      y.push_back(uniform(random, -1, 1));
      z.push_back(uniform(random, 2, 9));
      u.push_back(500 * x[i] / z[i] + 320 + uniform(random, -4, 4));
      v.push_back(510 * y[i] / z[i] + 240 + uniform(random, -4, 4));
      right_u.push_back(500 * x[i] / z[i] + 320 - 40 / z[i] + uniform(random, -4, 4));
      weight.push_back(i % 5 == 0 ? 0 : uniform(random, 0.3, 1));
      right_factor.push_back(i % 3 == 0 ? 1 : uniform(random, 0.1, 3));
    }
  }
  Task task(double huber) const {
    return {x.size(),
            x.data(),
            y.data(),
            z.data(),
            u.data(),
            v.data(),
            right_u.data(),
            weight.data(),
            right_factor.data(),
            false,
            {},
            {1, 0, 0, 0, 1, 0, 0, 0, 1},
            {0, 0, 0},
            500,
            510,
            320,
            240,
            40.0 / 500,
            40,
            huber};
  }
  /// The sum of squares, one after the other.
  double cost(bool stereo, double huber) const {
    double sum = 0;
    for (std::size_t i = 0; i < x.size(); ++i) {
      const double e_u = u[i] - (500 * x[i] / z[i] + 320), e_v = v[i] - (510 * y[i] / z[i] + 240);
      const double e_r = right_u[i] - (500 * x[i] / z[i] + 320 - 40 / z[i]);
      const double q =
          weight[i] * (e_u * e_u + e_v * e_v + (stereo ? right_factor[i] * e_r * e_r : 0));
      const bool inside = huber <= 0 || q <= huber * huber;
      sum += inside ? q : 2 * huber * std::sqrt(q) - huber * huber;
    }
    return sum;
  }
};

TEST(PoseSums, CostIsThatOfAPlainLoop) {
  for (const std::size_t n : {4U, 40U, 400U}) {
    const Seen seen(n);
    for (const double huber : {0.0, 2.0}) {
      for (const pose_sums::Kernels* kernels : all_pose_kernels()) {
        EXPECT_NEAR(kernels->mono(seen.task(huber), nullptr) / seen.cost(false, huber), 1, 1e-12);
        EXPECT_NEAR(kernels->stereo(seen.task(huber), nullptr) / seen.cost(true, huber), 1, 1e-12);
      }
    }
  }
}

TEST(PoseSums, AllGiveTheSameBytes) {
  using System = std::array<double, pose_sums::kSystemSize>;
  for (const std::size_t n : {4U, 12U, 400U}) {
    const Seen seen(n);
    for (const double huber : {0.0, 2.0}) {
      for (const bool stereo : {false, true}) {
        std::vector<double> costs;
        std::vector<System> systems;
        for (const pose_sums::Kernels* kernels : all_pose_kernels()) {
          System system{};
          const auto kernel = stereo ? kernels->stereo : kernels->mono;
          costs.push_back(kernel(seen.task(huber), system.data()));
          systems.push_back(system);
          EXPECT_GT(system[0], 0);
          // With and without the system.
          EXPECT_EQ(kernel(seen.task(huber), nullptr), costs.back());
        }
        for (const double cost : costs) EXPECT_EQ(cost, costs[0]);
        for (const System& system : systems) EXPECT_EQ(system, systems[0]);
      }
    }
  }
}

TEST(PoseSums, PointsOnTheCamerasPlaneTakeNoPart) {
  Seen seen(4);
  const Seen as_it_was = seen;
  for (const double depth : {0.0, 1e-12, -1e-12}) {
    seen.z[2] = depth;
    for (const pose_sums::Kernels* kernels : all_pose_kernels()) {
      std::array<double, pose_sums::kSystemSize> system{};
      EXPECT_TRUE(std::isfinite(kernels->stereo(seen.task(2), system.data())));
      for (const double entry : system) EXPECT_TRUE(std::isfinite(entry));
    }
  }
  Seen without = as_it_was;
  without.weight[2] = 0;
  EXPECT_EQ(pose_sums::best_kernels().stereo(seen.task(2), nullptr),
            pose_sums::best_kernels().stereo(without.task(2), nullptr));
}

}  // namespace
}  // namespace orbslam

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <memory>
#include <vector>

#include "optimize/bundle_adjustment.hpp"
#include "optimize/bundle_kernels.hpp"
#include "optimize/bundle_stop_rule.hpp"

namespace orbslam {

/// kEqual damps all unknowns equally, starting at 1e-5 times the largest curvature. Weakly
/// determined depths hardly move while the rest converges. A first stage of few iterations then
/// classifies them as the published method does. kScaled damps every unknown weakly, in proportion
/// to its own curvature, and needs half the iterations to converge.
enum class BundleDamping { kEqual, kScaled };

// First damping over the largest curvature.
inline constexpr double kInitialDamping = 1e-5;
// Weakly damped steps converge quadratically: after a step with a smaller relative decrease of the
// cost than this, the next one changes nothing significant.
inline constexpr double kConverged = 1e-4;
// The first damping by curvature is one over this. It is larger than Ceres' default. A still larger
// value would let depths of small parallax overshoot, and the step would be rejected.
inline constexpr double kInitialTrustRadius = 1e5;

struct BundleStage {
  int iterations = 0;  ///< accepted steps at most; twice as many in all
  BundleDamping damping = BundleDamping::kEqual;
  const std::atomic<bool>* abort = nullptr;
  const TimeLimit* limit = nullptr;
};

/// Minimises a bundle that it refers to. Kernels are on, if the options want them, until
/// keep_inliers.
class BundleMinimiser {
 public:
  virtual ~BundleMinimiser() = default;
  /// Takes kernels away and leaves the flagged observations out.
  virtual void keep_inliers(const std::vector<std::uint8_t>& outlier) = 0;
  /// Writes the poses and points reached into the bundle and counts steps. Returns whether the flag
  /// was raised.
  virtual bool minimise(const BundleStage& stage, BundleSummary& summary) = 0;
};

/// `usable`: per observation whether it takes part at first. With Ceres.
std::unique_ptr<BundleMinimiser> ceres_minimiser(BundleProblem& problem,
                                                 const BundleOptions& options,
                                                 const std::vector<std::uint8_t>& usable);
/// By blocks of fixed size, in memory that a thread keeps from one bundle to the next: at most one
/// in a thread at a time.
std::unique_ptr<BundleMinimiser> block_minimiser(BundleProblem& problem,
                                                 const BundleOptions& options,
                                                 const std::vector<std::uint8_t>& usable,
                                                 const bundle_kernels::Kernels& kernels);

}  // namespace orbslam

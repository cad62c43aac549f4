// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <memory>
#include <vector>

#include "base/pose.hpp"
#include "camera/camera.hpp"
#include "inertial/preintegration.hpp"

namespace orbslam {

/// A bundle adjustment as flat arrays: no map, no locks. See docs/method/adjustment.md#residuals.
struct BundleProblem {
  struct Camera {
    Pose T_cw;
    std::shared_ptr<const orbslam::Camera> model;
    bool fixed = false;
  };
  struct Observation {
    std::uint32_t camera = 0;
    std::uint32_t point = 0;
    float u = 0, v = 0;
    float right_u = 0;  ///< only if has_depth
    float inverse_sigma2 = 1;
    float right_factor = 1;  ///< inverse variance of the right column over that of u and v
    bool has_depth = false;
  };
  /// State of an IMU at a camera, without its pose.
  struct Motion {
    std::uint32_t camera = 0;
    Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  ///< in the world [m/s]
    ImuBias bias;
    /// Of the bias before (gyro, accelerometer): the inverse variances.
    Vector6d bias_information = Vector6d::Zero();
    bool fixed = false;
  };
  /// Samples from one motion to another.
  struct ImuLink {
    std::uint32_t first = 0, second = 0;
    std::shared_ptr<const Preintegration> motion;
  };
  /// Empty without an IMU. With the solver of blocks only.
  struct Inertial {
    std::vector<Motion> motions;
    std::vector<ImuLink> links;
    Pose T_cb;                                          ///< from the IMU to the camera
    Eigen::Vector3d gravity = Eigen::Vector3d::Zero();  ///< of free fall in the world [m/s^2]
  };
  std::vector<Camera> cameras;
  std::vector<Eigen::Vector3d> points;
  std::vector<Observation> observations;
  Inertial inertial;
};

/// kBlocks is this project's solver: blocks of fixed size, four lanes at once, the same bytes with
/// any number of threads. It suits bundles in which nearly all keyframes share points
/// (docs/method/adjustment.md#blocks). kCeres suits large and sparse bundles, and serves for
/// comparison.
enum class BundleSolver { kBlocks, kCeres };

struct BundleOptions {
  int robust_iterations = 5;  ///< first stage, with Huber kernel if `robust`
  /// Second stage, without kernel, on the inliers of the first. 0: no such stage.
  int final_iterations = 10;
  bool robust = true;
  int n_threads = 1;  ///< with Ceres only 1 gives the same bytes in every run
  /// Steps along directions and inverse depths of points (see BundlePoint) instead of coordinates.
  /// Large maps, whose points of small parallax otherwise forbid long steps, need half the steps.
  /// With Ceres only.
  bool inverse_depth = false;
  /// No iteration is begun that would probably end later; 0: no limit. The result so far is used.
  double max_seconds = 0;
  BundleSolver solver = BundleSolver::kBlocks;
};

struct BundleSummary {
  /// Sums of squared whitened residuals over all observations that were in front of their camera at
  /// the start, robustified if the options say so.
  double initial_cost = 0, final_cost = 0;
  int iterations = 0;    ///< accepted steps; each lowered the cost of its stage
  bool aborted = false;  ///< the flag was raised; parameters hold the result so far
  bool stage_one_done = false;
  bool timed_out = false;             ///< max_seconds ended it
  std::vector<std::uint8_t> outlier;  ///< per observation, judged at the final estimate
};

/// Solves in place (points eliminated by Schur complement, analytic Jacobians). `abort` is polled
/// once per iteration; nullptr: never. Observations that their camera cannot see or with NaN or
/// infinite numbers at the start take no part in the first stage. Throws StateError when an
/// observation names a camera or point that does not exist, or for options that exclude each other.
BundleSummary solve_bundle(BundleProblem& problem, const BundleOptions& options,
                           const std::atomic<bool>* abort);

}  // namespace orbslam

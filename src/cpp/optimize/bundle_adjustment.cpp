// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/bundle_adjustment.hpp"

#include <ceres/ceres.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <string>

#include "base/errors.hpp"
#include "optimize/bundle_iterations.hpp"
#include "optimize/bundle_point.hpp"
#include "optimize/bundle_residuals.hpp"
#include "optimize/gates.hpp"
#include "optimize/single_openmp_thread.hpp"

namespace orbslam {
namespace {

constexpr double kInitialDamping = 1e-5;
// Hardly damped steps converge quadratically: after one with a smaller relative decrease of the
// cost than this, the next would change nothing that matters.
constexpr double kConverged = 1e-4;
// More than Ceres' default, but not so much that depths of small parallax shoot beyond their mark
// and the step is rejected.
constexpr double kInitialTrustRadius = 1e5;
// With more free poses the reduced camera system is sparse enough to gain by it.
constexpr std::size_t kMaxDenseCameras = 30;

using Observation = BundleProblem::Observation;

void check_indices(const BundleProblem& problem) {
  for (std::size_t i = 0; i < problem.observations.size(); ++i) {
    const Observation& o = problem.observations[i];
    if (o.camera >= problem.cameras.size() || o.point >= problem.points.size()) {
      throw StateError("solve_bundle: observation " + std::to_string(i) + " names camera " +
                       std::to_string(o.camera) + " and point " + std::to_string(o.point) +
                       ", but there are " + std::to_string(problem.cameras.size()) + " and " +
                       std::to_string(problem.points.size()));
    }
  }
}

/// Squared whitened residual of every observation, and whether its point is in front.
struct Judgement {
  std::vector<double> chi2;
  std::vector<std::uint8_t> in_front;

  bool usable(std::size_t i) const { return in_front[i] != 0 && std::isfinite(chi2[i]); }
  bool outlier(std::size_t i, bool has_depth) const {
    return !(usable(i) && chi2[i] <= (has_depth ? kGateStereo : kGateMono));
  }
};

Judgement judge(const BundleProblem& problem) {
  std::vector<Eigen::Matrix3d> rotations;
  rotations.reserve(problem.cameras.size());
  for (const auto& camera : problem.cameras) rotations.push_back(camera.T_cw.rotation_matrix());
  const std::size_t n = problem.observations.size();
  Judgement result{std::vector<double>(n), std::vector<std::uint8_t>(n)};
  for (std::size_t i = 0; i < n; ++i) {
    const Observation& o = problem.observations[i];
    const BundleProblem::Camera& camera = problem.cameras[o.camera];
    const Eigen::Vector3d p =
        rotations[o.camera] * problem.points[o.point] + camera.T_cw.translation();
    const Eigen::Vector2d pixel = camera.pinhole.project(p);
    double squared = (Eigen::Vector2d(o.u, o.v) - pixel).squaredNorm();
    if (o.has_depth) {
      const double error = o.right_u - (pixel.x() - camera.bf / p.z());
      squared += error * error;
    }
    result.chi2[i] = static_cast<double>(o.inverse_sigma2) * squared;
    result.in_front[i] = p.z() > 0 ? 1 : 0;
  }
  return result;
}

double kernel_width(const Observation& o) { return o.has_depth ? kHuberStereo : kHuberMono; }

double kernel_cost(double q, double width) {
  return width > 0 && q > width * width ? 2 * width * std::sqrt(q) - width * width : q;
}

/// Sum of squares of the observations that were usable at the start, robustified if wanted. One
/// that has fallen behind its camera since is charged what it cost at the start.
double total_cost(const BundleProblem& problem, const Judgement& start, const Judgement& now,
                  bool robust) {
  double sum = 0;
  for (std::size_t i = 0; i < problem.observations.size(); ++i) {
    if (!start.usable(i)) continue;
    const double width = robust ? kernel_width(problem.observations[i]) : 0.0;
    sum += kernel_cost(now.usable(i) ? now.chi2[i] : start.chi2[i], width);
  }
  return sum;
}

/// The Ceres problem of a bundle. Cost functions read measurements by pointer, so the second stage
/// changes weights and kernels instead of building again.
class BundleSolver final : public ceres::EvaluationCallback {
 public:
  /// kEqual damps all unknowns alike, starting at 1e-5 times the largest curvature. It leaves
  /// weakly determined depths where they were while the rest converges, so that a stage of few
  /// iterations before the classification judges them as the published method does. kScaled damps
  /// every unknown in proportion to its own curvature and hardly at all, which needs half the
  /// iterations to converge.
  enum class Damping { kEqual, kScaled };

  BundleSolver(BundleProblem& problem, const BundleOptions& options, const Judgement& start)
      : bundle_(problem), options_(options), problem_(problem_options(this)) {
    make_views();
    if (options.inverse_depth) make_charts();
    make_measurements(start);
    add_residuals();
  }

  void PrepareForEvaluation(bool, bool new_evaluation_point) override {
    if (new_evaluation_point) evaluate();
  }

  /// Takes kernels away and leaves outliers out.
  void keep_inliers(const Judgement& now) {
    for (std::size_t i = 0; i < measurements_.size(); ++i) {
      const Observation& o = bundle_.observations[i];
      measurements_[i].huber = 0;
      measurements_[i].scale = now.outlier(i, o.has_depth) ? 0.0 : deviation(o);
    }
  }

  /// Minimises and writes the poses and points reached into the bundle. Returns whether the flag
  /// was raised.
  bool minimise(int iterations, Damping damping, const std::atomic<bool>* abort,
                const TimeLimit* limit, BundleSummary& summary) {
    if (problem_.NumResidualBlocks() == 0 || is_raised(abort)) return is_raised(abort);
    const bool equal = damping == Damping::kEqual;
    BundleIterations rules(iterations, equal ? 0.0 : kConverged, abort, limit);
    ceres::Solver::Options solver = solver_options(iterations);
    if (equal) {
      solver.min_lm_diagonal = solver.max_lm_diagonal = 1;
      solver.initial_trust_region_radius = 1 / (kInitialDamping * max_curvature());
    }
    solver.callbacks.push_back(&rules);
    ceres::Solver::Summary report;
    const SingleOpenMpThread single;
    ceres::Solve(solver, &problem_, &report);
    summary.iterations += rules.successful();
    summary.timed_out = rules.timed_out();
    if (rules.successful() == 0) return rules.aborted();
    for (const std::size_t camera : free_cameras_) {
      views_[camera].move(parameters(camera));
      bundle_.cameras[camera].T_cw = views_[camera].T_cw();
    }
    read_charts();
    return rules.aborted();
  }

 private:
  static ceres::Problem::Options problem_options(ceres::EvaluationCallback* callback) {
    ceres::Problem::Options options;
    options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    options.disable_all_safety_checks = true;
    options.evaluation_callback = callback;
    return options;
  }

  static double deviation(const Observation& o) {
    return std::sqrt(static_cast<double>(o.inverse_sigma2));
  }
  double* parameters(std::size_t camera) {
    return parameters_.data() + camera * BundleView::kParameters;
  }

  void make_views() {
    for (const BundleProblem::Camera& camera : bundle_.cameras) {
      views_.emplace_back(camera.T_cw, camera.pinhole, camera.bf);
    }
    parameters_.assign(views_.size() * BundleView::kParameters, 0.0);
  }

  /// Every point is seen from where the first of its cameras is at the start.
  void make_charts() {
    std::vector<const BundleView*> first(bundle_.points.size(), nullptr);
    for (const Observation& o : bundle_.observations) {
      if (first[o.point] == nullptr) first[o.point] = &views_[o.camera];
    }
    charts_.reserve(first.size());
    for (std::size_t i = 0; i < first.size(); ++i) {
      const Eigen::Vector3d& point = bundle_.points[i];
      charts_.emplace_back(first[i] != nullptr ? first[i]->T_cw().center() : point, point);
    }
    chart_parameters_.assign(charts_.size() * BundlePoint::kParameters, 0.0);
  }

  void move_charts() {
    for (std::size_t i = 0; i < charts_.size(); ++i) {
      charts_[i].move(chart_parameters_.data() + i * BundlePoint::kParameters);
    }
  }

  /// Points that have moved to the bundle.
  void read_charts() {
    move_charts();
    for (std::size_t i = 0; i < charts_.size(); ++i) {
      const double* p = chart_parameters_.data() + i * BundlePoint::kParameters;
      if (p[0] != 0 || p[1] != 0 || p[2] != 0) bundle_.points[i] = charts_[i].position();
    }
  }

  /// The parameter block of a point.
  double* point_block(std::size_t point) {
    return charts_.empty() ? bundle_.points[point].data()
                           : chart_parameters_.data() + point * BundlePoint::kParameters;
  }

  void make_measurements(const Judgement& start) {
    measurements_.resize(bundle_.observations.size());
    for (std::size_t i = 0; i < measurements_.size(); ++i) {
      const Observation& o = bundle_.observations[i];
      BundleMeasurement& m = measurements_[i];
      m.view = &views_[o.camera];
      m.point = bundle_.points[o.point].data();
      if (!charts_.empty()) {
        m.point = charts_[o.point].position().data();
        m.chart = &charts_[o.point].jacobian();
      }
      m.has_depth = o.has_depth;
      m.huber = options_.robust ? kernel_width(o) : 0.0;
      m.u = o.u;
      m.v = o.v;
      m.right_u = o.right_u;
      m.scale = start.usable(i) ? deviation(o) : 0.0;
    }
  }

  void add_residuals() {
    std::vector<std::uint8_t> used(bundle_.cameras.size(), 0);
    for (const Observation& o : bundle_.observations) used[o.camera] = 1;
    for (std::size_t i = 0; i < used.size(); ++i) {
      if (used[i] == 0 || bundle_.cameras[i].fixed) continue;
      free_cameras_.push_back(i);
      problem_.AddParameterBlock(parameters(i), BundleView::kParameters);
    }
    for (std::size_t i = 0; i < measurements_.size(); ++i) {
      const Observation& o = bundle_.observations[i];
      if (!bundle_.points[o.point].allFinite()) continue;
      double* point = point_block(o.point);
      const BundleMeasurement* m = &measurements_[i];
      if (problem_.NumResidualBlocks() == 0) {
        problem_.AddResidualBlock(&missing_cost_block_, nullptr, point);
      }
      if (bundle_.cameras[o.camera].fixed) {
        problem_.AddResidualBlock(&image_fixed_.emplace_back(m), nullptr, point);
        if (!o.has_depth) continue;
        problem_.AddResidualBlock(&right_fixed_.emplace_back(m), nullptr, point);
      } else {
        double* pose = parameters(o.camera);
        problem_.AddResidualBlock(&image_free_.emplace_back(m), nullptr, pose, point);
        if (!o.has_depth) continue;
        problem_.AddResidualBlock(&right_free_.emplace_back(m), nullptr, pose, point);
      }
    }
  }

  void evaluate() {
    move_charts();
    for (const std::size_t camera : free_cameras_) views_[camera].move(parameters(camera));
    missing_cost_ = 0;
    for (BundleMeasurement& m : measurements_) missing_cost_ += m.evaluate();
  }

  /// Largest diagonal entry of the Gauss-Newton matrix at the present poses and points.
  double max_curvature() {
    evaluate();
    std::vector<Vector6d> poses(views_.size(), Vector6d::Zero());
    std::vector<Eigen::Vector3d> points(bundle_.points.size(), Eigen::Vector3d::Zero());
    for (std::size_t i = 0; i < measurements_.size(); ++i) {
      const Observation& o = bundle_.observations[i];
      measurements_[i].add_curvature(poses[o.camera], points[o.point]);
    }
    double largest = 1;
    for (const std::size_t camera : free_cameras_) {
      largest = std::max(largest, poses[camera].maxCoeff());
    }
    for (const Eigen::Vector3d& point : points) largest = std::max(largest, point.maxCoeff());
    return largest;
  }

  ceres::Solver::Options solver_options(int iterations) {
    ceres::Solver::Options solver;
    solver.max_num_iterations = 2 * iterations;
    solver.function_tolerance = 0;  // would throw the last step away; BundleIterations keeps it
    solver.initial_trust_region_radius = kInitialTrustRadius;
    solver.num_threads = options_.n_threads;
    solver.logging_type = ceres::SILENT;
    solver.jacobi_scaling = false;  // the damping takes care of different units
    // Without free poses the points do not depend on each other, which only a sparse solver sees.
    if (free_cameras_.empty()) {
      solver.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
      return solver;
    }
    solver.linear_solver_type =
        free_cameras_.size() <= kMaxDenseCameras ? ceres::DENSE_SCHUR : ceres::SPARSE_SCHUR;
    auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
    std::vector<double*> blocks;
    problem_.GetParameterBlocks(&blocks);
    for (double* block : blocks) {
      const bool is_camera =
          block >= parameters_.data() && block < parameters_.data() + parameters_.size();
      ordering->AddElementToGroup(block, is_camera ? 1 : 0);
    }
    solver.linear_solver_ordering = ordering;
    return solver;
  }

  BundleProblem& bundle_;
  BundleOptions options_;
  std::vector<BundleView> views_;
  std::vector<double> parameters_;
  std::vector<std::size_t> free_cameras_;
  std::vector<BundlePoint> charts_;  // empty: points are their coordinates
  std::vector<double> chart_parameters_;
  std::vector<BundleMeasurement> measurements_;
  double missing_cost_ = 0;
  MissingCost missing_cost_block_{&missing_cost_};
  std::deque<ImageResiduals<true>> image_free_;
  std::deque<ImageResiduals<false>> image_fixed_;
  std::deque<RightResidual<true>> right_free_;
  std::deque<RightResidual<false>> right_fixed_;
  ceres::Problem problem_;
};

}  // namespace

BundleSummary solve_bundle(BundleProblem& problem, const BundleOptions& options,
                           const std::atomic<bool>* abort) {
  check_indices(problem);
  const TimeLimit time_limit(options.max_seconds);
  const TimeLimit* limit = options.max_seconds > 0 ? &time_limit : nullptr;
  BundleSummary summary;
  const Judgement start = judge(problem);
  Judgement now = start;
  summary.initial_cost = total_cost(problem, start, start, options.robust);
  summary.aborted = is_raised(abort);
  if (!summary.aborted) {
    BundleSolver solver(problem, options, start);
    const auto damping = options.final_iterations > 0 ? BundleSolver::Damping::kEqual
                                                      : BundleSolver::Damping::kScaled;
    summary.aborted = solver.minimise(options.robust_iterations, damping, abort, limit, summary);
    summary.stage_one_done = !summary.aborted && !summary.timed_out;
    if (summary.stage_one_done && options.final_iterations > 0) {
      solver.keep_inliers(judge(problem));
      summary.aborted = solver.minimise(options.final_iterations, BundleSolver::Damping::kScaled,
                                        abort, limit, summary);
    }
    now = judge(problem);
  }
  summary.final_cost = total_cost(problem, start, now, options.robust);
  summary.outlier.resize(problem.observations.size());
  for (std::size_t i = 0; i < summary.outlier.size(); ++i) {
    summary.outlier[i] = now.outlier(i, problem.observations[i].has_depth) ? 1 : 0;
  }
  return summary;
}

}  // namespace orbslam

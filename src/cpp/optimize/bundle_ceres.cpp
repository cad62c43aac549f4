// SPDX-License-Identifier: BSD-3-Clause
#include <ceres/ceres.h>

#include <algorithm>
#include <cmath>
#include <deque>

#include "optimize/bundle_iterations.hpp"
#include "optimize/bundle_minimiser.hpp"
#include "optimize/bundle_point.hpp"
#include "optimize/bundle_residuals.hpp"
#include "optimize/gates.hpp"
#include "optimize/single_openmp_thread.hpp"

namespace orbslam {
namespace {

// With more free poses the reduced camera system is sparse enough to gain by it.
constexpr std::size_t kMaxDenseCameras = 30;

using Observation = BundleProblem::Observation;

/// The Ceres problem of a bundle. Cost functions read measurements by pointer, so the second stage
/// changes weights and kernels instead of building again.
class CeresMinimiser final : public BundleMinimiser, public ceres::EvaluationCallback {
 public:
  CeresMinimiser(BundleProblem& problem, const BundleOptions& options,
                 const std::vector<std::uint8_t>& usable)
      : bundle_(problem), options_(options), problem_(problem_options(this)) {
    make_views();
    if (options.inverse_depth) make_charts();
    make_measurements(usable);
    add_residuals();
  }

  void PrepareForEvaluation(bool, bool new_evaluation_point) override {
    if (new_evaluation_point) evaluate();
  }

  void keep_inliers(const std::vector<std::uint8_t>& outlier) override {
    for (std::size_t i = 0; i < measurements_.size(); ++i) {
      const Observation& o = bundle_.observations[i];
      measurements_[i].huber = 0;
      measurements_[i].scale = outlier[i] != 0 ? 0.0 : deviation(o);
    }
  }

  bool minimise(const BundleStage& stage, BundleSummary& summary) override {
    if (problem_.NumResidualBlocks() == 0 || is_raised(stage.abort)) return is_raised(stage.abort);
    const bool equal = stage.damping == BundleDamping::kEqual;
    BundleIterations rules(stage.iterations, equal ? 0.0 : kConverged, stage.abort, stage.limit);
    ceres::Solver::Options solver = solver_options(stage.iterations);
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
      views_.emplace_back(camera.T_cw, *camera.model);
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

  void make_measurements(const std::vector<std::uint8_t>& usable) {
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
      m.huber = !options_.robust ? 0.0 : o.has_depth ? kHuberStereo : kHuberMono;
      m.u = o.u;
      m.right_u = o.right_u;
      const Sight sight = bundle_.cameras[o.camera].model->sight(o.u, o.v);
      const bool shown = sight.allFinite();
      if (shown) m.sight = sight;
      m.scale = shown && usable[i] != 0 ? deviation(o) : 0.0;
      m.right_scale = std::sqrt(static_cast<double>(o.right_factor));
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
    solver.function_tolerance = 0;  // would discard the last step; BundleIterations keeps it
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

std::unique_ptr<BundleMinimiser> ceres_minimiser(BundleProblem& problem,
                                                 const BundleOptions& options,
                                                 const std::vector<std::uint8_t>& usable) {
  return std::make_unique<CeresMinimiser>(problem, options, usable);
}

}  // namespace orbslam

// SPDX-License-Identifier: BSD-3-Clause
// Levenberg-Marquardt over blocks of fixed size. See docs/method/adjustment.md#blocks.
#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "base/task_pair.hpp"
#include "optimize/block_bundle.hpp"
#include "optimize/bundle_minimiser.hpp"
#include "optimize/gates.hpp"
#include "optimize/inertial_system.hpp"

namespace orbslam {
namespace {

using bundle_kernels::kBlockSize;
using bundle_kernels::kCameraSize;
using bundle_kernels::Kernels;
using bundle_kernels::kPointSize;
using bundle_kernels::kReducedSize;
using bundle_kernels::kStepSize;
using bundle_kernels::kViewSize;
using bundle_kernels::Task;

// A step must bring this part of the decrease that the linear system predicts.
constexpr double kLeastGain = 1e-3;
// Below this part of the cost a predicted decrease is lost in the rounding of sums.
constexpr double kNoise = 1e-11;
// Bounds of curvatures that damp, as those of points in the kernels.
constexpr double kLeastCurvature = 1e-6, kMostCurvature = 1e32;

/// Memory that a thread reuses for the next bundle.
struct Workspace {
  struct Sums {
    std::vector<double> blocks, cameras, reduced, scratch;
  };
  BlockBundle bundle;
  std::vector<double> views, moved_views, points, moved_points;
  std::vector<double> camera_frame, coupling, point_states;
  std::vector<double> steps, solution, factor_scratch;
  std::vector<Pose> poses, moved_poses;
  std::array<Sums, BlockBundle::kTasks> sums;
};

Workspace& workspace() {
  thread_local Workspace memory;
  return memory;
}

void write_view(const Pose& T_cw, double* view) {
  const Eigen::Matrix3d R = T_cw.rotation_matrix();
  for (int row = 0; row < 3; ++row) {
    for (int k = 0; k < 3; ++k) view[4 * row + k] = R(row, k);
    view[4 * row + 3] = T_cw.translation()(row);
  }
}

class BlockMinimiser final : public BundleMinimiser {
 public:
  BlockMinimiser(BundleProblem& problem, const BundleOptions& options,
                 const std::vector<std::uint8_t>& usable, const Kernels& kernels)
      : problem_(problem), robust_(options.robust), kernels_(kernels), w_(workspace()) {
    w_.bundle.build(problem, usable);
    copy_estimate();
    make_room();
    if (!problem.inertial.links.empty()) inertial_.emplace(problem, w_.bundle.free_cameras());
    if (options.n_threads > 1) pair_.emplace();
  }

  void keep_inliers(const std::vector<std::uint8_t>& outlier) override {
    robust_ = false;
    w_.bundle.set_weights(problem_, outlier);
  }

  bool minimise(const BundleStage& stage, BundleSummary& summary) override {
    if (w_.bundle.empty() || is_raised(stage.abort)) return is_raised(stage.abort);
    const bool equal = stage.damping == BundleDamping::kEqual;
    BundleStopRule rule(stage.iterations, equal ? 0.0 : kConverged);
    scaled_ = !equal;
    damping_ =
        equal ? kInitialDamping * std::max(1.0, largest_curvature()) : 1 / kInitialTrustRadius;
    double growth = 2;
    cost_ = cost_at(w_.views, w_.points);
    if (inertial_) cost_ += inertial_->cost(free_poses(w_.poses), false);
    rule.start(cost_);
    bool done = false, aborted = false;
    for (int trial = 0; !done && !aborted && !summary.timed_out && trial < 2 * stage.iterations;
         ++trial) {
      const auto began = std::chrono::steady_clock::now();
      const double gain = try_step();
      if (predicted_ >= 0 && predicted_ <= kNoise * cost_) break;
      if (gain > kLeastGain) {
        accept();
        done = rule.accept(cost_);
        damping_ *= std::max(kLeastDampingFactor, 1 - std::pow(2 * gain - 1, 3));
        growth = 2;
      } else {
        done = rule.reject();
        damping_ *= growth;
        growth *= 2;
      }
      aborted = is_raised(stage.abort);
      const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - began;
      summary.timed_out =
          !done && !aborted && stage.limit != nullptr && stage.limit->left() < taken.count();
    }
    summary.iterations += rule.successful();
    if (rule.successful() > 0) write_estimate();
    return aborted;
  }

 private:
  void copy_estimate() {
    const auto& cameras = w_.bundle.cameras();
    w_.poses.clear();
    w_.views.resize(cameras.size() * kViewSize);
    for (std::size_t i = 0; i < cameras.size(); ++i) {
      w_.poses.push_back(problem_.cameras[cameras[i]].T_cw);
      write_view(w_.poses[i], &w_.views[i * kViewSize]);
    }
    w_.moved_poses = w_.poses;
    w_.moved_views = w_.views;
    w_.points.assign(problem_.points.size() * kPointSize, 0.0);
    for (std::size_t i = 0; i < problem_.points.size(); ++i) {
      if (!w_.bundle.has_point(i)) continue;
      for (int k = 0; k < 3; ++k) w_.points[i * kPointSize + k] = problem_.points[i](k);
    }
    w_.moved_points.resize(w_.points.size());
  }

  void make_room() {
    const std::size_t n = w_.bundle.n_free(), slots = w_.bundle.n_slots();
    const std::size_t batch = w_.bundle.batch_size();
    w_.camera_frame.resize(3 * slots);
    w_.coupling.resize(9 * slots);
    w_.point_states.resize(problem_.points.size() * bundle_kernels::kPointStateSize);
    w_.steps.assign(std::max<std::size_t>(n, 1) * kStepSize, 0.0);
    w_.solution.resize(6 * n);
    w_.factor_scratch.resize(bundle_kernels::kFactoriseSize * n);
    for (auto& sums : w_.sums) {
      sums.blocks.resize(n * (n + 1) / 2 * kBlockSize);
      // One more, which the padding of lists may add zeros to when no camera is free.
      sums.cameras.resize((n + 1) * kCameraSize);
      sums.reduced.resize((n + 1) * kReducedSize);
      sums.scratch.resize(bundle_kernels::kScratchArrays * batch +
                          w_.bundle.longest() * bundle_kernels::kRecordSize);
    }
  }

  Task task(std::size_t number, const std::vector<double>& views,
            const std::vector<double>& points) {
    Workspace::Sums& sums = w_.sums[number];
    Task t{};
    w_.bundle.describe(number, t);
    t.huber_mono = robust_ ? kHuberMono : 0;
    t.huber_stereo = robust_ ? kHuberStereo : 0;
    t.damping = damping_;
    t.damp_scaled = scaled_;
    t.views = views.data();
    t.points = points.data();
    t.camera_frame = w_.camera_frame.data();
    t.coupling = w_.coupling.data();
    t.stride = w_.bundle.n_slots();
    t.point_states = w_.point_states.data();
    t.blocks = sums.blocks.data();
    t.cameras = sums.cameras.data();
    t.reduced = sums.reduced.data();
    t.scratch = sums.scratch.data();
    t.scratch_stride = w_.bundle.batch_size();
    t.steps = w_.steps.data();
    t.moved_points = w_.moved_points.data();
    return t;
  }

  /// Calls work(number) for both tasks.
  template <class Work>
  void for_each_task(const Work& work) {
    static_assert(BlockBundle::kTasks == 2);
    if (pair_) {
      pair_->run([&work](int number) noexcept { work(static_cast<std::size_t>(number)); });
    } else {
      work(0);
      work(1);
    }
  }

  double cost_at(const std::vector<double>& views, const std::vector<double>& points) {
    std::array<double, BlockBundle::kTasks> costs{};
    for_each_task(
        [&](std::size_t number) { costs[number] = kernels_.cost(task(number, views, points)); });
    return costs[0] + costs[1];
  }

  static void clear(std::vector<double>& values) { std::fill(values.begin(), values.end(), 0.0); }

  double largest_curvature() {
    std::array<double, BlockBundle::kTasks> largest{};
    for_each_task([&](std::size_t number) {
      clear(w_.sums[number].cameras);
      largest[number] = kernels_.curvature(task(number, w_.views, w_.points));
    });
    double result = std::max(largest[0], largest[1]);
    for (std::size_t i = 0; i < w_.bundle.n_free(); ++i) {
      for (std::size_t k = 0; k < 6; ++k) {
        const std::size_t at = i * kCameraSize + k * (k + 3) / 2;
        result = std::max(result, w_.sums[0].cameras[at] + w_.sums[1].cameras[at]);
      }
    }
    return result;
  }

  /// Sums of both tasks, and the damped system of the cameras, in those of task 0.
  void assemble() {
    Workspace::Sums &all = w_.sums[0], &other = w_.sums[1];
    for (std::size_t i = 0; i < all.blocks.size(); ++i) all.blocks[i] += other.blocks[i];
    const std::size_t n = w_.bundle.n_free();
    double* diagonal_block = all.blocks.data();
    for (std::size_t i = 0; i < n; ++i) {
      const double* other_camera = &other.cameras[i * kCameraSize];
      double* camera = &all.cameras[i * kCameraSize];
      for (int k = 0; k < kCameraSize; ++k) camera[k] += other_camera[k];
      int k = 0;
      for (int row = 0; row < 6; ++row) {
        for (int column = 0; column <= row; ++column, ++k) {
          diagonal_block[6 * column + row] += camera[k];
        }
        diagonal_block[7 * row] += damping_of(camera[k - 1]);
        const double* reduced = &all.reduced[i * kReducedSize];
        w_.solution[6 * i + row] =
            camera[21 + row] - (reduced[row] + other.reduced[i * kReducedSize + row]);
      }
      diagonal_block += (n - i) * kBlockSize;
    }
  }

  double damping_of(double curvature) const {
    return damping_ * (scaled_ ? std::clamp(curvature, kLeastCurvature, kMostCurvature) : 1.0);
  }

  std::vector<Pose> free_poses(const std::vector<Pose>& poses) const {
    return {poses.begin(), poses.begin() + static_cast<std::ptrdiff_t>(w_.bundle.n_free())};
  }

  /// Solves the assembled system of the cameras together with the inertial residuals. Returns their
  /// part of the predicted decrease; NaN if there is no solution.
  double solve_with_imu() {
    const Eigen::Index size = inertial_->n_unknowns(), of_cameras = inertial_->n_camera_unknowns();
    Eigen::MatrixXd H = Eigen::MatrixXd::Zero(size, size);
    Eigen::VectorXd b = Eigen::VectorXd::Zero(size);
    inertial_->linearise(free_poses(w_.poses), H, b);
    Eigen::VectorXd damping = Eigen::VectorXd::Zero(size);
    for (Eigen::Index k = 0; k < size; ++k) {
      // assemble() damps the cameras by the curvature of the images' residuals.
      if (k >= of_cameras) damping(k) = damping_of(H(k, k));
      H(k, k) += damping(k);
    }
    const Eigen::VectorXd gradient = b;
    const std::size_t n = w_.bundle.n_free();
    const double* block = w_.sums[0].blocks.data();
    for (std::size_t j = 0; j < n; ++j) {
      for (std::size_t i = j; i < n; ++i, block += kBlockSize) {
        const Eigen::Map<const Matrix6d> values(block);
        auto target =
            H.block<6, 6>(static_cast<Eigen::Index>(6 * i), static_cast<Eigen::Index>(6 * j));
        if (i == j) {
          target.triangularView<Eigen::Lower>() += values;
        } else {
          target += values;
        }
      }
    }
    b.head(of_cameras) += Eigen::Map<const Eigen::VectorXd>(w_.solution.data(), of_cameras);
    const Eigen::LLT<Eigen::MatrixXd, Eigen::Lower> factor(H);
    constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
    if (factor.info() != Eigen::Success) return kNone;
    const Eigen::VectorXd step = factor.solve(b);
    if (!step.allFinite()) return kNone;
    std::copy_n(step.data(), of_cameras, w_.solution.data());
    inertial_->move(step);
    return step.dot(damping.cwiseProduct(step) + gradient);
  }

  /// Moves free cameras by the solution. Returns their part of the predicted decrease.
  double move_cameras() {
    double predicted = 0;
    for (std::size_t i = 0; i < w_.bundle.n_free(); ++i) {
      const Eigen::Map<const Vector6d> step(&w_.solution[6 * i]);
      const double* camera = &w_.sums[0].cameras[i * kCameraSize];
      for (int k = 0; k < 6; ++k) {
        w_.steps[i * kStepSize + static_cast<std::size_t>(k < 3 ? k : k + 1)] = step(k);
        predicted += step(k) * (damping_of(camera[k * (k + 3) / 2]) * step(k) + camera[21 + k]);
      }
      w_.moved_poses[i] = Pose::exp(step) * w_.poses[i];
      write_view(w_.moved_poses[i], &w_.moved_views[i * kViewSize]);
    }
    return predicted;
  }

  /// Linearises, solves and evaluates. Returns the gain: the decrease over the predicted one, 0 for
  /// a step that cannot be taken.
  double try_step() {
    for_each_task([&](std::size_t number) {
      clear(w_.sums[number].blocks);
      clear(w_.sums[number].cameras);
      clear(w_.sums[number].reduced);
      kernels_.eliminate(task(number, w_.views, w_.points));
    });
    assemble();
    predicted_ = -1;
    const auto n = static_cast<bundle_kernels::Index>(w_.bundle.n_free());
    double* blocks = w_.sums[0].blocks.data();
    double of_imu = 0;
    if (inertial_) {
      of_imu = solve_with_imu();
      if (std::isnan(of_imu)) return 0;
    } else {
      if (!kernels_.factorise(blocks, n, w_.factor_scratch.data())) return 0;
      kernels_.solve(blocks, n, w_.solution.data());
    }
    predicted_ = move_cameras() + of_imu;
    std::array<double, BlockBundle::kTasks> parts{};
    for_each_task([&](std::size_t number) {
      parts[number] = kernels_.back_substitute(task(number, w_.views, w_.points));
    });
    predicted_ += parts[0] + parts[1];
    moved_cost_ = cost_at(w_.moved_views, w_.moved_points);
    if (inertial_) moved_cost_ += inertial_->cost(free_poses(w_.moved_poses), true);
    const double gain = (cost_ - moved_cost_) / predicted_;
    return predicted_ > 0 && std::isfinite(gain) ? gain : 0;
  }

  void accept() {
    std::swap(w_.poses, w_.moved_poses);
    std::swap(w_.views, w_.moved_views);
    std::swap(w_.points, w_.moved_points);
    if (inertial_) inertial_->accept();
    cost_ = moved_cost_;
  }

  void write_estimate() {
    if (inertial_) inertial_->write(problem_);
    for (std::size_t i = 0; i < w_.bundle.n_free(); ++i) {
      problem_.cameras[w_.bundle.free_cameras()[i]].T_cw = w_.poses[i];
    }
    for (std::size_t i = 0; i < problem_.points.size(); ++i) {
      if (!w_.bundle.has_point(i)) continue;
      problem_.points[i] = Eigen::Map<const Eigen::Vector3d>(&w_.points[i * kPointSize]);
    }
  }

  BundleProblem& problem_;
  bool robust_;
  const Kernels& kernels_;
  Workspace& w_;
  bool scaled_ = false;
  double damping_ = 0, cost_ = 0, moved_cost_ = 0;
  double predicted_ = -1;  // of the last step; negative: none was found
  std::optional<TaskPair> pair_;
  std::optional<InertialSystem> inertial_;
};

}  // namespace

std::unique_ptr<BundleMinimiser> block_minimiser(BundleProblem& problem,
                                                 const BundleOptions& options,
                                                 const std::vector<std::uint8_t>& usable,
                                                 const bundle_kernels::Kernels& kernels) {
  return std::make_unique<BlockMinimiser>(problem, options, usable, kernels);
}

}  // namespace orbslam

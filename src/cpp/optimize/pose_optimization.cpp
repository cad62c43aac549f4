// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/pose_optimization.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "base/errors.hpp"
#include "optimize/gates.hpp"
#include "optimize/pose_kernels.hpp"

namespace orbslam {
namespace {

using pose_kernels::Group;
using pose_kernels::NormalEquations;

constexpr int kRounds = 4;
constexpr int kPlainRound = 3;  // the round without kernel
constexpr int kIterations = 10;
constexpr int kTrials = 10;
constexpr int kMinObservations = 3;
constexpr int kFewObservations = 10;  // below: one round only

/// Working memory of a call; one per thread, so that calls after the first do not allocate.
struct Workspace {
  Group mono, stereo;
  std::vector<double> used_mono, used_stereo;  ///< weights of the last round
  const PosePrior* prior = nullptr;

  void clear() {
    prior = nullptr;
    mono.clear();
    stereo.clear();
    used_mono.clear();
    used_stereo.clear();
  }
  /// Stores the weights for the next round; false if they equal those of the last round.
  bool note_weights() {
    const bool same = used_mono == mono.weight && used_stereo == stereo.weight;
    used_mono = mono.weight;
    used_stereo = stereo.weight;
    return !same;
  }
  /// Returns false and adds nothing for a number that is not finite, or for a pixel where the lens
  /// shows nothing.
  bool add(const Camera& camera, const Eigen::Vector3d& position, double u, double v,
           double right_u, double inverse_sigma2, bool has_depth, double right_factor,
           std::size_t slot) {
    if (!position.allFinite() || !std::isfinite(u + v + inverse_sigma2)) return false;
    if (has_depth && !std::isfinite(right_u)) return false;
    Group& group = has_depth ? stereo : mono;
    if (!camera.is_pinhole()) {
      const Sight sight = camera.sight(u, v);
      if (!sight.allFinite()) return false;
      group.push_back(sight);
    }
    group.push_back(position, u, v, has_depth ? right_u : 0.0, inverse_sigma2, right_factor, slot);
    return true;
  }
  int size() const { return static_cast<int>(mono.size() + stereo.size()); }
};

Workspace& workspace() {
  static thread_local Workspace instance;
  return instance;
}

/// The matrix ad(xi) of a tangent (rotation, translation): the product of two tangents.
Matrix6d product_matrix(const Vector6d& xi) {
  Matrix6d ad = Matrix6d::Zero();
  ad.topLeftCorner<3, 3>() = ad.bottomRightCorner<3, 3>() = skew(xi.head<3>());
  ad.bottomLeftCorner<3, 3>() = skew(xi.tail<3>());
  return ad;
}

/// Squared error of a pose by its prior.
double accumulate_prior(const PosePrior& prior, const Pose& T_cw, NormalEquations* equations) {
  const Vector6d error = (T_cw * prior.mean.inverse()).log();
  const Vector6d weighted = prior.information * error;
  if (equations != nullptr) {
    // Of the logarithm by a left perturbation, to second order.
    const Matrix6d ad = product_matrix(error);
    const Matrix6d ad2 = ad * ad;
    const Matrix6d J = Matrix6d::Identity() - 0.5 * ad + ad2 / 12;
    const Matrix6d weighted_J = prior.information * J;
    equations->H += J.transpose() * weighted_J;
    equations->b -= J.transpose() * weighted;
  }
  return error.dot(weighted);
}

double evaluate(const Workspace& w, const Camera& camera, const Pose& T_cw, bool robust,
                NormalEquations* equations) {
  if (equations != nullptr) *equations = NormalEquations();
  const double of_prior = w.prior != nullptr ? accumulate_prior(*w.prior, T_cw, equations) : 0.0;
  return of_prior + accumulate_mono(w.mono, camera, T_cw, robust ? kHuberMono : 0.0, equations) +
         accumulate_stereo(w.stereo, camera, T_cw, robust ? kHuberStereo : 0.0, equations);
}

/// One iteration's trials: looks for a damping with which the cost falls. On success `T_cw`, `cost`
/// and `equations` are those of the new pose.
class DampedStep {
 public:
  DampedStep(const Workspace& w, const Camera& camera, bool robust)
      : workspace_(w), camera_(camera), robust_(robust) {}

  void start(const NormalEquations& equations) {
    lambda_ = kFirstDamping * equations.H.diagonal().maxCoeff();
    growth_ = 2;
  }

  bool advance(Pose& T_cw, double& cost, NormalEquations& equations) {
    for (int trial = 0; trial < kTrials; ++trial) {
      Matrix6d damped = equations.H;
      damped.diagonal().array() += lambda_;
      const Eigen::LLT<Matrix6d> factor(damped);
      double gain = -1;
      if (factor.info() == Eigen::Success) {
        const Vector6d step = factor.solve(equations.b);
        const Pose candidate = Pose::exp(step) * T_cw;
        // Nearly all first trials succeed. The next normal equations are then needed at this pose.
        const bool optimistic = trial == 0;
        const double candidate_cost =
            evaluate(workspace_, camera_, candidate, robust_, optimistic ? &next_ : nullptr);
        const double predicted = step.dot(lambda_ * step + equations.b) + kGainOffset;
        gain = std::isfinite(candidate_cost) ? (cost - candidate_cost) / predicted : -1;
        if (gain > 0) {
          T_cw = candidate;
          cost = candidate_cost;
          if (!optimistic) evaluate(workspace_, camera_, candidate, robust_, &next_);
          equations = next_;
          const double cubed = std::pow(2 * gain - 1, 3);
          lambda_ *= std::max(kLeastDampingFactor, std::min(kMostDampingFactor, 1 - cubed));
          growth_ = 2;
          return true;
        }
      }
      if (gain == 0) return false;
      lambda_ *= growth_;
      growth_ *= 2;
      if (!std::isfinite(lambda_)) return false;
    }
    return false;
  }

 private:
  const Workspace& workspace_;
  const Camera& camera_;
  bool robust_;
  double lambda_ = 0, growth_ = 2;
  NormalEquations next_;
};

/// Levenberg-Marquardt with the observations in use. Returns the number of iterations.
int minimise(const Workspace& w, const Camera& camera, bool robust, Pose& T_cw) {
  NormalEquations equations;
  double cost = evaluate(w, camera, T_cw, robust, &equations);
  if (!std::isfinite(cost)) return 0;
  DampedStep step(w, camera, robust);
  step.start(equations);
  int small_decreases = 0;
  for (int iteration = 1; iteration <= kIterations; ++iteration) {
    const double before = cost;
    if (!step.advance(T_cw, cost, equations)) return iteration;
    small_decreases = before - cost < kSmallDecrease * before ? small_decreases + 1 : 0;
    if (small_decreases >= kSmallDecreases) return iteration;
  }
  return kIterations;
}

/// Judges all observations of a group at a pose: inliers get their weight, outliers weight 0.
int classify(Group& group, bool stereo, const Camera& camera, const Pose& T_cw,
             std::uint8_t* outlier) {
  const Eigen::Matrix3d R = T_cw.rotation_matrix();
  const double gate = stereo ? kGateStereo : kGateMono;
  int n_inliers = 0;
  for (std::size_t i = 0; i < group.size(); ++i) {
    const bool inlier = chi2(group, i, stereo, camera, R, T_cw.translation()) <= gate;
    group.weight[i] = inlier ? group.inverse_sigma2[i] : 0.0;
    outlier[group.slot[i]] = inlier ? 0 : 1;
    n_inliers += inlier ? 1 : 0;
  }
  return n_inliers;
}

/// Leaves out points behind the camera at the start of a round: their mirror images would bias the
/// pose, and no small step moves them to the front.
void leave_out_hidden(Group& group, const Camera& camera, const Pose& T_cw) {
  const Eigen::Matrix3d R = T_cw.rotation_matrix();
  for (std::size_t i = 0; i < group.size(); ++i) {
    const Eigen::Vector3d point(group.x[i], group.y[i], group.z[i]);
    Eigen::RowVector3d axis(0, 0, 1);
    if (!camera.is_flat()) axis << group.sight[6][i], group.sight[7][i], group.sight[8][i];
    const double offset = camera.is_flat() ? 0.0 : group.sight[11][i];
    const double depth = (axis * R).dot(point) + axis.dot(T_cw.translation()) + offset;
    if (!(depth > pose_kernels::kTinyDepth)) group.weight[i] = 0;
  }
}

/// Zero when the matrix is not positive definite.
Matrix6d inverse_of(const Matrix6d& H) {
  const Eigen::LLT<Matrix6d> factor(H);
  if (factor.info() != Eigen::Success) return Matrix6d::Zero();
  const Matrix6d inverse = factor.solve(Matrix6d::Identity());
  if (!inverse.allFinite()) return Matrix6d::Zero();
  return 0.5 * (inverse + inverse.transpose());
}

/// Inverse of the normal matrix of the observations in use, for residuals with a variance of 1;
/// zero when undetermined. `cost` becomes their sum of squares.
Matrix6d unit_covariance(const Workspace& w, const Camera& camera, const Pose& T_cw, double& cost) {
  NormalEquations equations;
  cost = evaluate(w, camera, T_cw, false, &equations);
  return inverse_of(equations.H);
}

int count_residuals(const Workspace& w) {
  int n_residuals = 0;
  for (const double weight : w.mono.weight) n_residuals += weight > 0 ? 2 : 0;
  for (const double weight : w.stereo.weight) n_residuals += weight > 0 ? 3 : 0;
  return n_residuals;
}

/// Covariance of observations and prior together. The variance of the residuals is used if it is
/// above 1, so that the prior does not hide large residuals of an image.
Matrix6d covariance_with_prior(const Workspace& w, const Camera& camera, const Pose& T_cw) {
  NormalEquations images;
  const double cost = accumulate_mono(w.mono, camera, T_cw, 0.0, &images) +
                      accumulate_stereo(w.stereo, camera, T_cw, 0.0, &images);
  const int n_residuals = count_residuals(w);
  const double variance = n_residuals > 6 ? std::max(1.0, cost / (n_residuals - 6)) : 1.0;
  return inverse_of(images.H / variance + w.prior->information);
}

/// The same times the variance that the inliers' residuals have.
Matrix6d covariance(const Workspace& w, const Camera& camera, const Pose& T_cw) {
  if (w.prior != nullptr) return covariance_with_prior(w, camera, T_cw);
  const int n_residuals = count_residuals(w);
  if (n_residuals <= 6) return Matrix6d::Zero();
  double cost = 0;
  const Matrix6d unit = unit_covariance(w, camera, T_cw, cost);
  return unit * (cost / (n_residuals - 6));
}

/// The rounds over a filled workspace. `outlier` has one flag per slot, preset by the caller;
/// only those of the workspace's slots are judged.
void run_rounds(Workspace& w, const Camera& camera, const Pose& T_cw_initial,
                PoseEstimate& estimate, std::uint8_t* outlier) {
  estimate.T_cw = T_cw_initial;
  const int n_observations = w.size();
  if (n_observations < kMinObservations) {
    if (w.prior == nullptr) return;
    estimate.T_cw = w.prior->mean;
    estimate.covariance = inverse_of(w.prior->information);
    return;
  }
  w.mono.pad();
  w.stereo.pad();
  for (int round = 0; round < kRounds; ++round) {
    Pose T_cw = T_cw_initial;
    leave_out_hidden(w.mono, camera, T_cw);
    leave_out_hidden(w.stereo, camera, T_cw);
    // The same problem from the same pose has the same result.
    if (!w.note_weights() && round != kPlainRound) continue;
    estimate.iterations += minimise(w, camera, round != kPlainRound, T_cw);
    estimate.T_cw = T_cw;
    estimate.n_inliers = classify(w.mono, false, camera, T_cw, outlier) +
                         classify(w.stereo, true, camera, T_cw, outlier);
    const bool few = n_observations < kFewObservations || estimate.n_inliers < kMinObservations;
    if (few && w.prior == nullptr) break;
  }
  estimate.covariance = covariance(w, camera, estimate.T_cw);
}

/// Adds the association of keypoint i. Returns false and adds nothing for numbers that are not
/// finite.
bool add_association(Workspace& w, const TrackedFrame& frame, std::size_t i) {
  const Frame& f = *frame.frame;
  if (const AlignedPixel* a = frame.aligned_at(i)) {
    return w.add(*f.camera, frame.positions[i], a->u, a->v, a->right_u, a->inverse_sigma2,
                 f.has_depth(i), a->right_factor, i);
  }
  const Keypoint& keypoint = f.keypoints[i];
  return w.add(*f.camera, frame.positions[i], keypoint.x, keypoint.y, f.right_u[i],
               f.scales->inverse_sigma2(keypoint.level), f.has_depth(i), 1.0, i);
}

/// Makes an aligned sighting beyond its narrow gate an inlier if its keypoint is one. Returns how
/// many outliers become inliers.
int acquit_aligned(TrackedFrame& frame) {
  if (frame.aligned.empty()) return 0;
  const Frame& f = *frame.frame;
  int n = 0;
  for (std::size_t i = 0; i < f.size(); ++i) {
    if (frame.outlier[i] == 0 || frame.aligned_at(i) == nullptr) continue;
    const Keypoint& k = f.keypoints[i];
    const Eigen::Vector3d p = *frame.T_cw * frame.positions[i];
    Eigen::Vector2d error;
    if (!f.camera->error(p, k.x, k.y, error)) continue;
    if (f.camera->is_flat() && !(p.z() > pose_kernels::kTinyDepth)) continue;
    double squared = error.squaredNorm();
    if (f.has_depth(i)) {
      const double right = f.camera->right_error(p, error, k.x, k.y, f.right_u[i]);
      squared += right * right;
    }
    const double gate = f.has_depth(i) ? kGateStereo : kGateMono;
    if (!(squared * static_cast<double>(f.scales->inverse_sigma2(k.level)) <= gate)) continue;
    frame.outlier[i] = 0;
    ++n;
  }
  return n;
}

}  // namespace

PoseEstimate optimize_pose(const Pose& T_cw_initial, const Camera& camera,
                           const std::vector<PoseObservation>& observations,
                           const PosePrior* prior) {
  Workspace& w = workspace();
  w.clear();
  w.prior = prior;
  PoseEstimate estimate;
  estimate.outlier.resize(observations.size());
  for (std::size_t i = 0; i < observations.size(); ++i) {
    const PoseObservation& o = observations[i];
    const bool usable = w.add(camera, o.position, o.u, o.v, o.right_u, o.inverse_sigma2,
                              o.has_depth, o.right_factor, i);
    estimate.outlier[i] = usable ? 0 : 1;
  }
  run_rounds(w, camera, T_cw_initial, estimate, estimate.outlier.data());
  return estimate;
}

PoseEstimate optimize_pose(TrackedFrame& frame, const PosePrior* prior) {
  if (!frame.T_cw) {
    throw StateError("optimize_pose: the frame has no pose to start from; set T_cw first");
  }
  const Frame& f = *frame.frame;
  Workspace& w = workspace();
  w.clear();
  w.prior = prior;
  for (std::size_t i = 0; i < f.size(); ++i) {
    frame.outlier[i] = 0;
    if (!frame.map_points[i].valid()) continue;
    frame.outlier[i] = add_association(w, frame, i) ? 0 : 1;
  }
  PoseEstimate estimate;
  run_rounds(w, *f.camera, *frame.T_cw, estimate, frame.outlier.data());
  frame.T_cw = estimate.T_cw;
  estimate.n_inliers += acquit_aligned(frame);
  return estimate;
}

Matrix6d pose_covariance(const TrackedFrame& frame) {
  if (!frame.T_cw) {
    throw StateError("pose_covariance: the frame has no pose; set T_cw first");
  }
  const Frame& f = *frame.frame;
  Workspace& w = workspace();
  w.clear();
  for (std::size_t i = 0; i < f.size(); ++i) {
    if (frame.map_points[i].valid() && frame.outlier[i] == 0) add_association(w, frame, i);
  }
  if (w.size() < kMinObservations) return Matrix6d::Zero();
  w.mono.pad();
  w.stereo.pad();
  double cost = 0;
  return unit_covariance(w, *f.camera, *frame.T_cw, cost);
}

}  // namespace orbslam

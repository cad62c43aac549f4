// SPDX-License-Identifier: BSD-3-Clause
#include "inertial/inertial_start.hpp"

#include <Eigen/Dense>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "inertial/imu_residual.hpp"
#include "inertial/small_product.hpp"
#include "inertial/so3.hpp"

namespace orbslam {
namespace {

using Index = Eigen::Index;
using Matrix32d = Eigen::Matrix<double, 3, 2>;

constexpr std::size_t kMinViews = 4;
constexpr int kGyroIterations = 3;
constexpr int kIterations = 10;
constexpr double kConverged = 1e-6;  // relative decrease of the cost that ends
// Deviations [m/s, m] that weigh the two kinds of equations of the linear problem.
constexpr double kSpeed = 0.05, kPlace = 0.02;

// Unknowns of a view (rotation, velocity, position), then those of all.
constexpr Index kView = 9;
enum Common { kGyroAt = 0, kAccelAt = 3, kTiltAt = 6, kScaleAt = 8, kCommon = 9 };

/// The smallest rotation after which gravity points along -z.
Eigen::Quaterniond turn_up(const Eigen::Vector3d& gravity) {
  return Eigen::Quaterniond::FromTwoVectors(gravity, Eigen::Vector3d(0, 0, -1)).normalized();
}

class Problem {
 public:
  Problem(const std::vector<InertialView>& views,
          const std::vector<std::vector<ImuSample>>& samples, const Pose& T_cb,
          const ImuNoise& noise, const InertialStartOptions& options)
      : T_bc_(T_cb.inverse()), options_(options), bias_(options.bias) {
    for (const InertialView& view : views) {
      measured_.push_back(view.T_wc.rotation() * T_cb.rotation());
      rotations_.push_back(measured_.back());
      centres_.push_back(view.T_wc.translation() - views.front().T_wc.translation());
    }
    moves_.assign(views.size(), Eigen::Vector3d::Zero());
    velocities_.assign(views.size(), Eigen::Vector3d::Zero());
    for (const auto& between : samples) motions_.emplace_back(between, noise, bias_);
  }

  /// Bias of the gyro from the rotations alone.
  void estimate_gyro_bias() {
    for (int iteration = 0; iteration < kGyroIterations; ++iteration) {
      const double weight = 1 / (options_.gyro_deviation * options_.gyro_deviation);
      Eigen::Matrix3d H = weight * Eigen::Matrix3d::Identity();
      Eigen::Vector3d b = weight * (options_.bias.gyro - bias_.gyro);
      const double rotation = options_.rotation_deviation;
      for (std::size_t i = 0; i < motions_.size(); ++i) {
        const Eigen::Quaterniond off =
            motions_[i].motion().dR.conjugate() * rotations_[i].conjugate() * rotations_[i + 1];
        const Eigen::Matrix3d J = motions_[i].by_bias().topLeftCorner<3, 3>();
        H += J.transpose() * J / (2 * rotation * rotation);
        b += J.transpose() * so3_log(off.normalized()) / (2 * rotation * rotation);
      }
      bias_.gyro += H.ldlt().solve(b);
      integrate_again();
    }
  }

  /// Velocities, scale and gravity of any length: all linear. False if they are not determined.
  bool solve_linear() {
    const auto n = static_cast<Index>(rotations_.size());
    const Index scale = 3 * n, gravity = options_.metric ? scale : scale + 1;
    const Index size = gravity + 3;
    Eigen::MatrixXd A = Eigen::MatrixXd::Zero(6 * (n - 1), size);
    Eigen::VectorXd b(6 * (n - 1));
    const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
    for (Index i = 0; i + 1 < n; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const Preintegration& motion = motions_[k];
      const double dt = motion.duration();
      const Eigen::Matrix3d R = rotations_[k].toRotationMatrix();
      const Eigen::Vector3d dv = R * motion.motion().dv, dp = R * motion.motion().dp;
      A.block<3, 3>(6 * i, 3 * i) = -I / kSpeed;
      A.block<3, 3>(6 * i, 3 * (i + 1)) = I / kSpeed;
      A.block<3, 3>(6 * i, gravity) = -dt * I / kSpeed;
      b.segment<3>(6 * i) = dv / kSpeed;
      const Eigen::Vector3d step = centres_[k + 1] - centres_[k];
      A.block<3, 3>(6 * i + 3, 3 * i) = -dt * I / kPlace;
      A.block<3, 3>(6 * i + 3, gravity) = -0.5 * dt * dt * I / kPlace;
      Eigen::Vector3d known = dp - (rotations_[k + 1] * lever() - rotations_[k] * lever());
      if (options_.metric) {
        known -= step;
      } else {
        A.block<3, 1>(6 * i + 3, scale) = step / kPlace;
      }
      b.segment<3>(6 * i + 3) = known / kPlace;
    }
    const Eigen::MatrixXd H = A.transpose() * A;
    const Eigen::LDLT<Eigen::MatrixXd> factor(H);
    const Eigen::VectorXd x = factor.solve(A.transpose() * b);
    if (!x.allFinite()) return false;
    if (!options_.metric) {
      if (!(x(scale) > 0)) return false;
      scale_ = x(scale);
    }
    for (Index i = 0; i < n; ++i) velocities_[static_cast<std::size_t>(i)] = x.segment<3>(3 * i);
    gravity_ = x.segment<3>(gravity);
    linear_length_ = gravity_.norm();
    if (!(linear_length_ > 0.1 * kGravity)) return false;
    gravity_ *= kGravity / linear_length_;
    return true;
  }

  /// The start from what is known of the map, instead of solve_linear().
  void take_known() {
    gravity_ = Eigen::Vector3d(0, 0, -kGravity);
    linear_length_ = kGravity;
    const std::size_t n = centres_.size();
    for (std::size_t i = 0; i < n; ++i) {
      const std::size_t from = i == 0 ? 0 : i - 1, to = std::min(i + 1, n - 1);
      double dt = 0;
      for (std::size_t k = from; k < to; ++k) dt += motions_[k].duration();
      velocities_[i] = (state(to).T_wb.translation() - state(from).T_wb.translation()) / dt;
    }
  }

  bool refine() {
    double cost = linearise();
    for (int iteration = 0; iteration < kIterations && std::isfinite(cost); ++iteration) {
      const Eigen::LDLT<Eigen::MatrixXd> factor(H_);
      const Eigen::VectorXd step = factor.solve(b_);
      if (!step.allFinite()) return false;
      move(step);
      const double before = cost;
      cost = linearise();
      if (std::abs(before - cost) <= kConverged * before) break;
    }
    cost_ = cost;
    return std::isfinite(cost);
  }

  InertialStart result() const {
    InertialStart start;
    const Index n = static_cast<Index>(rotations_.size()), common = kView * n;
    const Eigen::LDLT<Eigen::MatrixXd> factor(H_);
    // Columns of the inverse that belong to the last view and to all.
    constexpr Index kKept = kView + kCommon;
    Eigen::MatrixXd kept = Eigen::MatrixXd::Zero(H_.rows(), kKept);
    kept.bottomRows<kKept>().setIdentity();
    Eigen::Matrix<double, kKept, kKept> P = factor.solve(kept).bottomRows<kKept>();
    P = (0.5 * (P + P.transpose())).eval();
    start.solved = P.allFinite() && P.diagonal().minCoeff() > 0;
    start.gravity = gravity_;
    start.gravity_length = linear_length_;
    start.scale = scale_;
    start.bias = bias_;
    start.velocities = velocities_;
    start.cost = cost_;
    start.freedom =
        static_cast<int>(9 * (n - 1) + 6 * n + 6 - (common + kCommon) + (options_.metric ? 1 : 0));
    if (options_.known_gravity > 0) start.freedom += 2;
    if (!options_.metric && options_.known_scale > 0) start.freedom += 1;
    start.up = turn_up(gravity_);
    start.scale_deviation =
        options_.metric ? 0 : std::sqrt(std::max(0.0, P(kView + kScaleAt, kView + kScaleAt)));
    const Eigen::Matrix2d tilt = P.block<2, 2>(kView + kTiltAt, kView + kTiltAt);
    const double mean = 0.5 * tilt.trace(), difference = 0.5 * (tilt(0, 0) - tilt(1, 1));
    start.gravity_deviation = std::sqrt(mean + std::hypot(difference, tilt(0, 1)));
    // From (rotation, velocity, position, gyro, accelerometer, tilt, scale) here to the filter's,
    // whose world is turned up, and whose scale is units of the map per metre.
    const Eigen::Matrix3d R = start.up.toRotationMatrix();
    InertialFilter::Covariance A = InertialFilter::Covariance::Identity();
    A.block<3, 3>(3, 3) = R;
    A.block<3, 1>(3, 17) = -R * velocities_.back();
    A.block<3, 3>(6, 6) = R;
    A(17, 17) = options_.metric ? 0 : -1;
    start.covariance = transported(A, P);
    return start;
  }

 private:
  Eigen::Vector3d lever() const { return T_bc_.translation() * -1.0; }

  ImuState state(std::size_t i) const {
    // The camera is where it was seen; the IMU is at a lever from it.
    const Eigen::Vector3d p = scale_ * (centres_[i] + moves_[i]) + rotations_[i] * lever();
    return {Pose(rotations_[i], p), velocities_[i]};
  }

  void integrate_again() {
    for (Preintegration& motion : motions_) motion = motion.reintegrated(bias_);
  }

  /// The normal equations at the present estimate; returns the cost.
  double linearise() {
    const auto n = static_cast<Index>(rotations_.size());
    const Index common = kView * n;
    H_ = Eigen::MatrixXd::Zero(common + kCommon, common + kCommon);
    b_ = Eigen::VectorXd::Zero(common + kCommon);
    double cost = 0;
    integrate_again();
    const Eigen::Matrix3d to_world = turn_up(gravity_).toRotationMatrix().transpose();
    const Matrix32d by_tilt = -skew(gravity_) * to_world.leftCols<2>();
    for (Index i = 0; i + 1 < n; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const ImuResidual r = imu_residual(motions_[k], state(k), bias_, state(k + 1), gravity_);
      Eigen::Matrix<double, 9, 2 * kView + kCommon> J;
      J << by_view(r.by_first, k), by_view(r.by_second, k + 1), r.by_bias, r.by_gravity * by_tilt,
          by_scale(r, k);
      const Eigen::LDLT<Eigen::MatrixXd> factor(motions_[k].covariance());
      const Matrix9d information = factor.solve(Eigen::MatrixXd::Identity(9, 9));
      const Eigen::Matrix<double, 2 * kView + kCommon, 9> transposed = J.transpose();
      const Vector9d We = information * r.error;
      cost += r.error.dot(We);
      add(i * kView, common, product(transposed, product(information, J)), transposed * We);
    }
    for (Index i = 0; i < n; ++i) cost += add_view_prior(i);
    cost +=
        add_bias_prior(common + kGyroAt, bias_.gyro - options_.bias.gyro, options_.gyro_deviation);
    cost += add_bias_prior(common + kAccelAt, bias_.accel - options_.bias.accel,
                           options_.accel_deviation);
    if (options_.metric) H_(common + kScaleAt, common + kScaleAt) += 1;
    return cost + add_map_prior(common, to_world);
  }

  /// From derivatives by (rotation, velocity, position) of the IMU to those of a view, whose
  /// position is that of the camera, in metres.
  Matrix9d by_view(const Matrix9d& by_state, std::size_t i) const {
    Matrix9d J = by_state;
    J.leftCols<3>() -= by_state.rightCols<3>() * rotations_[i].toRotationMatrix() * skew(lever());
    return J;
  }

  Vector9d by_scale(const ImuResidual& r, std::size_t i) const {
    if (options_.metric) return Vector9d::Zero();
    return r.by_first.rightCols<3>() * (scale_ * (centres_[i] + moves_[i])) +
           r.by_second.rightCols<3>() * (scale_ * (centres_[i + 1] + moves_[i + 1]));
  }

  void add(Index view, Index common, const Eigen::Matrix<double, 27, 27>& H,
           const Eigen::Matrix<double, 27, 1>& b) {
    constexpr Index kTwo = 2 * kView;
    H_.block<kTwo, kTwo>(view, view) += H.topLeftCorner<kTwo, kTwo>();
    H_.block<kTwo, kCommon>(view, common) += H.topRightCorner<kTwo, kCommon>();
    H_.block<kCommon, kTwo>(common, view) += H.bottomLeftCorner<kCommon, kTwo>();
    H_.block<kCommon, kCommon>(common, common) += H.bottomRightCorner<kCommon, kCommon>();
    b_.segment<kTwo>(view) -= b.head<kTwo>();
    b_.segment<kCommon>(common) -= b.tail<kCommon>();
  }

  double add_view_prior(Index i) {
    const auto k = static_cast<std::size_t>(i);
    const double turn = 1 / (options_.rotation_deviation * options_.rotation_deviation);
    const double metres = scale_ * options_.position_deviation;
    const double place = 1 / (metres * metres);
    const Eigen::Vector3d turned = so3_log((measured_[k].conjugate() * rotations_[k]).normalized());
    const Eigen::Vector3d moved = scale_ * moves_[k];
    for (Index a = 0; a < 3; ++a) {
      H_(kView * i + a, kView * i + a) += turn;
      H_(kView * i + 6 + a, kView * i + 6 + a) += place;
    }
    b_.segment<3>(kView * i) -= turn * turned;
    b_.segment<3>(kView * i + 6) -= place * moved;
    return turn * turned.squaredNorm() + place * moved.squaredNorm();
  }

  /// Of gravity and scale in a map that they are known of.
  double add_map_prior(Index common, const Eigen::Matrix3d& to_world) {
    double cost = 0;
    const auto add = [&](Index at, double off, double deviation) {
      const double weight = 1 / (deviation * deviation);
      H_(at, at) += weight;
      b_(at) -= weight * off;
      cost += weight * off * off;
    };
    if (options_.known_gravity > 0) {
      const Eigen::Vector3d turn = Eigen::Vector3d(0, 0, -1).cross(gravity_ / kGravity);
      const Eigen::Vector2d off = to_world.leftCols<2>().transpose() * turn;
      for (Index a = 0; a < 2; ++a) add(common + kTiltAt + a, off(a), options_.known_gravity);
    }
    if (!options_.metric && options_.known_scale > 0) {
      add(common + kScaleAt, std::log(scale_), options_.known_scale);
    }
    return cost;
  }

  double add_bias_prior(Index at, const Eigen::Vector3d& off, double deviation) {
    const double weight = 1 / (deviation * deviation);
    for (Index a = 0; a < 3; ++a) H_(at + a, at + a) += weight;
    b_.segment<3>(at) -= weight * off;
    return weight * off.squaredNorm();
  }

  void move(const Eigen::VectorXd& step) {
    const Index n = static_cast<Index>(rotations_.size()), common = kView * n;
    for (Index i = 0; i < n; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const Eigen::Vector3d turn = step.segment<3>(kView * i);
      rotations_[k] = (rotations_[k] * so3_exp(turn)).normalized();
      velocities_[k] += step.segment<3>(kView * i + 3);
      moves_[k] += step.segment<3>(kView * i + 6) / scale_;
    }
    bias_.gyro += step.segment<3>(common + kGyroAt);
    bias_.accel += step.segment<3>(common + kAccelAt);
    const Eigen::Matrix3d to_world = turn_up(gravity_).toRotationMatrix().transpose();
    const Eigen::Vector3d tilt = to_world.leftCols<2>() * step.segment<2>(common + kTiltAt);
    gravity_ = so3_exp(tilt) * gravity_;
    if (!options_.metric) scale_ *= std::exp(std::clamp(step(common + kScaleAt), -1.0, 1.0));
  }

  Pose T_bc_;
  InertialStartOptions options_;
  std::vector<Eigen::Quaterniond> measured_, rotations_;  // of the IMU
  std::vector<Eigen::Vector3d> centres_, moves_;          // of the camera, units of the map
  std::vector<Eigen::Vector3d> velocities_;
  std::vector<Preintegration> motions_;
  ImuBias bias_;
  Eigen::Vector3d gravity_ = Eigen::Vector3d::Zero();
  double linear_length_ = 0, scale_ = 1, cost_ = 0;
  Eigen::MatrixXd H_;
  Eigen::VectorXd b_;
};

}  // namespace

InertialStart estimate_inertial_start(const std::vector<InertialView>& views,
                                      const std::vector<std::vector<ImuSample>>& samples,
                                      const Pose& T_cb, const ImuNoise& noise,
                                      const InertialStartOptions& options) {
  if (views.size() < kMinViews || samples.size() + 1 != views.size()) {
    throw std::invalid_argument(
        "an inertial start needs four views or more and the samples "
        "between all of them");
  }
  Problem problem(views, samples, T_cb, noise, options);
  problem.estimate_gyro_bias();
  if (options.known_gravity > 0) {
    problem.take_known();
  } else if (!problem.solve_linear()) {
    return {};
  }
  if (!problem.refine()) return {};
  return problem.result();
}

}  // namespace orbslam

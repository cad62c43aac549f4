// SPDX-License-Identifier: BSD-3-Clause
#include "frame/velocity.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/covariance.hpp"
#include "base/errors.hpp"
#include "frame/inlier_spread.hpp"

namespace orbslam {
namespace {

// Seconds over which a velocity is taken to be constant.
constexpr double kLongest = 1.0;
// Relative difference of two intervals that is rounding of the time stamps.
constexpr double kSameInterval = 1e-6;

const Pose& require_pose(const TrackedFrame& frame, const char* verb) {
  if (frame.T_cw) return *frame.T_cw;
  throw StateError(std::string(verb) + ": frame " + std::to_string(frame.frame->id) +
                   " has no pose; track it first");
}

Pose predicted(const TrackedFrame& frame, const TrackedFrame& last, const Velocity& velocity) {
  return velocity.over(frame.frame->timestamp - last.frame->timestamp) * *last.T_cw;
}

}  // namespace

Pose Velocity::over(double interval) const {
  if (std::abs(interval - seconds) <= kSameInterval * std::abs(seconds)) return step;
  const double length = std::copysign(std::min(std::abs(interval), kLongest), interval);
  return Pose::exp(length / seconds * step.log());
}

Velocity Velocity::scaled(double factor) const {
  if (factor == 1) return *this;
  return {Pose(step.rotation(), factor * step.translation()), seconds};
}

std::optional<Pose> motion_between(const TrackedFrame& last, const TrackedFrame& frame) {
  if (!last.T_cw || !frame.T_cw) return std::nullopt;
  return *frame.T_cw * last.T_cw->inverse();
}

std::optional<Velocity> velocity_between(const TrackedFrame& last, const TrackedFrame& frame,
                                         bool consecutive) {
  const bool follows =
      frame.frame->id == last.frame->id + 1 && frame.anchor.big_change == last.anchor.big_change;
  const auto T_cl = motion_between(last, frame);
  if (!T_cl || (consecutive && !follows)) return std::nullopt;
  return Velocity{*T_cl, frame.frame->timestamp - last.frame->timestamp};
}

void predict_pose(TrackedFrame& frame, const TrackedFrame& last, const Velocity* velocity) {
  const Pose& T_lw = require_pose(last, "predict_pose");
  frame.T_cw = velocity != nullptr ? predicted(frame, last, *velocity) : T_lw;
  frame.anchor = last.anchor;
}

std::optional<Vector6d> innovation(const TrackedFrame& frame, const TrackedFrame& last,
                                   const Velocity& velocity) {
  if (!last.T_cw || !frame.T_cw) return std::nullopt;
  return (predicted(frame, last, velocity) * frame.T_cw->inverse()).log();
}

PoseChange change_from_prediction(const TrackedFrame& frame, const TrackedFrame& last,
                                  const Velocity* velocity) {
  if (velocity == nullptr || !last.T_cw || !frame.T_cw) return {};
  const Pose expected = predicted(frame, last, *velocity);
  const double turn = (*frame.T_cw * expected.inverse()).log().head<3>().norm();
  return {turn, (frame.T_cw->center() - expected.center()).norm()};
}

Matrix6d stated_covariance(const Matrix6d& covariance, double factor, const TrackedFrame& frame,
                           const TrackedFrame& last, const HiddenErrors& hidden) {
  std::vector<Vector6d> errors;
  const auto T_cl = motion_between(last, frame);
  if (hidden.map_motion != nullptr && T_cl) {
    errors.push_back((*T_cl * *hidden.map_motion * T_cl->inverse()).log());
  }
  if (hidden.velocity != nullptr) {
    const auto error = innovation(frame, last, *hidden.velocity);
    if (error) errors.emplace_back(std::sqrt(hidden.wrong_share) * *error);
  }
  return widened_covariance(covariance, factor, errors);
}

int count_staying_after(const TrackedFrame& frame, const Velocity& velocity, double n_intervals) {
  const Pose& T_cw = require_pose(frame, "count_staying_after");
  return count_staying(frame, velocity.over(n_intervals * velocity.seconds) * T_cw);
}

}  // namespace orbslam

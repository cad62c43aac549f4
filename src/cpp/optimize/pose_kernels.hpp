// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <vector>

#include "base/pose.hpp"
#include "camera/camera.hpp"
#include "optimize/pose_sums.hpp"

namespace orbslam::pose_kernels {

using pose_sums::kTinyDepth;

/// Observations of one kind (all with, or all without a right column) as flat arrays. Padded to a
/// multiple of kLanes with weight 0, so that the loops have no remainder.
struct Group {
  static constexpr std::size_t kLanes = pose_sums::kLanes;

  std::vector<double> x, y, z;        ///< world
  std::vector<double> u, v, right_u;  ///< pixels; right_u only in the group with depth
  std::vector<double> inverse_sigma2;
  std::vector<double> right_factor;  ///< inverse variance of the right column over that
  std::vector<double> weight;        ///< inverse_sigma2 of those in use, 0 of the others
  /// By rows of three, then the last column; empty for a pinhole.
  std::array<std::vector<double>, 12> sight;
  std::vector<std::size_t> slot;  ///< position in the caller's list

  std::size_t size() const { return slot.size(); }
  void clear();
  void push_back(const Eigen::Vector3d& position, double u_px, double v_px, double right_u_px,
                 double inverse_variance, double right_factor_of_it, std::size_t caller_slot);
  /// Appends observations of weight 0 up to the next multiple of kLanes.
  void pad();
  /// The sight of the observation that was added last, of a camera that is no pinhole.
  void push_back(const Sight& B);
};

/// Normal equations H x = b of the weighted least squares problem in the left tangent of T_cw.
struct NormalEquations {
  Matrix6d H = Matrix6d::Zero();
  Vector6d b = Vector6d::Zero();
};

/// `huber` is the kernel's width on whitened residuals, or 0 for plain least squares. Both return
/// the (robustified) sum of squares and add the group's part to `equations` if given. Points on the
/// camera's plane take no part. Summation order is fixed. See
/// docs/method/adjustment.md#pose-of-a-frame.
double accumulate_mono(const Group& group, const Camera& camera, const Pose& T_cw, double huber,
                       NormalEquations* equations);
double accumulate_stereo(const Group& group, const Camera& camera, const Pose& T_cw, double huber,
                         NormalEquations* equations);

/// Squared whitened residual of observation i, infinite when the point is not in front of the
/// camera.
double chi2(const Group& group, std::size_t i, bool stereo, const Camera& camera,
            const Eigen::Matrix3d& R_cw, const Eigen::Vector3d& t_cw);

}  // namespace orbslam::pose_kernels

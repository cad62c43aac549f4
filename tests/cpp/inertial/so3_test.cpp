// SPDX-License-Identifier: BSD-3-Clause
#include "inertial/so3.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace orbslam {
namespace {

TEST(So3, ExpAndLogAreInverse) {
  for (const double angle : {0.0, 1e-9, 1e-5, 0.3, 3.0}) {
    const Eigen::Vector3d omega = angle * Eigen::Vector3d(2, -1, 2) / 3;
    EXPECT_LT((so3_log(so3_exp(omega)) - omega).norm(), 1e-12);
  }
}

TEST(So3, RightJacobianIsTheDerivative) {
  for (const double angle : {0.0, 1e-6, 5e-5, 2e-4, 0.7, 2.9}) {
    const Eigen::Vector3d omega = angle * Eigen::Vector3d(2, -1, 2) / 3;
    const Eigen::Matrix3d J = so3_right_jacobian(omega);
    for (int i = 0; i < 3; ++i) {
      const Eigen::Vector3d step = 1e-5 * Eigen::Vector3d::Unit(i);
      const Eigen::Quaterniond inverse = so3_exp(omega).conjugate();
      const Eigen::Vector3d change =
          so3_log(inverse * so3_exp(omega + step)) - so3_log(inverse * so3_exp(omega - step));
      EXPECT_LT((change / 2e-5 - J.col(i)).norm(), 1e-8) << angle;
    }
  }
}

TEST(So3, AdjointCarriesATangentThroughAPose) {
  const Pose T(so3_exp({0.3, -1.1, 0.4}), Eigen::Vector3d(1, -2, 0.5));
  Vector6d d;
  d << 0.2, 0.1, -0.3, 0.5, -0.4, 0.7;
  const Pose left = T * Pose::exp(d), right = Pose::exp(adjoint(T) * d) * T;
  EXPECT_LT((left.matrix() - right.matrix()).norm(), 1e-12);
}

}  // namespace
}  // namespace orbslam

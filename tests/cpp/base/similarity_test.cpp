// SPDX-License-Identifier: BSD-3-Clause
#include "base/similarity.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>

#include "support/random_numbers.hpp"

namespace orbslam {
namespace {

using testing::draw;

Vector7d random_tangent(std::mt19937_64& generator, double angle, double sigma) {
  Eigen::Vector3d axis;
  for (int i = 0; i < 3; ++i) axis[i] = draw(generator, 1.0);
  Vector7d delta;
  delta << angle * axis.normalized(), draw(generator, 5), draw(generator, 5), draw(generator, 5),
      sigma;
  return delta;
}

Similarity random_similarity(std::mt19937_64& generator) {
  return Similarity::exp(random_tangent(generator, draw(generator, 3.1), draw(generator, 2)));
}

/// exp of a matrix, by scaling and squaring of its power series.
template <class Matrix>
Matrix series_exp(Matrix generator) {
  generator /= 1024;
  Matrix sum = Matrix::Identity(), term = Matrix::Identity();
  for (int k = 1; k < 14; ++k) {
    term = (term * generator / k).eval();
    sum += term;
  }
  for (int i = 0; i < 10; ++i) sum = (sum * sum).eval();
  return sum;
}

Eigen::Matrix4d matrix_of_tangent(const Vector7d& delta) {
  Eigen::Matrix4d generator = Eigen::Matrix4d::Zero();
  generator.topLeftCorner<3, 3>() = skew(delta.head<3>()) + delta(6) * Eigen::Matrix3d::Identity();
  generator.topRightCorner<3, 1>() = delta.segment<3>(3);
  return generator;
}

constexpr double angles[] = {0,    1e-300, 1e-160, 1e-12, 1e-8, 1e-5, 1e-4, 1e-3,
                             4e-3, 0.01,   0.1,    1,     2,    3,    3.14};
constexpr double sigmas[] = {0,     1e-300, 1e-12, -1e-12, 1e-8, -1e-8, 1e-5, -1e-5, 1e-3,
                             -1e-3, 0.01,   0.1,   -0.1,   1,    -1,    2.5,  -2.5,  7};

// OD-113: also for small rotations with a change of scale.
TEST(Similarity, ExpAgreesWithThePowerSeriesOfTheMatrix) {
  std::mt19937_64 generator(1);
  for (const double angle : angles) {
    for (const double sigma : sigmas) {
      const Vector7d delta = random_tangent(generator, angle, sigma);
      EXPECT_TRUE(
          Similarity::exp(delta).matrix().isApprox(series_exp(matrix_of_tangent(delta)), 1e-11))
          << angle << " " << sigma;
    }
  }
}

TEST(Similarity, LogInvertsExp) {
  std::mt19937_64 generator(2);
  for (const double angle : angles) {
    for (const double sigma : sigmas) {
      const Vector7d delta = random_tangent(generator, angle, sigma);
      EXPECT_LT((Similarity::exp(delta).log() - delta).norm(), 1e-11) << angle << " " << sigma;
    }
  }
}

TEST(Similarity, ExpInvertsLog) {
  std::mt19937_64 generator(3);
  for (int repeat = 0; repeat < 200; ++repeat) {
    const Similarity S = random_similarity(generator);
    EXPECT_TRUE(Similarity::exp(S.log()).matrix().isApprox(S.matrix(), 1e-12));
    const Eigen::Quaterniond negated(-S.rotation().coeffs());
    EXPECT_TRUE(Similarity(S.scale(), negated, S.translation()).log().isApprox(S.log(), 1e-12));
  }
}

// OD-113: a small rotation with a small change of scale keeps its translation.
TEST(Similarity, LogKeepsSmallRotationsWithSmallScales) {
  // Here a translation of (1, 0.2, -0.1) must not come out as (-0.001, 0.024, 0.032).
  Eigen::Vector3d omega(0.3, -0.8, 0.5);
  omega *= 1e-3 / omega.norm();
  Vector6d turn;
  turn << omega, Eigen::Vector3d::Zero();
  const Similarity S(std::exp(1e-3), Pose::exp(turn).rotation(), Eigen::Vector3d(1, 0.2, -0.1));
  const Eigen::Vector3d upsilon = S.log().segment<3>(3);
  EXPECT_LT((upsilon - S.translation()).norm(), 2e-3);
}

TEST(Similarity, GroupAxioms) {
  std::mt19937_64 generator(4);
  for (int repeat = 0; repeat < 100; ++repeat) {
    const Similarity a = random_similarity(generator), b = random_similarity(generator),
                     c = random_similarity(generator);
    EXPECT_TRUE(((a * b) * c).matrix().isApprox((a * (b * c)).matrix(), 1e-12));
    EXPECT_TRUE((a * b).matrix().isApprox(a.matrix() * b.matrix(), 1e-12));
    EXPECT_TRUE((a * Similarity()).matrix().isApprox(a.matrix(), 1e-15));
    EXPECT_TRUE((a * a.inverse()).matrix().isIdentity(1e-12));
    EXPECT_TRUE((a.inverse() * a).matrix().isIdentity(1e-12));
    const Eigen::Vector3d point(1, -2, 3);
    EXPECT_TRUE((a * (b * point)).isApprox((a * b) * point, 1e-12));
    EXPECT_TRUE((a.matrix() * point.homogeneous()).head<3>().isApprox(a * point, 1e-12));
  }
}

TEST(Similarity, OfScaleOneIsAPose) {
  std::mt19937_64 generator(5);
  for (const double angle : angles) {
    Vector7d delta = random_tangent(generator, angle, 0);
    const Pose T = Pose::exp(delta.head<6>());
    EXPECT_TRUE(Similarity::exp(delta).matrix().isApprox(T.matrix(), 1e-14)) << angle;
    EXPECT_TRUE(Similarity(T).matrix().isApprox(T.matrix(), 1e-15));
    EXPECT_TRUE(Similarity(T).pose().matrix().isApprox(T.matrix(), 1e-15));
  }
}

TEST(Similarity, PoseSeesThePointsInTheSameDirections) {
  std::mt19937_64 generator(6);
  for (int repeat = 0; repeat < 20; ++repeat) {
    const Similarity S_cw = random_similarity(generator);
    const Eigen::Vector3d p_w(draw(generator, 3), draw(generator, 3), draw(generator, 3));
    EXPECT_TRUE((S_cw.pose() * p_w * S_cw.scale()).isApprox(S_cw * p_w, 1e-12));
  }
}

TEST(Similarity, AdjointMovesTangentsAcross) {
  std::mt19937_64 generator(7);
  for (int repeat = 0; repeat < 50; ++repeat) {
    const Similarity S = random_similarity(generator);
    const Vector7d delta = random_tangent(generator, draw(generator, 1), draw(generator, 0.5));
    const Similarity left = S * Similarity::exp(delta) * S.inverse();
    const Similarity right = Similarity::exp(S.adjoint() * delta);
    EXPECT_TRUE(left.matrix().isApprox(right.matrix(), 1e-11));
    EXPECT_TRUE(S.adjoint().isApprox(series_exp(similarity_ad(S.log())), 1e-11));
    EXPECT_TRUE((S.adjoint() * S.inverse().adjoint()).isIdentity(1e-11));
  }
}

TEST(Similarity, LeftJacobianInverseIsTheDerivativeOfLog) {
  std::mt19937_64 generator(8);
  constexpr double step = 1e-5;
  for (const double angle : {0.0, 1e-9, 1e-3, 0.01, 0.05, 0.2, 1.0, 2.5}) {
    for (const double size : {1e-3, 1e-2, 0.1, 1.0}) {
      Vector7d delta = random_tangent(generator, angle, draw(generator, 1));
      delta.tail<4>() *= size;
      const Similarity S = Similarity::exp(delta);
      const Matrix7d left = similarity_left_jacobian_inverse(delta);
      const Matrix7d right = similarity_left_jacobian_inverse(-delta);
      for (int i = 0; i < 7; ++i) {
        const Vector7d d = step * Vector7d::Unit(i);
        const Similarity plus = Similarity::exp(d), minus = Similarity::exp(-d);
        const Vector7d on_left = ((plus * S).log() - (minus * S).log()) / (2 * step);
        const Vector7d on_right = ((S * plus).log() - (S * minus).log()) / (2 * step);
        EXPECT_LT((on_left - left.col(i)).norm(), 1e-8) << angle << " " << size;
        EXPECT_LT((on_right - right.col(i)).norm(), 1e-8) << angle << " " << size;
      }
    }
  }
}

TEST(Similarity, LeftJacobianInverseIsContinuousWhereTheSeriesEnds) {
  std::mt19937_64 generator(9);
  for (int repeat = 0; repeat < 20; ++repeat) {
    Vector7d delta = random_tangent(generator, 1, draw(generator, 1));
    delta /= similarity_ad(delta).norm();
    const Matrix7d below = similarity_left_jacobian_inverse((0.1 - 1e-13) * delta);
    const Matrix7d above = similarity_left_jacobian_inverse((0.1 + 1e-13) * delta);
    EXPECT_LT((below - above).norm(), 1e-12);
  }
}

TEST(Similarity, RefusesScalesThatAreNotPositive) {
  const Eigen::Quaterniond q = Eigen::Quaterniond::Identity();
  const Eigen::Vector3d t = Eigen::Vector3d::Zero();
  for (const double scale : {0.0, -1.0, std::numeric_limits<double>::infinity(),
                             std::numeric_limits<double>::quiet_NaN()}) {
    EXPECT_THROW(Similarity(scale, q, t), std::invalid_argument);
  }
}

}  // namespace
}  // namespace orbslam

// SPDX-License-Identifier: BSD-3-Clause
// Every derivative of src/cpp/optimize against central differences of what it is the derivative of,
// taken through the parameterisation: charts of views, left tangents of poses and similarities.
#include <ceres/cost_function.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "optimize/bundle_residuals.hpp"
#include "optimize/pose_graph_residuals.hpp"
#include "optimize/pose_kernels.hpp"
#include "optimize/sim3_residuals.hpp"
#include "support/cameras.hpp"
#include "support/random_numbers.hpp"

namespace orbslam {
namespace {

using testing::uniform;

using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using Blocks = std::vector<Eigen::VectorXd>;

/// A function with derivatives: given the parameter blocks, residuals and, unless null, the
/// Jacobian of every block.
struct Differentiable {
  std::string name;
  Blocks blocks;
  std::function<Eigen::VectorXd(const Blocks&, std::vector<Matrix>*)> evaluate;
};

/// The generic test.
void expect_derivatives(const Differentiable& f) {
  std::vector<Matrix> analytic;
  const Eigen::VectorXd at = f.evaluate(f.blocks, &analytic);
  ASSERT_EQ(analytic.size(), f.blocks.size()) << f.name;
  for (std::size_t b = 0; b < f.blocks.size(); ++b) {
    ASSERT_EQ(analytic[b].rows(), at.size()) << f.name;
    ASSERT_EQ(analytic[b].cols(), f.blocks[b].size()) << f.name;
    const double tolerance = 1e-7 * (1 + analytic[b].norm());
    for (Eigen::Index i = 0; i < f.blocks[b].size(); ++i) {
      const auto slope = [&](double step) -> Eigen::VectorXd {
        Blocks above = f.blocks, below = f.blocks;
        above[b](i) += step;
        below[b](i) -= step;
        return (f.evaluate(above, nullptr) - f.evaluate(below, nullptr)) / (2 * step);
      };
      // Two step widths cancel the error of third order.
      const double step = 2e-5;
      const Eigen::VectorXd numeric = (4 * slope(step) - slope(2 * step)) / 3;
      EXPECT_LT((analytic[b].col(i) - numeric).cwiseAbs().maxCoeff(), tolerance)
          << f.name << ", block " << b << ", parameter " << i << "\nanalytic "
          << analytic[b].col(i).transpose() << "\nnumeric  " << numeric.transpose();
    }
  }
}

/// A function of Ceres' kind; `prepare` does what the solver's evaluation callback does.
Differentiable ceres_function(std::string name, const ceres::CostFunction& cost, Blocks blocks,
                              std::function<void(const Blocks&)> prepare) {
  return {std::move(name), std::move(blocks),
          [&cost, prepare](const Blocks& at, std::vector<Matrix>* jacobians) {
            prepare(at);
            std::vector<const double*> parameters;
            std::vector<double*> pointers;
            if (jacobians != nullptr) jacobians->clear();
            for (std::size_t b = 0; b < at.size(); ++b) {
              EXPECT_EQ(cost.parameter_block_sizes()[b], at[b].size());
              parameters.push_back(at[b].data());
              if (jacobians == nullptr) continue;
              // Every entry has to be written.
              jacobians->push_back(Matrix::Constant(cost.num_residuals(), at[b].size(), 1e9));
            }
            if (jacobians != nullptr) {
              for (Matrix& jacobian : *jacobians) pointers.push_back(jacobian.data());
            }
            Eigen::VectorXd residuals(cost.num_residuals());
            EXPECT_TRUE(cost.Evaluate(parameters.data(), residuals.data(),
                                      jacobians == nullptr ? nullptr : pointers.data()));
            return residuals;
          }};
}

Eigen::VectorXd random_vector(std::mt19937_64& random, Eigen::Index n, double size) {
  Eigen::VectorXd v(n);
  for (double& x : v) x = uniform(random, -size, size);
  return v;
}

/// The size of angles, shifts and logarithms of scales: ordinary, small, and where closed forms
/// with a division by the angle would have no digits left.
constexpr double kSizes[] = {1, 0.3, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-9, 0};
constexpr int kTrials = 20;

double random_depth(std::mt19937_64& random) {
  return std::exp(uniform(random, std::log(0.5), std::log(50.0)));
}

TEST(Jacobians, BundleResiduals) {
  std::mt19937_64 random(1);
  for (const double size : kSizes) {
    for (int trial = 0; trial < kTrials; ++trial) {
      const auto camera_model =
          testing::make_camera(testing::kTestLenses[static_cast<std::size_t>(trial % 3)], 40);
      BundleView view(Pose::exp(random_vector(random, 6, 1)), *camera_model);
      const Blocks blocks = {random_vector(random, 6, size), Eigen::VectorXd(3)};
      view.move(blocks[0].data());
      const double z = random_depth(random);
      const double u = uniform(random, 0, 640), v = uniform(random, 0, 480);
      const Eigen::VectorXd camera = blocks[0],
                            point = view.T_cw().inverse() * camera_model->unproject(u, v, z);
      Eigen::Vector3d evaluated = point;
      BundleMeasurement m;
      m.view = &view;
      m.point = evaluated.data();
      m.u = u + uniform(random, -8, 8);
      m.sight = camera_model->sight(m.u, v + uniform(random, -8, 8));
      m.right_u = u - camera_model->bf() / z + uniform(random, -8, 8);
      m.has_depth = true;
      m.scale = uniform(random, 0.3, 1);
      m.right_scale = uniform(random, 0.5, 2);
      const auto free = [&](const Blocks& at) {
        view.move(at[0].data());
        evaluated = at[1];
        m.evaluate();
      };
      const auto fixed = [&](const Blocks& at) {
        view.move(camera.data());
        evaluated = at[0];
        m.evaluate();
      };
      const ImageResiduals<true> image_free(&m);
      const ImageResiduals<false> image_fixed(&m);
      const RightResidual<true> right_free(&m);
      const RightResidual<false> right_fixed(&m);
      expect_derivatives(ceres_function("image, free", image_free, {camera, point}, free));
      expect_derivatives(ceres_function("image, fixed", image_fixed, {point}, fixed));
      expect_derivatives(ceres_function("right, free", right_free, {camera, point}, free));
      expect_derivatives(ceres_function("right, fixed", right_fixed, {point}, fixed));
      m.has_depth = false;
      expect_derivatives(ceres_function("mono, free", image_free, {camera, point}, free));
      expect_derivatives(ceres_function("mono, fixed", image_fixed, {point}, fixed));
    }
  }
}

/// Edges between views away from their starts, with a residual of a size of its own.
template <int kParameters>
void check_pose_graph_edges(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  for (const double offset : kSizes) {
    for (const double residual : kSizes) {
      for (int trial = 0; trial < kTrials; ++trial) {
        PoseGraphView view_i(Similarity::exp(random_vector(random, 7, 2)));
        PoseGraphView view_j(Similarity::exp(random_vector(random, 7, 2)));
        const Blocks blocks = {random_vector(random, kParameters, offset),
                               random_vector(random, kParameters, offset)};
        const auto move = [&](const Blocks& at) {
          view_i.move(at[0].data(), kParameters);
          view_j.move(at[1].data(), kParameters);
        };
        move(blocks);
        const Similarity S_ji = Similarity::exp(random_vector(random, 7, residual)) *
                                view_j.S_iw() * view_i.S_iw().inverse();
        const PoseGraphResidual<kParameters> edge(S_ji, &view_i, &view_j);
        expect_derivatives(ceres_function("edge of " + std::to_string(kParameters) + ", offset " +
                                              std::to_string(offset) + ", residual " +
                                              std::to_string(residual),
                                          edge, blocks, move));
      }
    }
  }
}

// OD-114: derivatives of similarities are analytic.
TEST(Jacobians, PoseGraphEdges) { check_pose_graph_edges<7>(2); }
TEST(Jacobians, PoseGraphEdgesOfUprightCameras) { check_pose_graph_edges<4>(4); }
TEST(Jacobians, PoseGraphEdgesWithScalesKept) { check_pose_graph_edges<6>(3); }

// OD-114: derivatives of similarities are analytic.
TEST(Jacobians, Sim3Residuals) {
  std::mt19937_64 random(4);
  const auto camera = testing::make_camera({500, 510, 320, 240});
  for (const double size : kSizes) {
    for (int trial = 0; trial < kTrials; ++trial) {
      const Similarity S_12 = Similarity::exp(random_vector(random, 7, size));
      SimilarityMatch m;
      m.inverse_sigma2_1 = 0.7;
      m.inverse_sigma2_2 = 0.4;
      m.pixel_1 = {uniform(random, 0, 640), uniform(random, 0, 480)};
      m.pixel_2 = {uniform(random, 0, 640), uniform(random, 0, 480)};
      const auto projected = [&](const Eigen::Vector2d& pixel) {
        return camera->unproject(pixel.x() + uniform(random, -8, 8),
                                 pixel.y() + uniform(random, -8, 8), random_depth(random));
      };
      m.point_1 = S_12 * projected(m.pixel_2);
      m.point_2 = S_12.inverse() * projected(m.pixel_1);
      for (const bool forward : {true, false}) {
        const auto evaluate = [&](const Blocks& at, std::vector<Matrix>* jacobians) {
          const Similarity moved = Similarity::exp(at[0]) * S_12;
          const auto result = forward ? sim3_residuals::forward(moved, *camera, m)
                                      : sim3_residuals::inverse(moved, *camera, m);
          if (jacobians != nullptr) *jacobians = {result->jacobian};
          return Eigen::VectorXd(result->error);
        };
        expect_derivatives(
            {forward ? "Sim3, forward" : "Sim3, inverse", {Eigen::VectorXd::Zero(7)}, evaluate});
      }
    }
  }
}

/// The kernels of the pose alone give H = J^T w J and b = -J^T w e of what they add up. With one
/// observation whose error is a unit vector, b holds a row of J; its prediction is written here
/// once more.
TEST(Jacobians, PoseKernels) {
  std::mt19937_64 random(5);
  const auto camera = testing::make_camera({500, 510, 320, 240}, 40);
  const double weight = 0.7;
  for (const double size : kSizes) {
    for (int trial = 0; trial < kTrials; ++trial) {
      for (const int rows : {2, 3}) {
        const Pose T_cw = Pose::exp(random_vector(random, 6, size));
        const Eigen::Vector3d p_w =
            T_cw.inverse() * camera->unproject(uniform(random, 0, 640), uniform(random, 0, 480),
                                               random_depth(random));
        const auto predict = [&](const Pose& T) {
          const Eigen::Vector3d p = T * p_w;
          const Eigen::Vector2d pixel = camera->pinhole().project(p);
          const Eigen::Vector3d all(pixel.x(), pixel.y(), pixel.x() - camera->bf() / p.z());
          return Eigen::VectorXd(all.head(rows));
        };
        Matrix6d H = Matrix6d::Zero();
        const auto evaluate = [&](const Blocks& at, std::vector<Matrix>* jacobians) {
          const Pose T = Pose::exp(at[0]) * T_cw;
          const Eigen::VectorXd prediction = predict(T);
          if (jacobians == nullptr) return Eigen::VectorXd(-prediction);
          Matrix jacobian(rows, 6);
          for (int row = 0; row < rows; ++row) {
            Eigen::Vector3d measured = Eigen::Vector3d::Zero();
            measured.head(rows) = prediction + Eigen::VectorXd::Unit(rows, row);
            pose_kernels::Group group;
            group.push_back(p_w, measured.x(), measured.y(), measured.z(), weight, 1, 0);
            group.pad();
            pose_kernels::NormalEquations equations;
            (rows == 3 ? pose_kernels::accumulate_stereo : pose_kernels::accumulate_mono)(
                group, *camera, T, 0, &equations);
            jacobian.row(row) = -equations.b.transpose() / weight;
            H = equations.H;
          }
          *jacobians = {jacobian};
          return Eigen::VectorXd(-prediction);
        };
        expect_derivatives({"pose kernel", {Eigen::VectorXd::Zero(6)}, evaluate});
        std::vector<Matrix> J;
        evaluate({Eigen::VectorXd::Zero(6)}, &J);
        EXPECT_LT((H - weight * J[0].transpose() * J[0]).norm(), 1e-9 * H.norm());
      }
    }
  }
}

}  // namespace
}  // namespace orbslam

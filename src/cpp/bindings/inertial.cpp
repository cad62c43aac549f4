// SPDX-License-Identifier: BSD-3-Clause
#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include <limits>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "bindings/arrays.hpp"
#include "bindings/bindings.hpp"
#include "inertial/preintegration.hpp"

namespace orbslam::bindings {
namespace {

using namespace py::literals;

std::vector<ImuSample> imu_samples_of(const Input<double>& array) {
  std::vector<ImuSample> samples(rows_of(array, 7, "samples"));
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const double* row = array.data() + 7 * i;
    samples[i] = {row[0], {row[1], row[2], row[3]}, {row[4], row[5], row[6]}};
  }
  return samples;
}

py::array_t<double> imu_samples_to_array(const std::vector<ImuSample>& samples) {
  py::array_t<double> array({static_cast<py::ssize_t>(samples.size()), py::ssize_t{7}});
  double* row = array.mutable_data();
  for (const ImuSample& sample : samples) {
    row[0] = sample.t;
    Eigen::Map<Eigen::Vector3d>(row + 1) = sample.gyro;
    Eigen::Map<Eigen::Vector3d>(row + 4) = sample.accel;
    row += 7;
  }
  return array;
}

ImuBias bias_of(const Vector6d& bias) { return {bias.head<3>(), bias.tail<3>()}; }

Vector6d to_vector(const ImuBias& bias) {
  Vector6d both;
  both << bias.gyro, bias.accel;
  return both;
}

std::unique_ptr<Preintegration> preintegrate(const Input<double>& array, double gyro_noise,
                                             double accel_noise, double gyro_walk,
                                             double accel_walk, const std::optional<Vector6d>& bias,
                                             std::optional<double> begin, std::optional<double> end,
                                             double max_gap, double gyro_range,
                                             double accel_range) {
  std::vector<ImuSample> samples = imu_samples_of(array);
  const py::gil_scoped_release release;
  if ((begin || end) && !samples.empty()) {
    samples =
        samples_between(samples, begin.value_or(samples.front().t), end.value_or(samples.back().t));
  }
  return std::make_unique<Preintegration>(
      std::move(samples), ImuNoise{gyro_noise, accel_noise, gyro_walk, accel_walk},
      bias ? bias_of(*bias) : ImuBias{}, PreintegrationOptions{max_gap, gyro_range, accel_range});
}

constexpr const char* kPreintegrationDoc =
    R"(IMU samples of an interval, preintegrated on the manifold (Forster et al., T-RO 2017).

The relative motion between the first and the last moment, free of gravity and of the first
velocity: `R_j = R_i dR`, `v_j = v_i + g dt + R_i dv`, `p_j = p_i + v_i dt + g dt^2 / 2 + R_i dp`.
All vectors are in the frame of the IMU. Errors are ordered (rotation [rad], velocity [m/s],
position [m]); that of the rotation acts on the right of `dR`.)";

constexpr const char* kInitDoc =
    R"(Integrate samples, from the first to the last or between two moments.

samples: float64 (n, 7), rows `[t, gyro rad/s, accelerometer m/s^2]` with growing t [s]; the
accelerometer at rest points up. gyro_noise [rad/s/sqrt(Hz)], accel_noise [m/s^2/sqrt(Hz)],
gyro_walk [rad/s^2/sqrt(Hz)] and accel_walk [m/s^3/sqrt(Hz)] are the densities of the noise.
bias: (6,), gyro and accelerometer; by default 0. begin, end: seconds; readings there are
interpolated, or held where no sample lies beyond. max_gap: longer intervals [s] count as gaps.
gyro_range, accel_range: readings at the range [rad/s, m/s^2] count as saturated. Raises ValueError
if there are fewer than two samples, if one is not finite, or if the times do not grow.)";

void bind_preintegration(py::module_& module) {
  using P = Preintegration;
  const double inf = std::numeric_limits<double>::infinity();
  py::class_<P>(module, "Preintegration", kPreintegrationDoc)
      .def(py::init(&preintegrate), "samples"_a, py::kw_only(), "gyro_noise"_a, "accel_noise"_a,
           "gyro_walk"_a = 0.0, "accel_walk"_a = 0.0, "bias"_a = py::none(), "begin"_a = py::none(),
           "end"_a = py::none(), "max_gap"_a = 0.05, "gyro_range"_a = inf, "accel_range"_a = inf,
           kInitDoc)
      .def_property_readonly("begin", &P::begin, "First moment [s].")
      .def_property_readonly("end", &P::end, "Last moment [s].")
      .def_property_readonly("dt", &P::duration, "Duration [s].")
      .def_property_readonly(
          "dR", [](const P& p) { return Eigen::Matrix3d(p.motion().dR.toRotationMatrix()); },
          "Rotation (3, 3) from the last frame of the IMU to the first.")
      .def_property_readonly(
          "dv", [](const P& p) { return p.motion().dv; }, "Change of the velocity (3,) [m/s].")
      .def_property_readonly(
          "dp", [](const P& p) { return p.motion().dp; }, "Change of the position (3,) [m].")
      .def_property_readonly(
          "covariance", [](const P& p) { return p.covariance(); },
          "Of (rotation, velocity, position), (9, 9), by the noise of the samples.")
      .def_property_readonly(
          "by_bias", [](const P& p) { return p.by_bias(); },
          "Derivative of (rotation, velocity, position) by the bias (gyro, accelerometer), (9, 6).")
      .def_property_readonly("bias_walk_covariance", &P::bias_walk_covariance,
                             "Of the change of the bias during the interval, (6, 6).")
      .def_property_readonly(
          "bias", [](const P& p) { return to_vector(p.bias()); },
          "Bias (6,) it was integrated with: gyro [rad/s], accelerometer [m/s^2].")
      .def_property_readonly(
          "samples", [](const P& p) { return imu_samples_to_array(p.samples()); },
          "Samples (n, 7) it was integrated from, with those interpolated at the ends.")
      .def_property_readonly(
          "n_gaps", [](const P& p) { return p.flags().n_gaps; },
          "Intervals longer than `max_gap`. Their noise is not averaged, and the covariance allows "
          "any rate between the two readings.")
      .def_property_readonly(
          "longest_gap", [](const P& p) { return p.flags().longest_gap; },
          "Longest gap [s]; 0 if there is none.")
      .def_property_readonly(
          "n_saturated_gyro", [](const P& p) { return p.flags().n_saturated_gyro; },
          "Samples with a reading at `gyro_range`.")
      .def_property_readonly(
          "n_saturated_accel", [](const P& p) { return p.flags().n_saturated_accel; },
          "Samples with a reading at `accel_range`.")
      .def(
          "corrected",
          [](const P& p, const Vector6d& bias) {
            const ImuMotion motion = p.corrected(bias_of(bias));
            return py::make_tuple(Eigen::Matrix3d(motion.dR.toRotationMatrix()), motion.dv,
                                  motion.dp);
          },
          "bias"_a, "dR (3, 3), dv (3,), dp (3,) at another bias (6,), to first order.")
      .def(
          "reintegrated",
          [](const P& p, const Vector6d& bias) { return p.reintegrated(bias_of(bias)); }, "bias"_a,
          Release(), "The same samples, integrated again with another bias (6,).")
      .def("joined", &P::joined, "next"_a, Release(),
           "Both intervals as one, with the bias, noise and limits of this one. Raises ValueError "
           "unless `next` begins where this one ends.")
      .def(
          "predict",
          [](const P& p, const Pose& T_wb, const Eigen::Vector3d& velocity,
             const Eigen::Vector3d& gravity, const std::optional<Vector6d>& bias) {
            const ImuState state =
                p.predict({T_wb, velocity}, bias ? bias_of(*bias) : p.bias(), gravity);
            return py::make_tuple(state.T_wb, state.velocity);
          },
          "T_wb"_a, "velocity"_a, "gravity"_a, "bias"_a = py::none(),
          "Pose `T_wb` and velocity (3,) [m/s] of the IMU in the world at the end of the interval, "
          "from those at its begin. gravity: acceleration of free fall in the world (3,) [m/s^2], "
          "(0, 0, -9.81) where z is up. bias: (6,), by default that of the integration.");
}

}  // namespace

void bind_inertial(py::module_& module) { bind_preintegration(module); }

}  // namespace orbslam::bindings

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
#include "inertial/inertial_filter.hpp"
#include "inertial/inertial_start.hpp"
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

ImuNoise noise_of(const Eigen::Vector4d& noise) { return {noise(0), noise(1), noise(2), noise(3)}; }

constexpr const char* kFilterDoc =
    R"(Gaussian over the state of an IMU in a map, from image to image.

Errors are ordered (rotation [rad], velocity [m/s], position [m], gyro bias [rad/s], accelerometer
bias [m/s^2], tilt of gravity about the first two axes of the world [rad], logarithm of the scale):
18. That of the rotation acts on the right, velocity and position are added in the world, whose third
axis is up. The scale is units of the map per metre.)";

void bind_filter(py::module_& module) {
  using F = InertialFilter;
  py::class_<F>(module, "InertialFilter", kFilterDoc)
      .def(py::init([](const Pose& T_cb, const Eigen::Vector4d& noise, const Pose& T_wb,
                       const Eigen::Vector3d& velocity, const Vector6d& bias,
                       const F::Covariance& covariance) {
             return F(T_cb, noise_of(noise), {T_wb, velocity}, bias_of(bias), covariance);
           }),
           "T_cb"_a, "noise"_a, "T_wb"_a, "velocity"_a, "bias"_a, "covariance"_a,
           "T_cb: Pose from the IMU to the camera. noise: (4,), densities of gyro and "
           "accelerometer, and of the walks of their biases, in the units of `Preintegration`. "
           "T_wb, velocity (3,), bias (6,), covariance (18, 18): the state at first.")
      .def(
          "predict",
          [](F& f, const Input<double>& samples, double scale_walk, double rotation_walk) {
            f.predict(imu_samples_of(samples), scale_walk, rotation_walk);
          },
          "samples"_a, "scale_walk"_a = 0.0, "rotation_walk"_a = 0.0,
          "From the first sample (n, 7) to the last. Random walks for the drift of a growing map: "
          "of the logarithm of the scale [1/sqrt(s)], and of the map's axes [rad/sqrt(s)]. Raises "
          "ValueError as Preintegration does.")
      .def(
          "pose",
          [](const F& f) {
            const PoseGaussian pose = f.pose();
            return py::make_tuple(pose.T_cw, pose.covariance);
          },
          "Pose `T_cw` of the camera and its covariance (6, 6): rotation, translation; left "
          "perturbation.")
      .def("fuse", &F::fuse, "T_cw"_a, "covariance"_a, "inflation"_a = 1.0,
           "Take the pose of an image that was estimated with `pose` as prior, and its covariance. "
           "The information of the image is divided by inflation.")
      .def("update", &F::update, "T_cw"_a, "covariance"_a,
           "Take the pose of an image that was estimated without a prior.")
      .def("distance", &F::distance, "T_cw"_a, "covariance"_a,
           "Squared Mahalanobis distance of a pose with this covariance: 6 degrees of freedom.")
      .def("move", &F::move, "T_cw"_a,
           "The map was moved: the camera's pose is this one now; the velocity turns with it.")
      .def("anchor", &F::anchor,
           "The map continues from the present pose, which has no error there by definition.")
      .def(
          "transform",
          [](F& f, double scale, const Pose& pose) {
            f.transform(pose.rotation(), scale, pose.translation());
          },
          "scale"_a, "pose"_a,
          "The map was moved: `x' = scale R x + t`. Tilt and scale are 0 afterwards.")
      .def_property_readonly(
          "T_wb", [](const F& f) { return f.state().T_wb; }, "Pose of the IMU in the world.")
      .def_property_readonly(
          "velocity", [](const F& f) { return f.state().velocity; },
          "Of the IMU in the world (3,) [m/s].")
      .def_property_readonly(
          "bias", [](const F& f) { return to_vector(f.bias()); },
          "(6,): gyro [rad/s], accelerometer [m/s^2].")
      .def_property_readonly("tilt", &F::tilt,
                             "Rotation [rad] about the first two axes of the world from "
                             "(0, 0, -9.81) to gravity (2,).")
      .def_property_readonly("log_scale", &F::log_scale, "Logarithm of the scale.")
      .def_property_readonly("gravity", &F::gravity, "In the world (3,) [m/s^2].")
      .def_property_readonly("covariance", &F::covariance, "(18, 18).");
}

InertialStart start_of(const std::vector<double>& times, const std::vector<Pose>& T_wc,
                       const std::vector<Input<double>>& samples, const Pose& T_cb,
                       const Eigen::Vector4d& noise, bool metric, double rotation_deviation,
                       double position_deviation, const Vector6d& bias, double gyro_deviation,
                       double accel_deviation, double known_gravity, double known_scale) {
  if (times.size() != T_wc.size()) throw py::value_error("as many times as poses are needed");
  std::vector<InertialView> views;
  for (std::size_t i = 0; i < times.size(); ++i) views.push_back({times[i], T_wc[i]});
  std::vector<std::vector<ImuSample>> between;
  for (const auto& array : samples) between.push_back(imu_samples_of(array));
  InertialStartOptions options;
  options.metric = metric;
  options.rotation_deviation = rotation_deviation;
  options.position_deviation = position_deviation;
  options.bias = bias_of(bias);
  options.gyro_deviation = gyro_deviation;
  options.accel_deviation = accel_deviation;
  options.known_gravity = known_gravity;
  options.known_scale = known_scale;
  const py::gil_scoped_release release;
  return estimate_inertial_start(views, between, T_cb, noise_of(noise), options);
}

void bind_start(py::module_& module) {
  using S = InertialStart;
  py::class_<S>(module, "InertialStart", "What estimate_inertial_start found.")
      .def_readonly("solved", &S::solved, "False: the other fields are meaningless.")
      .def_readonly("gravity", &S::gravity, "Free fall in the map (3,) [m/s^2].")
      .def_readonly("gravity_length", &S::gravity_length,
                    "Its length if it is not known to be 9.81: a check.")
      .def_readonly("scale", &S::scale, "Metres per unit of the map.")
      .def_property_readonly(
          "bias", [](const S& s) { return to_vector(s.bias); },
          "(6,): gyro [rad/s], accelerometer [m/s^2].")
      .def_readonly("velocities", &S::velocities,
                    "Of the IMU at the views, (3,) each [m/s], in the axes of the map.")
      .def_readonly("scale_deviation", &S::scale_deviation, "Of the logarithm of the scale.")
      .def_readonly("gravity_deviation", &S::gravity_deviation, "Of its direction [rad].")
      .def_readonly("cost", &S::cost, "Weighted sum of squared residuals.")
      .def_readonly("freedom", &S::freedom, "Degrees of freedom of the cost.")
      .def_readonly("covariance", &S::covariance,
                    "(18, 18) of the last view, in the order of InertialFilter, once the map has "
                    "been turned by `up` and multiplied by `scale`.")
      .def_property_readonly(
          "up", [](const S& s) { return Pose(s.up, Eigen::Vector3d::Zero()); },
          "Pose that turns gravity to (0, 0, -9.81).");
  module.def(
      "estimate_inertial_start", &start_of, "times"_a, "T_wc"_a, "samples"_a, "T_cb"_a, "noise"_a,
      py::kw_only(), "metric"_a, "rotation_deviation"_a, "position_deviation"_a,
      "bias"_a = Vector6d(Vector6d::Zero()), "gyro_deviation"_a = 0.1, "accel_deviation"_a = 0.2,
      "known_gravity"_a = 0.0, "known_scale"_a = 0.0,
      "Gravity, scale, biases and velocities from poses of the camera in a map and the "
      "samples between them (Campos et al., ICRA 2020).\n\n"
      "times, T_wc: of n views, 4 or more. samples: n - 1 arrays (m, 7). T_cb, noise: as of "
      "InertialFilter. metric: the unit of the map is the metre. Deviations of the views' "
      "rotations [rad] and positions [units of the map]; bias (6,) with the deviations of "
      "gyro [rad/s] and accelerometer [m/s^2]: what is known before. known_gravity [rad] and "
      "known_scale: deviations of the third axis and of the logarithm of the scale in a map "
      "that an IMU has turned upright before; 0: nothing is known. Raises ValueError.");
}

}  // namespace

void bind_inertial(py::module_& module) {
  bind_preintegration(module);
  bind_filter(module);
  bind_start(module);
}

}  // namespace orbslam::bindings

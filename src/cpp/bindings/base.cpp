// SPDX-License-Identifier: BSD-3-Clause
#include <pybind11/eigen.h>
#include <pybind11/operators.h>
#include <pybind11/stl.h>

#include <exception>
#include <sstream>
#include <string>

#include "base/errors.hpp"
#include "base/pose.hpp"
#include "base/scale_pyramid.hpp"
#include "base/seeds.hpp"
#include "bindings/arrays.hpp"
#include "bindings/bindings.hpp"

namespace orbslam::bindings {
namespace {

using RowPoints = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;

/// The classes of orbslam2py.errors, kept for the life of the interpreter.
py::object error_class(const char* name) {
  return py::module_::import("orbslam2py.errors").attr(name);
}

void raise_as(const char* name, const std::exception& error) {
  const py::object type = error_class(name);
  PyErr_SetString(type.ptr(), error.what());
}

void register_errors(py::module_& module) {
  // Fails at import, not at the first error, when the Python side misses a class.
  for (const char* name : {"OrbSlamError", "SettingsError", "ImageError", "VocabularyError",
                           "MapFileError", "StateError"}) {
    module.attr(name) = error_class(name);
  }
  py::register_exception_translator([](std::exception_ptr pointer) {
    try {
      if (pointer) std::rethrow_exception(pointer);
    } catch (const SettingsError& error) {
      raise_as("SettingsError", error);
    } catch (const ImageError& error) {
      raise_as("ImageError", error);
    } catch (const VocabularyError& error) {
      raise_as("VocabularyError", error);
    } catch (const MapFileError& error) {
      raise_as("MapFileError", error);
    } catch (const StateError& error) {
      raise_as("StateError", error);
    } catch (const OrbSlamError& error) {
      raise_as("OrbSlamError", error);
    }
  });
}

std::string repr(const Pose& pose) {
  const Eigen::Quaterniond& q = pose.rotation();
  const Eigen::Vector3d& t = pose.translation();
  std::ostringstream text;
  text << "Pose(translation=[" << t.x() << ", " << t.y() << ", " << t.z() << "], quaternion_xyzw=["
       << q.x() << ", " << q.y() << ", " << q.z() << ", " << q.w() << "])";
  return text.str();
}

Eigen::Vector4d quaternion_xyzw(const Pose& pose) { return pose.rotation().coeffs(); }

Pose from_quaternion(const Eigen::Vector4d& xyzw, const Eigen::Vector3d& translation) {
  if (!xyzw.allFinite() || !(xyzw.norm() > 0)) {
    throw py::value_error("the quaternion must be finite and not zero");
  }
  if (!translation.allFinite()) throw py::value_error("the translation must be finite");
  return Pose(Eigen::Quaterniond(xyzw[3], xyzw[0], xyzw[1], xyzw[2]), translation);
}

Pose from_matrix(const Eigen::Matrix4d& matrix) {
  const Eigen::RowVector4d last(0, 0, 0, 1);
  if (!matrix.allFinite() || !matrix.row(3).isApprox(last, 1e-6)) {
    throw py::value_error("a pose matrix must be finite with the last row 0 0 0 1");
  }
  return Pose::from_matrix(matrix);
}

Pose from_tangent(const Vector6d& xi) {
  if (!xi.allFinite()) throw py::value_error("the tangent vector must be finite");
  return Pose::exp(xi);
}

RowPoints transform_points(const Pose& pose, const Eigen::Ref<const RowPoints>& points) {
  return (points * pose.rotation_matrix().transpose()).rowwise() + pose.translation().transpose();
}

void bind_pose(py::module_& module) {
  py::class_<Pose>(module, "Pose",
                   R"(Rigid transform. `T_ab` maps coordinates of frame b into frame a.

Tangent vectors are (6,) float64: rotation (radians) first, then translation; they act on the left.)")
      .def(py::init<>(), "The identity.")
      .def(py::init(&from_quaternion), py::arg("quaternion_xyzw"), py::arg("translation"),
           "From a quaternion (4,) in the order x y z w, normalised here, and a translation (3,).\n"
           "Raises ValueError unless both are finite and the quaternion is not zero.")
      .def_static("from_matrix", &from_matrix, py::arg("matrix"),
                  "From a 4x4 homogeneous matrix; the rotation is projected onto SO(3). Raises "
                  "ValueError unless it is finite and its last row is 0 0 0 1.")
      .def_static(
          "exp", &from_tangent, py::arg("xi"),
          "Exponential map of a tangent vector (6,). Raises ValueError unless it is finite.")
      .def("log", &Pose::log, "Tangent vector (6,); rotation angle in [0, pi].")
      .def(
          "difference",
          [](const Pose& pose, const Pose& other) {
            const double turn = (pose * other.inverse()).log().head<3>().norm();
            return py::make_tuple(turn, (pose.center() - other.center()).norm());
          },
          py::arg("other"),
          "Between two poses of one camera, world to camera: angle [rad] and distance of the "
          "centres.")
      .def_property_readonly("matrix", &Pose::matrix, "4x4 homogeneous matrix, float64.")
      .def_property_readonly("rotation_matrix", &Pose::rotation_matrix, "3x3 rotation, float64.")
      .def_property_readonly(
          "translation", [](const Pose& pose) { return Eigen::Vector3d(pose.translation()); },
          "Translation (3,).")
      .def_property_readonly("quaternion_xyzw", &quaternion_xyzw, "Unit quaternion (4,), x y z w.")
      .def_property_readonly("center", &Pose::center,
                             "For `T_cw` the camera centre in the world, -R^T t, (3,).")
      .def(
          "power",
          [](const Pose& pose, double exponent) { return Pose::exp(exponent * pose.log()); },
          py::arg("exponent"),
          "The motion `exponent` times, `exp(exponent * log)`: half of it, or its inverse for -1.")
      .def("inverse", &Pose::inverse, "The inverse transform: `T_ab` gives `T_ba`.")
      .def(
          "__matmul__", [](const Pose& a, const Pose& b) { return a * b; }, py::arg("other"),
          py::is_operator())
      .def(
          "__matmul__",
          [](const Pose& pose, const Eigen::Vector3d& point) -> Eigen::Vector3d {
            return pose * point;
          },
          py::arg("point"), py::is_operator(), "Transforms a point (3,).")
      .def("__matmul__", &transform_points, py::arg("points"), py::is_operator(),
           "Transforms points (n, 3).")
      .def("__repr__", &repr)
      .def(py::pickle(
          [](const Pose& pose) {
            return py::make_tuple(quaternion_xyzw(pose), Eigen::Vector3d(pose.translation()));
          },
          [](const py::tuple& state) {
            return from_quaternion(state[0].cast<Eigen::Vector4d>(),
                                   state[1].cast<Eigen::Vector3d>());
          }));
}

py::array_t<float> scale_table(const ScalePyramid& scales,
                               float (ScalePyramid::*entry)(int) const) {
  std::vector<float> values;
  for (int level = 0; level < scales.levels(); ++level) values.push_back((scales.*entry)(level));
  return to_array(values);
}

void check_level(const ScalePyramid& scales, int level) {
  if (level < 0 || level >= scales.levels()) {
    throw py::index_error("level " + std::to_string(level) + " of a pyramid of " +
                          std::to_string(scales.levels()));
  }
}

void bind_scale_pyramid(py::module_& module) {
  py::class_<ScalePyramid>(module, "ScalePyramid", "Scale tables of an image pyramid.")
      .def(py::init<float, int, bool>(), py::arg("factor"), py::arg("levels"),
           py::arg("original_coordinates") = false,
           "`factor`: ratio between levels, above 1 and at most 2. `levels`: 1 to 16. Raises "
           "SettingsError otherwise. `original_coordinates`: see OrbOptions.")
      .def_property_readonly("levels", &ScalePyramid::levels, "Number of levels.")
      .def_property_readonly("factor", &ScalePyramid::factor, "Ratio between levels.")
      .def_property_readonly("log_factor", &ScalePyramid::log_factor, "Its natural logarithm.")
      .def_property_readonly("original_coordinates", &ScalePyramid::original_coordinates,
                             "Whether keypoints of coarse levels lie where the original puts them.")
      .def_property_readonly(
          "scale", [](const ScalePyramid& s) { return scale_table(s, &ScalePyramid::scale); },
          "Size of a pixel of each level in level-0 pixels, (levels,) float32.")
      .def_property_readonly(
          "inverse_scale",
          [](const ScalePyramid& s) { return scale_table(s, &ScalePyramid::inverse_scale); },
          "Its reciprocal, (levels,) float32.")
      .def_property_readonly(
          "sigma2", [](const ScalePyramid& s) { return scale_table(s, &ScalePyramid::sigma2); },
          "Variance of a keypoint of each level in level-0 pixels^2, (levels,) float32.")
      .def_property_readonly(
          "inverse_sigma2",
          [](const ScalePyramid& s) { return scale_table(s, &ScalePyramid::inverse_sigma2); },
          "Its reciprocal, (levels,) float32.")
      .def(
          "level_size",
          [](const ScalePyramid& scales, int width, int height, int level) {
            check_level(scales, level);
            const ImageSize size = scales.level_size({width, height}, level);
            return py::make_tuple(size.width, size.height);
          },
          py::arg("width"), py::arg("height"), py::arg("level"),
          "(width, height) of a level for a level-0 size.")
      .def("features_per_level", &ScalePyramid::features_per_level, py::arg("n_features"),
           "How the wanted number of features is shared among the levels.")
      .def("predict_level", &ScalePyramid::predict_level, py::arg("max_distance"),
           py::arg("distance"),
           "Level at which a point is expected that was seen at most `max_distance` away.");
}

void bind_seeds(py::module_& module) {
  module.def(
      "seed_of",
      [](std::uint64_t seed, std::int64_t first, std::int64_t second) {
        return seed_of(
            {seed, static_cast<std::uint64_t>(first), static_cast<std::uint64_t>(second)});
      },
      py::arg("seed"), py::arg("first"), py::arg("second"),
      "One seed (uint64) out of the system's and two ids: another one for other ids or another\n"
      "order, the same on every platform.");
}

}  // namespace

void bind_base(py::module_& module) {
  register_errors(module);
  bind_pose(module);
  bind_scale_pyramid(module);
  bind_seeds(module);
}

}  // namespace orbslam::bindings

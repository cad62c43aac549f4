// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <variant>
#include <vector>

#include "base/scale_pyramid.hpp"
#include "camera/lens_models.hpp"

namespace orbslam {

/// The closed set of lens models.
using LensModel = std::variant<lens_models::PinholeLens, lens_models::PlaneDistortionLens,
                               lens_models::KannalaBrandtLens, lens_models::DoubleSphereLens,
                               lens_models::ExtendedUnifiedLens, lens_models::OmnidirectionalLens,
                               lens_models::FieldOfViewLens>;

/// True for a pinhole, with or without distortion; false for a fisheye lens.
inline bool is_flat(const LensModel& lens) {
  return std::holds_alternative<lens_models::PinholeLens>(lens) ||
         std::holds_alternative<lens_models::PlaneDistortionLens>(lens);
}

/// A parameter of a camera model and its range.
struct CameraParameter {
  std::string name;
  double low, high;
  bool open;  ///< low and high themselves are excluded
};

/// One row per model: its name, other programs' names for the same parameters in the same order,
/// the parameters in this order (fx, fy, cx, cy, then those of the lens), and how to make the lens
/// from the latter.
struct CameraModelRow {
  std::string name;
  std::vector<std::string> aliases;
  std::vector<CameraParameter> parameters;
  LensModel (*make)(const Pinhole& plane, const double* lens);
};

/// Rows of all models.
const std::vector<CameraModelRow>& camera_model_rows();

/// The row of a name or an alias, in any case, for these parameters. Throws SettingsError that
/// names model, parameter and remedy for an unknown name, a wrong number of parameters, a value
/// that is not finite or out of its range, focal lengths that are not in pixels or in another
/// place, or an image size that is not positive.
const CameraModelRow& check_camera_model(const std::string& name,
                                         const std::vector<double>& parameters, ImageSize size);

}  // namespace orbslam

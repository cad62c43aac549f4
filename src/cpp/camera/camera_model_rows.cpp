// SPDX-License-Identifier: BSD-3-Clause
#include "camera/camera_model_rows.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <limits>
#include <sstream>
#include <utility>

#include "base/errors.hpp"

namespace orbslam {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Focal lengths of real cameras differ by less: by the shape of the pixels alone.
constexpr double kLargestAspect = 4;
// A pinhole image of that focal length, in image widths, would have an angle of view of 175
// degrees, and a fisheye image one of several turns.
constexpr double kShortestFocalLength = 0.02;

/// Parameters that may have any finite value.
std::vector<CameraParameter> free_parameters(const std::vector<std::string>& names) {
  std::vector<CameraParameter> parameters;
  parameters.reserve(names.size());
  for (const std::string& name : names) parameters.push_back({name, -kInfinity, kInfinity, true});
  return parameters;
}

CameraModelRow row_of(std::string name, std::vector<std::string> aliases,
                      const std::vector<CameraParameter>& lens,
                      LensModel (*make)(const Pinhole& plane, const double* lens)) {
  std::vector<CameraParameter> all{{"fx", 0, kInfinity, true}, {"fy", 0, kInfinity, true}};
  for (const CameraParameter& one : free_parameters({"cx", "cy"})) all.push_back(one);
  all.insert(all.end(), lens.begin(), lens.end());
  return {std::move(name), std::move(aliases), std::move(all), make};
}

/// OpenCV's model with its first `Count` coefficients.
template <std::size_t Count>
CameraModelRow plane_distortion_row(std::string name, std::vector<std::string> aliases) {
  static const char* const names[] = {"k1", "k2", "p1", "p2", "k3", "k4",
                                      "k5", "k6", "s1", "s2", "s3", "s4"};
  return row_of(std::move(name), std::move(aliases), free_parameters({names, names + Count}),
                [](const Pinhole& plane, const double* lens) -> LensModel {
                  std::array<double, 12> coefficients{};
                  std::copy_n(lens, Count, coefficients.begin());
                  return lens_models::PlaneDistortionLens{plane, PlaneDistortion(coefficients)};
                });
}

CameraModelRow kannala_brandt_row() {
  return row_of("kannala_brandt",
                {"KannalaBrandt8", "kb4", "equidistant", "fisheye", "opencv_fisheye"},
                free_parameters({"k1", "k2", "k3", "k4"}),
                [](const Pinhole& plane, const double* k) -> LensModel {
                  return lens_models::KannalaBrandtLens(plane, {k[0], k[1], k[2], k[3]});
                });
}

CameraModelRow omnidirectional_row() {
  std::vector<CameraParameter> lens{{"xi", 0, kInfinity, false}};
  for (const CameraParameter& one : free_parameters({"k1", "k2", "p1", "p2"})) lens.push_back(one);
  return row_of("mei", {"unified_omnidirectional"}, lens,
                [](const Pinhole& plane, const double* v) -> LensModel {
                  const PlaneDistortion distortion({v[1], v[2], v[3], v[4]});
                  return lens_models::OmnidirectionalLens(plane, v[0], distortion);
                });
}

std::vector<CameraModelRow> make_rows() {
  const CameraParameter alpha{"alpha", 0, 1, false};
  return {
      row_of("pinhole", {}, {},
             [](const Pinhole& plane, const double*) -> LensModel {
               return lens_models::PinholeLens{plane};
             }),
      plane_distortion_row<4>("radtan4", {"radtan", "radial-tangential", "opencv"}),
      plane_distortion_row<5>("radtan5", {"plumb_bob"}),
      plane_distortion_row<8>("rational",
                              {"rational_polynomial", "pinhole-radtan8", "full_opencv"}),
      plane_distortion_row<12>("thin_prism", {}),
      kannala_brandt_row(),
      row_of("double_sphere", {"ds"}, {{"xi", -1, 1, false}, alpha},
             [](const Pinhole& plane, const double* v) -> LensModel {
               return lens_models::DoubleSphereLens(plane, v[0], v[1]);
             }),
      row_of("eucm", {"extended_unified"}, {alpha, {"beta", 0, kInfinity, true}},
             [](const Pinhole& plane, const double* v) -> LensModel {
               return lens_models::ExtendedUnifiedLens(plane, v[0], v[1]);
             }),
      omnidirectional_row(),
      row_of("fov", {"pinhole-fov"}, {{"omega", 0, lens_models::kPi, true}},
             [](const Pinhole& plane, const double* v) -> LensModel {
               return lens_models::FieldOfViewLens(plane, v[0]);
             }),
  };
}

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

std::string number(double value) {
  std::ostringstream text;
  text << value;
  return text.str();
}

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
  return text;
}

std::string parameter_names(const CameraModelRow& row) {
  std::vector<std::string> names;
  for (const CameraParameter& one : row.parameters) names.push_back(one.name);
  return joined(names);
}

const CameraModelRow& find_row(const std::string& name) {
  std::vector<std::string> known;
  for (const CameraModelRow& row : camera_model_rows()) {
    if (lower(row.name) == lower(name)) return row;
    for (const std::string& alias : row.aliases) {
      if (lower(alias) == lower(name)) return row;
    }
    known.push_back(row.name);
  }
  throw SettingsError("there is no camera model '" + name + "'; give one of " + joined(known));
}

/// Begin of a message: the model by the name that was given, and by its own if that is another.
std::string model_called(const std::string& given, const CameraModelRow& row) {
  return "camera model " + given + (given == row.name ? "" : " (" + row.name + ")");
}

/// OpenCV's models differ by the number of coefficients: each begins as the longest one does.
bool is_of_opencv(const CameraModelRow& row) {
  const auto longest = std::find_if(camera_model_rows().begin(), camera_model_rows().end(),
                                    [](const auto& one) { return one.name == "thin_prism"; });
  return std::equal(row.parameters.begin(), row.parameters.end(), longest->parameters.begin(),
                    [](const auto& a, const auto& b) { return a.name == b.name; });
}

void check_count(const std::string& model, const CameraModelRow& row, std::size_t count) {
  if (count == row.parameters.size()) return;
  std::string other;
  for (const CameraModelRow& one : camera_model_rows()) {
    if (one.parameters.size() == count && is_of_opencv(one) && is_of_opencv(row)) {
      other = ", or the model " + one.name + " (" + parameter_names(one) + ")";
    }
  }
  throw SettingsError(model + " has " + std::to_string(row.parameters.size()) +
                      " parameters, got " + std::to_string(count) + "; give " +
                      parameter_names(row) + other);
}

void check_ranges(const std::string& model, const CameraModelRow& row,
                  const std::vector<double>& values) {
  for (std::size_t i = 0; i < values.size(); ++i) {
    const CameraParameter& one = row.parameters[i];
    const double value = values[i];
    const bool inside =
        one.open ? value > one.low && value < one.high : value >= one.low && value <= one.high;
    if (std::isfinite(value) && inside) continue;
    std::string range = "a finite number";
    if (std::isfinite(one.high)) {
      range = "a number from " + number(one.low) + " to " + number(one.high) +
              (one.open ? ", both excluded" : "");
    } else if (std::isfinite(one.low)) {
      range =
          (one.open ? "a finite number above " : "a finite number not below ") + number(one.low);
    }
    throw SettingsError(model + ": " + one.name + " is " + number(value) + "; give " + range +
                        ". The order of the parameters is " + parameter_names(row));
  }
}

/// Focal lengths that only a wrong order or a wrong unit explains.
void check_focal_lengths(const std::string& model, const CameraModelRow& row,
                         const std::vector<double>& values, ImageSize size) {
  const double fx = values[0], fy = values[1];
  if (std::max(fx, fy) > kLargestAspect * std::min(fx, fy)) {
    throw SettingsError(model + ": fx " + number(fx) + " and fy " + number(fy) +
                        " are too different for one lens; give the parameters in the order " +
                        parameter_names(row));
  }
  if (std::max(fx, fy) < kShortestFocalLength * std::max(size.width, size.height)) {
    throw SettingsError(model + ": fx " + number(fx) + " and fy " + number(fy) +
                        " are too short for an image of " + std::to_string(size.width) + "x" +
                        std::to_string(size.height) +
                        " pixels; give focal lengths and principal point in pixels (multiply "
                        "values relative to the image size by its width and height)");
  }
}

}  // namespace

const std::vector<CameraModelRow>& camera_model_rows() {
  static const std::vector<CameraModelRow> rows = make_rows();
  return rows;
}

const CameraModelRow& check_camera_model(const std::string& name,
                                         const std::vector<double>& parameters, ImageSize size) {
  const CameraModelRow& row = find_row(name);
  const std::string model = model_called(name, row);
  check_count(model, row, parameters.size());
  check_ranges(model, row, parameters);
  if (size.width < 1 || size.height < 1) {
    throw SettingsError(model + ": the image size is " + std::to_string(size.width) + "x" +
                        std::to_string(size.height) + "; give width and height in pixels");
  }
  check_focal_lengths(model, row, parameters, size);
  return row;
}

}  // namespace orbslam

// SPDX-License-Identifier: BSD-3-Clause
#include "camera/camera_model_rows.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "base/errors.hpp"
#include "camera/camera_model.hpp"

namespace orbslam {
namespace {

std::string message(const std::string& model, const std::vector<double>& parameters,
                    ImageSize size = {640, 480}) {
  try {
    const CameraModel camera(model, parameters, size);
  } catch (const SettingsError& error) {
    return error.what();
  }
  return "no error";
}

using ::testing::AllOf;
using ::testing::EndsWith;
using ::testing::HasSubstr;

TEST(CameraModelErrors, NameModelParameterAndRemedy) {
  EXPECT_THAT(message("fishy", {}), AllOf(HasSubstr("'fishy'"), HasSubstr("kannala_brandt")));
  EXPECT_THAT(message("KannalaBrandt8", {300, 300, 320, 240, 0.1}),
              AllOf(HasSubstr("KannalaBrandt8 (kannala_brandt) has 8 parameters, got 5"),
                    EndsWith("give fx, fy, cx, cy, k1, k2, k3, k4")));
  EXPECT_THAT(
      message("PinHole", {300, 300, 320, 240, 0.1, 0, 0, 0}),
      EndsWith("give fx, fy, cx, cy, or the model radtan4 (fx, fy, cx, cy, k1, k2, p1, p2)"));
  EXPECT_THAT(message("double_sphere", {300, 300, 320, 240, -1.2, 0.5}),
              AllOf(HasSubstr("double_sphere: xi is -1.2"), HasSubstr("from -1 to 1")));
  EXPECT_THAT(message("eucm", {300, 300, 320, 240, 1.2, 0.5}),
              AllOf(HasSubstr("eucm: alpha is 1.2"), HasSubstr("from 0 to 1")));
  EXPECT_THAT(message("eucm", {300, 300, 320, 240, 0.5, 0}),
              AllOf(HasSubstr("beta is 0"), HasSubstr("above 0")));
  EXPECT_THAT(message("mei", {300, 300, 320, 240, -0.1, 0, 0, 0, 0}),
              AllOf(HasSubstr("xi is -0.1"), HasSubstr("not below 0")));
  EXPECT_THAT(message("fov", {300, 300, 320, 240, 3.2}), HasSubstr("omega is 3.2"));
  EXPECT_THAT(message("pinhole", {-300, 300, 320, 240}),
              AllOf(HasSubstr("fx is -300"), HasSubstr("above 0")));
  EXPECT_THAT(message("pinhole", {300, 300, NAN, 240}),
              AllOf(HasSubstr("cx is nan"), HasSubstr("finite")));
  EXPECT_THAT(message("radtan4", {300, 300, 320, 240, INFINITY, 0, 0, 0}), HasSubstr("k1 is inf"));
  EXPECT_THAT(message("pinhole", {300, 300, 320, 240}, {640, 0}), HasSubstr("640x0"));
}

// xi, fx, fy, cx, cy as Kalibr writes them for this model; and values relative to the image size.
TEST(CameraModelErrors, FocalLengthsInAnotherPlaceOrUnit) {
  EXPECT_THAT(message("mei", {1.2, 460, 459, 365, 249, 0, 0, 0, 0}),
              AllOf(HasSubstr("fx 1.2 and fy 460"), HasSubstr("in the order fx, fy, cx, cy, xi")));
  EXPECT_THAT(message("fov", {0.35, 0.56, 0.5, 0.5, 0.9}), HasSubstr("in pixels"));
}

TEST(CameraModelNames, OtherProgramsNamesGiveTheSameModel) {
  const std::vector<double> parameters{300, 300, 320, 240, 0.1, 0.01, 0, 0};
  const CameraModel camera("kannala_brandt", parameters, {640, 480});
  for (const char* alias : {"KannalaBrandt8", "EQUIDISTANT", "kb4", "OPENCV_FISHEYE"}) {
    EXPECT_TRUE(CameraModel(alias, parameters, {640, 480}) == camera) << alias;
  }
  EXPECT_FALSE(CameraModel("radtan4", parameters, {640, 480}) == camera);
  EXPECT_FALSE(CameraModel("kannala_brandt", parameters, {640, 481}) == camera);
}

}  // namespace
}  // namespace orbslam

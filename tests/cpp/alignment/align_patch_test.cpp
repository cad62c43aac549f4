// SPDX-License-Identifier: BSD-3-Clause
#include "alignment/align_patch.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <limits>

#include "made_up_image.hpp"

namespace orbslam {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using testing::Look;
using testing::picture;
using testing::Texture;

const Vector2d kCentre(32.3, 31.8);  ///< of the reference's keypoint
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

ReferencePatch reference_of(const cv::Mat& image, const Vector2d& at = kCentre) {
  ReferencePatch patch;
  EXPECT_TRUE(cut_patch(image, at, patch));
  return patch;
}

cv::Mat reference_image(const Texture& texture, const Look& look = {}) {
  return picture(
      texture, [](const Vector2d& p) { return p; }, look);
}

/// Shows at `kCentre + shift` what the reference shows at kCentre, mapped by A around there.
cv::Mat moved_image(const Texture& texture, const Matrix2d& A, const Vector2d& shift,
                    const Look& look = {}) {
  const Matrix2d back = A.inverse();
  return picture(
      texture,
      [&](const Vector2d& p) -> Vector2d { return kCentre + back * (p - kCentre - shift); }, look);
}

TEST(AlignPatch, FindsKnownShifts) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const Texture texture(seed, 8);
    const ReferencePatch reference = reference_of(reference_image(texture));
    for (const Vector2d& shift :
         {Vector2d(0, 0), Vector2d(0.5, 0.5), Vector2d(-0.31, 0.77), Vector2d(1.2, -0.9)}) {
      const cv::Mat image = moved_image(texture, Matrix2d::Identity(), shift);
      const PatchAlignment found = align_patch(reference, Matrix2d::Identity(), image, kCentre);
      ASSERT_TRUE(found.ok()) << seed << ", " << shift.transpose();
      EXPECT_LT((found.position - kCentre - shift).norm(), 0.02) << seed << ", " << shift;
      EXPECT_GT(found.correlation, 0.99);
    }
  }
}

TEST(AlignPatch, GainAndOffsetDoNotMatter) {
  const Texture texture(3, 6, 8);
  const ReferencePatch reference = reference_of(reference_image(texture));
  const Vector2d shift(0.6, -0.4);
  for (const auto& [gain, offset] : {std::pair(0.5, 30.0), {1.5, -20.0}, {0.3, 60.0}}) {
    const cv::Mat image = moved_image(texture, Matrix2d::Identity(), shift, {gain, offset, 0, 1});
    const PatchAlignment found = align_patch(reference, Matrix2d::Identity(), image, kCentre);
    ASSERT_TRUE(found.ok());
    EXPECT_LT((found.position - kCentre - shift).norm(), 0.02) << gain;
    EXPECT_NEAR(found.gain, gain, 0.03 * gain);
  }
}

TEST(AlignPatch, WarpTurnsAndScalesThePatch) {
  const Texture texture(4);
  const ReferencePatch reference = reference_of(reference_image(texture));
  const Vector2d shift(-0.45, 0.2);
  for (const auto& [angle, scale] : {std::pair(0.6, 1.0), {3.0, 0.95}, {-1.2, 1.09}, {0.0, 0.95}}) {
    const Matrix2d A = scale * Eigen::Rotation2Dd(angle).toRotationMatrix();
    const cv::Mat image = moved_image(texture, A, shift);
    const PatchAlignment found = align_patch(reference, A, image, kCentre);
    ASSERT_TRUE(found.ok()) << angle << ", " << scale;
    EXPECT_LT((found.position - kCentre - shift).norm(), 0.02) << angle << ", " << scale;
  }
}

/// d^T I d is chi-square distributed with two degrees of freedom: mean 2.
TEST(AlignPatch, InformationFitsTheScatterOfNoise) {
  double sum = 0;
  int n = 0;
  for (unsigned seed = 1; seed <= 200; ++seed) {
    const Texture texture(1 + seed % 10);
    const ReferencePatch reference = reference_of(reference_image(texture, {1, 0, 5, seed}));
    const Vector2d shift(0.1 * (seed % 9) - 0.4, 0.1 * (seed % 7) - 0.3);
    const cv::Mat image = moved_image(texture, Matrix2d::Identity(), shift, {1, 0, 5, 1000 + seed});
    const PatchAlignment found = align_patch(reference, Matrix2d::Identity(), image, kCentre);
    if (!found.ok()) continue;
    const Vector2d error = found.position - kCentre - shift;
    sum += error.dot(found.information * error);
    ++n;
  }
  EXPECT_GT(n, 180);
  EXPECT_GT(sum / n, 1.6);
  EXPECT_LT(sum / n, 2.6);
}

TEST(AlignPatch, FlatPatchesAndEdgesAreRefused) {
  const Texture texture(1);
  const cv::Mat grey = picture(texture, [](const Vector2d&) { return Vector2d(0, 0); });
  const cv::Mat edge = picture(texture, [](const Vector2d& p) { return Vector2d(p.x(), 0); });
  for (const cv::Mat& image : {grey, edge}) {
    const PatchAlignment found =
        align_patch(reference_of(image), Matrix2d::Identity(), image, kCentre);
    EXPECT_EQ(found.failure, AlignmentFailure::kFlat);
  }
}

TEST(AlignPatch, FarShiftsDoNotConverge) {
  const Texture texture(2, 10);
  const ReferencePatch reference = reference_of(reference_image(texture));
  const cv::Mat image = moved_image(texture, Matrix2d::Identity(), {2.5, 0});
  AlignmentOptions options;
  options.max_shift = 2;
  EXPECT_EQ(align_patch(reference, Matrix2d::Identity(), image, kCentre, options).failure,
            AlignmentFailure::kNotConverged);
  options.max_shift = 3;
  EXPECT_TRUE(align_patch(reference, Matrix2d::Identity(), image, kCentre, options).ok());
  options.iterations = 1;
  EXPECT_EQ(align_patch(reference, Matrix2d::Identity(), image, kCentre, options).failure,
            AlignmentFailure::kNotConverged);
}

TEST(AlignPatch, UnlikeImagesHaveALowCorrelation) {
  const Texture texture(1);
  const ReferencePatch reference = reference_of(reference_image(texture));
  const cv::Mat image = reference_image(texture, {1, 0, 40, 1});
  const PatchAlignment found = align_patch(reference, Matrix2d::Identity(), image, kCentre);
  ASSERT_TRUE(found.ok());
  AlignmentOptions options;
  options.min_correlation = found.correlation;
  EXPECT_TRUE(align_patch(reference, Matrix2d::Identity(), image, kCentre, options).ok());
  options.min_correlation += 1e-6;
  EXPECT_EQ(align_patch(reference, Matrix2d::Identity(), image, kCentre, options).failure,
            AlignmentFailure::kLowCorrelation);
  // The negative has the same edges.
  const cv::Mat negative = reference_image(texture, {-1, 0, 0, 1});
  EXPECT_FALSE(align_patch(reference, Matrix2d::Identity(), negative, kCentre).ok());
}

TEST(AlignPatch, BordersAndBadNumbersAreOutside) {
  const Texture texture(1);
  const cv::Mat image = reference_image(texture);
  const ReferencePatch reference = reference_of(image);
  const Matrix2d I = Matrix2d::Identity();
  for (const Vector2d& start : {Vector2d(2, 30), Vector2d(30, 60.5), Vector2d(-5, 3),
                                Vector2d(1e9, 30), Vector2d(kNan, 30)}) {
    EXPECT_EQ(align_patch(reference, I, image, start).failure, AlignmentFailure::kOutside);
  }
  Matrix2d nan = I, singular = I, large = 0.3 * I;
  nan(0, 1) = kNan;
  singular(1, 1) = 0;
  for (const Matrix2d& A : {nan, singular, large}) {
    EXPECT_EQ(align_patch(reference, A, image, kCentre).failure, AlignmentFailure::kOutside);
  }
  EXPECT_EQ(align_patch(reference, I, cv::Mat(), kCentre).failure, AlignmentFailure::kOutside);
}

/// Near the border the window holds pixels that are not in the image; they are not used.
TEST(AlignPatch, WorksNearTheBorder) {
  const Texture texture(6);
  const cv::Mat image = reference_image(texture);
  for (const Vector2d& at : {Vector2d(14.2, 20.6), Vector2d(20.1, 49.8)}) {
    const ReferencePatch reference = reference_of(image, at);
    const Vector2d corner =
        at.y() < 32 ? Vector2d(at.x() - 9.6, at.y() - 15.4) : Vector2d(at.x() - 15.1, at.y() + 8.4);
    const Vector2d move = corner - at;
    const cv::Mat moved = picture(texture, [&](const Vector2d& p) -> Vector2d { return p - move; });
    const PatchAlignment found =
        align_patch(reference, Matrix2d::Identity(), moved, corner + Vector2d(0.6, -0.5));
    ASSERT_TRUE(found.ok()) << corner;
    EXPECT_LT((found.position - corner).norm(), 0.03) << corner;
  }
}

TEST(AlignPatch, RepeatedRunsGiveTheSameBytes) {
  const Texture texture(5);
  const ReferencePatch reference = reference_of(reference_image(texture, {1, 0, 3, 1}));
  const cv::Mat image = moved_image(texture, Matrix2d::Identity(), {0.7, -0.2}, {1, 0, 3, 2});
  const PatchAlignment first = align_patch(reference, Matrix2d::Identity(), image, kCentre);
  for (int i = 0; i < 5; ++i) {
    const cv::Mat copy = image.clone();
    const PatchAlignment again = align_patch(reference, Matrix2d::Identity(), copy, kCentre);
    EXPECT_EQ(std::memcmp(&first.position, &again.position, sizeof(first.position)), 0);
    EXPECT_EQ(std::memcmp(&first.information, &again.information, sizeof(first.information)), 0);
    EXPECT_EQ(first.correlation, again.correlation);
  }
}

TEST(CutPatch, KeepsTheDistanceToTheBorder) {
  const cv::Mat image = reference_image(Texture(1));
  ReferencePatch patch;
  for (const Vector2d& good : {Vector2d(13, 13), Vector2d(50, 50), Vector2d(13, 50)}) {
    EXPECT_TRUE(cut_patch(image, good, patch)) << good;
  }
  for (const Vector2d& bad :
       {Vector2d(12.9, 30), Vector2d(30, 50.1), Vector2d(kNan, 30), Vector2d(30, -1e12)}) {
    EXPECT_FALSE(cut_patch(image, bad, patch)) << bad;
  }
  EXPECT_FALSE(cut_patch(cv::Mat(), {0, 0}, patch));
}

TEST(CutPatch, SmoothsWithTheBinomialFilter) {
  cv::Mat image(64, 64, CV_8UC1, cv::Scalar(0));
  image.at<std::uint8_t>(30, 33) = 100;
  ReferencePatch patch;
  ASSERT_TRUE(cut_patch(image, {32.25, 31.5}, patch));
  EXPECT_EQ(patch.fraction, Eigen::Vector2f(0.25F, -0.5F));
  const auto at = [&](int dy, int dx) {  // around the pixel nearest to the keypoint: (32, 32)
    return patch.values[static_cast<std::size_t>(ReferencePatch::kCentre + dy)]
                       [static_cast<std::size_t>(ReferencePatch::kCentre + dx)];
  };
  EXPECT_EQ(at(-2, 1), 400);
  EXPECT_EQ(at(-2, 0), 200);
  EXPECT_EQ(at(-3, 2), 100);
  EXPECT_EQ(at(0, 0), 0);
}

}  // namespace
}  // namespace orbslam

// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/sighting_alignment.hpp"

#include <gtest/gtest.h>

#include <numeric>

#include "alignment/made_up_image.hpp"
#include "base/errors.hpp"
#include "support/synthetic_frames.hpp"

namespace orbslam::testing {
namespace {

/// Stereo keyframes before a textured wall; their keypoints scatter by up to 0.7 pixels.
class Wall {
 public:
  static constexpr double kDistance = 3;
  static constexpr int kKeyframes = 4;

  Map map;
  std::vector<Pose> truth;
  std::vector<cv::Mat> left, right;

  Wall() {
    CameraOptions options;
    options.pinhole = {200, 200, 100, 75};
    options.image_size = {200, 150};
    options.bf = 20;
    options.depth_ratio = 40;
    camera_ = std::make_shared<const Camera>(options);
    const PointCloud cloud = make_point_cloud(150, 1, kDistance, kDistance, 1);
    std::mt19937_64 random(2);
    std::vector<MapPointId> points(cloud.positions.size());
    for (int k = 0; k < kKeyframes; ++k) add_keyframe(k, cloud, points, random);
    for (int k = 0; k < kKeyframes; ++k) map.update_connections(KeyFrameId(k));
    for (const MapPointId id : points) {
      if (id.valid()) map.update_point(id);
    }
  }

  double largest_error() const {
    double largest = 0;
    map.for_each_keyframe([&](const KeyFrame& keyframe) {
      const Pose& T_cw = truth[static_cast<std::size_t>(keyframe.id.value)];
      largest = std::max(largest, (keyframe.center() - T_cw.center()).norm());
    });
    return largest;
  }

  /// Patches and some rounds; without right images if so wanted.
  void align(SightingAlignment& alignment, int rounds, bool with_right = true) const {
    for (int k = 0; k < kKeyframes; ++k) alignment.take_references(KeyFrameId(k), left_of(k));
    for (int i = 0; i < rounds; ++i) {
      alignment.begin_round();
      for (int k = 0; k < kKeyframes; ++k) {
        const cv::Mat& other = right[static_cast<std::size_t>(k)];
        alignment.align(KeyFrameId(k), left_of(k), with_right ? other : cv::Mat());
      }
      alignment.weigh();
      alignment.solve({}, nullptr, 1);
    }
  }

 private:
  const cv::Mat& left_of(int k) const { return left[static_cast<std::size_t>(k)]; }

  /// Rendered once for all tests: the worlds are equal.
  cv::Mat view(int number, const Pose& T_cw) const {
    static std::vector<cv::Mat> kept(2 * kKeyframes);
    cv::Mat& image = kept[static_cast<std::size_t>(number)];
    if (image.empty()) image = render(T_cw);
    return image;
  }

  cv::Mat render(const Pose& T_cw) const {
    const Pose T_wc = T_cw.inverse();
    const ImageSize size = camera_->image_size();
    return picture(texture_,
                   [&](const Eigen::Vector2d& p) -> Eigen::Vector2d {
                     const Eigen::Vector3d ray = T_wc.rotation() * camera_->ray(p.x(), p.y());
                     const Eigen::Vector3d at =
                         T_wc.translation() + (kDistance - T_wc.translation().z()) / ray.z() * ray;
                     return 70 * at.head<2>();
                   },
                   {}, {size.width, size.height});
  }

  void add_keyframe(int k, const PointCloud& cloud, std::vector<MapPointId>& points,
                    std::mt19937_64& random) {
    const Pose T_cw(Eigen::Quaterniond(Eigen::AngleAxisd(0.02 * k, Eigen::Vector3d::UnitZ())),
                    Eigen::Vector3d(-0.1 * k, 0.03 * k, 0.08 * k));
    truth.push_back(T_cw);
    left.push_back(view(2 * k, T_cw));
    right.push_back(
        view(2 * k + 1, Pose(Eigen::Matrix3d::Identity(), {-camera_->baseline(), 0, 0}) * T_cw));
    ProjectionOptions noisy;
    noisy.pixel_noise = 0.7;
    noisy.seed = static_cast<std::uint64_t>(k) + 5;
    const ProjectedFrame seen = project_cloud(k, cloud, T_cw, noisy, camera_);
    const KeyFrameId id = map.add_keyframe(seen.frame, T_cw);
    for (std::size_t i = 0; i < seen.points.size(); ++i) {
      MapPointId& point = points[seen.points[i]];
      const double wrong = uniform(random, -0.02, 0.02);
      const Eigen::Vector3d at = cloud.positions[seen.points[i]] + Eigen::Vector3d(0, 0, wrong);
      if (!point.valid()) point = map.add_point(at, id, 0);
      map.add_observation(point, id, i);
    }
    map.publish(id);
  }

  Texture texture_{7};
  std::shared_ptr<const Camera> camera_;
};

TEST(SightingAlignment, SightingsAgreeAfterwards) {
  Wall wall;
  SightingAlignment alignment(wall.map);
  const double before = alignment.median_error();
  wall.align(alignment, 2);
  EXPECT_LT(alignment.median_error(), 0.1);
  EXPECT_GT(before, 0.3);
  ASSERT_TRUE(alignment.commit(wall.map).committed);
  EXPECT_LT(wall.largest_error(), 2e-3);

  const AlignmentCounts counts = alignment.counts();
  const std::size_t n_sightings = alignment.bundle().problem.observations.size();
  const std::size_t n_tried = std::accumulate(counts.begin(), counts.end(), std::size_t{0});
  EXPECT_LE(n_tried, n_sightings - alignment.bundle().points.size());
  EXPECT_GT(counts[0], n_tried * 8 / 10);
  EXPECT_GT(alignment.right_counts()[0], counts[0]);  // those of references, too
  EXPECT_GT(alignment.noise().deviation, 0);
  EXPECT_LT(alignment.noise().deviation, 0.2);
}

/// The same without images: corners that scatter give worse poses.
TEST(SightingAlignment, PosesAreBetterThanThoseOfCorners) {
  Wall corners, aligned;
  SightingAlignment none(corners.map);
  none.solve({}, nullptr, 1);
  ASSERT_TRUE(none.commit(corners.map).committed);
  SightingAlignment alignment(aligned.map);
  aligned.align(alignment, 2, false);
  ASSERT_TRUE(alignment.commit(aligned.map).committed);
  EXPECT_LT(aligned.largest_error(), 0.5 * corners.largest_error());
}

TEST(SightingAlignment, DisparitiesStayWithoutRightImages) {
  Wall wall;
  SightingAlignment alignment(wall.map);
  const std::vector<BundleProblem::Observation> before = alignment.bundle().problem.observations;
  wall.align(alignment, 1, false);
  const auto& after = alignment.bundle().problem.observations;
  std::size_t n_moved = 0;
  for (std::size_t i = 0; i < before.size(); ++i) {
    EXPECT_NEAR(after[i].u - after[i].right_u, before[i].u - before[i].right_u, 1e-4);
    // The weight of the right column is what it was.
    EXPECT_NEAR(after[i].inverse_sigma2 * after[i].right_factor, before[i].inverse_sigma2, 1e-4);
    n_moved += after[i].u != before[i].u ? 1 : 0;
  }
  EXPECT_EQ(n_moved, alignment.counts()[0]);
}

TEST(SightingAlignment, RepeatedRunsGiveTheSameBytes) {
  Wall first, second;
  for (Wall* wall : {&first, &second}) {
    SightingAlignment alignment(wall->map);
    wall->align(alignment, 1);
    ASSERT_TRUE(alignment.commit(wall->map).committed);
  }
  EXPECT_EQ(first.largest_error(), second.largest_error());
}

TEST(SightingAlignment, ImagesOfAnotherSizeAreRefused) {
  Wall wall;
  SightingAlignment alignment(wall.map);
  const cv::Mat small = wall.left[0](cv::Rect(0, 0, 100, 100));
  EXPECT_THROW(alignment.take_references(KeyFrameId(0), small), ImageError);
  EXPECT_THROW(alignment.align(KeyFrameId(0), wall.left[0], small), ImageError);
  EXPECT_THROW(alignment.align(KeyFrameId(0), cv::Mat(), cv::Mat()), ImageError);
  EXPECT_THROW(alignment.take_references(KeyFrameId(99), wall.left[0]), StateError);
}

}  // namespace
}  // namespace orbslam::testing

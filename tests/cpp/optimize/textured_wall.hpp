// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <memory>
#include <vector>

#include "alignment/made_up_image.hpp"
#include "optimize/sighting_alignment.hpp"
#include "support/synthetic_frames.hpp"

namespace orbslam::testing {

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
    const auto frame = std::make_shared<Frame>(*seen.frame);
    frame->images = std::make_shared<FrameImages>(FrameImages::Pyramids{
        build_pyramid(left.back(), *frame->scales), build_pyramid(right.back(), *frame->scales)});
    const KeyFrameId id = map.add_keyframe(frame, T_cw);
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

}  // namespace orbslam::testing

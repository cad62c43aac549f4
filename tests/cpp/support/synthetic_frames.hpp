// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstdint>
#include <memory>
#include <random>
#include <vector>

#include "frame/frame.hpp"
#include "support/random_numbers.hpp"

/// Frames without images: keypoints, depths and descriptors are given or projected from points.
/// Header only; link orbslam_frame.
namespace orbslam::testing {

/// One keypoint of a frame to be made, already undistorted.
struct FeatureSpec {
  float u = 0, v = 0;
  float depth = -1;  ///< metres, -1: unknown
  std::int32_t level = 0;
  Descriptor descriptor{};
  float angle = 0;  ///< degrees
};

/// 640x480, fx = fy = 400, principal point (320, 240). bf = 40 gives a baseline of 0.1 m and, with
/// a depth ratio of 40, a close/far limit of 4 m. bf = 0: a single camera.
inline std::shared_ptr<const Camera> synthetic_camera(double bf = 40, double depth_ratio = 40) {
  CameraOptions options;
  options.pinhole = {400, 400, 320, 240};
  options.bf = bf;
  options.depth_ratio = depth_ratio;
  options.image_size = {640, 480};
  return std::make_shared<Camera>(options);
}

/// 8 levels with factor 1.2.
inline std::shared_ptr<const ScalePyramid> synthetic_scales() {
  static const auto scales = std::make_shared<const ScalePyramid>(1.2F, 8);
  return scales;
}

inline Descriptor random_descriptor(std::mt19937_64& random) {
  Descriptor descriptor;
  for (auto& word : descriptor.words) word = random();
  return descriptor;
}

/// The descriptor with exactly `n` different bits flipped, n <= 256.
inline Descriptor flip_bits(const Descriptor& original, int n, std::mt19937_64& random) {
  Descriptor descriptor = original, flipped{};
  while (n > 0) {
    const std::size_t bit = uniform_index(random, 256);
    const std::uint64_t mask = std::uint64_t{1} << (bit % 64);
    if (flipped.words[bit / 64] & mask) continue;
    flipped.words[bit / 64] |= mask;
    descriptor.words[bit / 64] ^= mask;
    --n;
  }
  return descriptor;
}

/// A descriptor whose first n bits are set: two of them differ in |n - m| bits.
inline Descriptor thermometer_descriptor(int n) {
  Descriptor descriptor;
  for (int bit = 0; bit < n; ++bit) {
    descriptor.words[static_cast<std::size_t>(bit / 64)] |= std::uint64_t{1} << (bit % 64);
  }
  return descriptor;
}

/// A frame with its grid; right columns follow from the depths. No words.
inline std::shared_ptr<Frame> make_synthetic_frame(
    FrameId id, const std::vector<FeatureSpec>& features,
    std::shared_ptr<const Camera> camera = synthetic_camera(),
    std::shared_ptr<const ScalePyramid> scales = synthetic_scales()) {
  auto frame = std::make_shared<Frame>();
  frame->id = id;
  frame->timestamp = static_cast<double>(id) / 30.0;
  frame->camera = std::move(camera);
  frame->scales = std::move(scales);
  for (const FeatureSpec& feature : features) {
    Keypoint keypoint;
    keypoint.x = feature.u;
    keypoint.y = feature.v;
    keypoint.size = 31.0F * frame->scales->scale(feature.level);
    keypoint.angle = feature.angle;
    keypoint.response = 20;
    keypoint.level = feature.level;
    frame->keypoints.push_back(keypoint);
    frame->descriptors.push_back(feature.descriptor);
    const bool has_depth = feature.depth > 0;
    frame->depth.push_back(has_depth ? feature.depth : -1.0F);
    frame->right_u.push_back(
        has_depth ? static_cast<float>(frame->camera->right_column(feature.u, feature.depth))
                  : -1.0F);
  }
  frame->grid = KeypointGrid(frame->keypoints, frame->camera->bounds());
  return frame;
}

/// A frame of n keypoints on a raster over the image, all with the same depth and level and with
/// random descriptors: for tests that only need slots.
inline std::shared_ptr<Frame> make_raster_frame(
    FrameId id, std::size_t n, float depth = -1, std::int32_t level = 0,
    std::shared_ptr<const Camera> camera = synthetic_camera(), std::uint64_t seed = 0) {
  std::mt19937_64 random(seed);
  const auto columns = static_cast<std::size_t>(std::ceil(std::sqrt(static_cast<double>(n))));
  std::vector<FeatureSpec> features(n);
  for (std::size_t i = 0; i < n; ++i) {
    const double step = static_cast<double>(columns);
    features[i].u = static_cast<float>(10 + 620 * static_cast<double>(i % columns) / step);
    features[i].v = static_cast<float>(10 + 460 * static_cast<double>(i / columns) / step);
    features[i].depth = depth;
    features[i].level = level;
    features[i].descriptor = random_descriptor(random);
  }
  return make_synthetic_frame(id, features, std::move(camera));
}

/// Points in space with descriptors, to be seen by several frames.
struct PointCloud {
  std::vector<Eigen::Vector3d> positions;
  std::vector<Descriptor> descriptors;
};

/// n points in the box x, y in [-half_width, half_width], z in [near, far].
inline PointCloud make_point_cloud(std::size_t n, double half_width, double near, double far,
                                   std::uint64_t seed) {
  std::mt19937_64 random(seed);
  PointCloud cloud;
  for (std::size_t i = 0; i < n; ++i) {
    const double x = uniform(random, -half_width, half_width);
    const double y = uniform(random, -half_width, half_width);
    cloud.positions.emplace_back(x, y, uniform(random, near, far));
    cloud.descriptors.push_back(random_descriptor(random));
  }
  return cloud;
}

struct ProjectionOptions {
  bool with_depth = true;
  double pixel_noise = 0;        ///< half width of a uniform error [pixels]
  int flipped_bits = 0;          ///< per descriptor
  std::int32_t level = 0;        ///< of all keypoints
  std::size_t max_features = 0;  ///< 0: all visible points
  std::uint64_t seed = 1;
};

struct ProjectedFrame {
  std::shared_ptr<Frame> frame;
  std::vector<std::size_t> points;  ///< per keypoint: index of the point in the cloud
};

/// The points of the cloud that lie in front of the camera and inside the image, in cloud order.
inline ProjectedFrame project_cloud(FrameId id, const PointCloud& cloud, const Pose& T_cw,
                                    const ProjectionOptions& options = {},
                                    std::shared_ptr<const Camera> camera = synthetic_camera()) {
  std::mt19937_64 random(options.seed);
  std::vector<FeatureSpec> features;
  ProjectedFrame result;
  for (std::size_t i = 0; i < cloud.positions.size(); ++i) {
    if (options.max_features > 0 && features.size() == options.max_features) break;
    const Eigen::Vector3d p_c = T_cw * cloud.positions[i];
    if (p_c.z() <= 0) continue;
    const Eigen::Vector2d uv = camera->pinhole().project(p_c);
    if (!camera->bounds().contains_half_open(uv.x(), uv.y())) continue;
    FeatureSpec feature;
    const double noise = options.pixel_noise;
    feature.u = static_cast<float>(uv.x() + uniform(random, -noise, noise));
    feature.v = static_cast<float>(uv.y() + uniform(random, -noise, noise));
    feature.depth = options.with_depth ? static_cast<float>(p_c.z()) : -1.0F;
    feature.level = options.level;
    feature.descriptor = flip_bits(cloud.descriptors[i], options.flipped_bits, random);
    features.push_back(feature);
    result.points.push_back(i);
  }
  result.frame = make_synthetic_frame(id, features, std::move(camera));
  return result;
}

}  // namespace orbslam::testing

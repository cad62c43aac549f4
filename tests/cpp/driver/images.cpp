// SPDX-License-Identifier: BSD-3-Clause
#include "driver/images.hpp"

#include <cmath>

#include "places/vocabulary_training.hpp"
#include "synthetic/world.hpp"

namespace orbslam::driver {
namespace {

constexpr double kPi = 3.14159265358979323846;

OrbOptions orb_options() {
  OrbOptions orb;
  orb.n_features = 500;
  orb.n_levels = 6;
  return orb;
}

synthetic::RenderOptions view_options() {
  synthetic::RenderOptions view;
  view.fx = view.fy = 200;
  view.cx = 120;
  view.cy = 90;
  view.size = {240, 180};
  view.noise = 2;
  return view;
}

FrameContext context_for(const synthetic::RenderOptions& view, const OrbExtractor& extractor) {
  CameraOptions camera;
  camera.pinhole = {view.fx, view.fy, view.cx, view.cy};
  camera.bf = 0.08 * view.fx;
  camera.depth_ratio = 60;
  camera.image_size = view.size;
  return {std::make_shared<Camera>(camera), std::make_shared<ScalePyramid>(extractor.scales())};
}

/// Turning steadily on the spot, the camera held at arm's length. `turn` in radians.
Pose T_wc_at(double turn) {
  const Eigen::Quaterniond heading(Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitY()));
  const Eigen::Vector3d arm(0, 0.1 * std::sin(3 * turn), 0.8);
  return Pose(heading, heading * arm);
}

}  // namespace

ImageRing::ImageRing(int frames_per_lap, std::uint64_t seed) : extractor_(orb_options()) {
  synthetic::RenderOptions options = view_options();
  context_ = context_for(options, extractor_);
  const Eigen::Vector3d room(7, 3, 6);
  const synthetic::World world = synthetic::make_room(room, seed, 6);
  TrainingSet descriptors;
  for (int i = 0; i < frames_per_lap; ++i) {
    options.noise_seed = static_cast<std::uint64_t>(i);
    const Pose T_wc = T_wc_at(2 * kPi * i / frames_per_lap);
    const synthetic::Rendering image = synthetic::render(world, T_wc.inverse(), options);
    views_.push_back({image.grey, image.depth, extractor_.extract(image.grey).features});
    const Features& features = views_.back().features;
    descriptors.descriptors.insert(descriptors.descriptors.end(), features.descriptors.begin(),
                                   features.descriptors.end());
    descriptors.image_ends.push_back(descriptors.descriptors.size());
  }
  dark_ = {cv::Mat::zeros(views_[0].grey.size(), CV_8UC1),
           cv::Mat::zeros(views_[0].depth.size(), CV_32FC1),
           {}};
  TrainingOptions training;
  training.branching = 9;
  training.depth = 3;
  training.seed = seed;
  training.max_iterations = 5;
  training.n_threads = 1;
  vocabulary_ = train_vocabulary(descriptors, training);
}

std::shared_ptr<Frame> ImageRing::frame(std::int64_t view, FrameId id, double timestamp,
                                        double depth_factor) {
  const View& shown = views_[static_cast<std::size_t>(view % size())];
  cv::Mat depth;
  shown.depth.convertTo(depth, CV_32FC1, depth_factor);
  // Extraction is slow under a sanitizer and has no partners: now and then is enough.
  if (id % 8 != 0) return build(shown.features, depth, id, timestamp);
  return build(extractor_.extract(shown.grey).features, depth, id, timestamp);
}

std::shared_ptr<Frame> ImageRing::dark_frame(FrameId id, double timestamp) {
  return build(dark_.features, dark_.depth, id, timestamp);
}

std::shared_ptr<Frame> ImageRing::build(const Features& features, const cv::Mat& depth, FrameId id,
                                        double timestamp) const {
  auto frame = build_rgbd_frame(context_, id, timestamp, features, depth);
  describe(*frame, *vocabulary_);
  return frame;
}

}  // namespace orbslam::driver

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

/// Goes on from a hash with more bytes: FNV-1a.
std::uint64_t hash_bytes(std::uint64_t hash, const void* bytes, std::size_t n) {
  const auto* at = static_cast<const std::uint8_t*>(bytes);
  for (std::size_t i = 0; i < n; ++i) hash = (hash ^ at[i]) * 0x100000001b3ULL;
  return hash;
}

std::uint64_t hash_image(std::uint64_t hash, const cv::Mat& image) {
  const std::size_t n = image.elemSize() * static_cast<std::size_t>(image.cols);
  for (int row = 0; row < image.rows; ++row) hash = hash_bytes(hash, image.ptr(row), n);
  return hash;
}
constexpr std::uint64_t kHashOfNothing = 0xcbf29ce484222325ULL;

}  // namespace

Pose ImageRing::T_wc(std::int64_t view, int frames_per_lap) {
  const double turn = 2 * kPi * static_cast<double>(view) / frames_per_lap;
  const Eigen::Quaterniond heading(Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitY()));
  const Eigen::Vector3d arm(0, 0.1 * std::sin(3 * turn), 0.8);
  return Pose(heading, heading * arm);
}

ImageRing::ImageRing(int frames_per_lap, std::uint64_t seed) : extractor_(orb_options()) {
  synthetic::RenderOptions options = view_options();
  context_ = context_for(options, extractor_);
  const Eigen::Vector3d room(7, 3, 6);
  const synthetic::World world = synthetic::make_room(room, seed, 6);
  TrainingSet descriptors;
  for (int i = 0; i < frames_per_lap; ++i) {
    options.noise_seed = static_cast<std::uint64_t>(i);
    const Pose T_cw = T_wc(i, frames_per_lap).inverse();
    const synthetic::Rendering image = synthetic::render(world, T_cw, options);
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

std::uint64_t ImageRing::grey_hash() const {
  std::uint64_t hash = kHashOfNothing;
  for (const View& view : views_) hash = hash_image(hash, view.grey);
  return hash;
}

std::uint64_t ImageRing::depth_hash() const {
  std::uint64_t hash = kHashOfNothing;
  for (const View& view : views_) hash = hash_image(hash, view.depth);
  return hash;
}

std::uint64_t ImageRing::feature_hash() const {
  std::uint64_t hash = kHashOfNothing;
  for (const View& view : views_) {
    const Features& found = view.features;
    hash = hash_bytes(hash, found.keypoints.data(), found.size() * sizeof(Keypoint));
    hash = hash_bytes(hash, found.descriptors.data(), found.size() * sizeof(Descriptor));
  }
  return hash;
}

std::shared_ptr<Frame> ImageRing::build(const Features& features, const cv::Mat& depth, FrameId id,
                                        double timestamp) const {
  auto frame = build_rgbd_frame(context_, id, timestamp, features, depth);
  describe(*frame, *vocabulary_);
  return frame;
}

}  // namespace orbslam::driver

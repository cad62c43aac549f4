// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/sighting_alignment.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/errors.hpp"
#include "base/parallel.hpp"

namespace orbslam {
namespace {

/// Median of a chi-square distribution with one degree of freedom.
constexpr double kMedianOfOne = 0.4549364;
/// Observations that a thread takes at a time.
constexpr std::size_t kChunk = 64;

double median(std::vector<double>& values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

void check_image(const cv::Mat& image, const Camera& camera, KeyFrameId keyframe,
                 const char* which) {
  const ImageSize size = camera.image_size();
  if (image.type() == CV_8UC1 && image.cols == size.width && image.rows == size.height) return;
  throw ImageError(std::string(which) + " of keyframe " + std::to_string(keyframe.value) + " has " +
                   std::to_string(image.cols) + " x " + std::to_string(image.rows) +
                   " pixels, but its camera has " + std::to_string(size.width) + " x " +
                   std::to_string(size.height) +
                   "; give the 8-bit grey images that the map was made of");
}

}  // namespace

SightingAlignment::SightingAlignment(const Map& map, MapIndex which, AlignmentOptions options)
    : bundle_(gather_full_bundle(map, which)), options_(options) {
  {
    const auto lock = map.read_lock();
    for (const KeyFrameId id : bundle_.keyframes) frames_.push_back(map.find(id)->frame);
  }
  const auto& observations = bundle_.problem.observations;
  seen_by_.resize(frames_.size());
  points_.resize(bundle_.points.size());
  sightings_.resize(observations.size());
  for (std::size_t begin = 0, end = 0; begin < observations.size(); begin = end) {
    const std::uint32_t point = observations[begin].point;
    while (end < observations.size() && observations[end].point == point) ++end;
    points_[point].reference = static_cast<std::uint32_t>((begin + end) / 2);
  }
  for (std::size_t i = 0; i < observations.size(); ++i) {
    const auto& o = observations[i];
    seen_by_[o.camera].push_back(static_cast<std::uint32_t>(i));
    sightings_[i].u = o.u;
    sightings_[i].v = o.v;
    sightings_[i].right_u = o.right_u;
    sightings_[i].inverse_sigma2 = o.inverse_sigma2;
  }
}

std::uint32_t SightingAlignment::camera_of(KeyFrameId keyframe) const {
  const auto found = bundle_.camera_of.find(keyframe);
  if (found != bundle_.camera_of.end()) return found->second;
  throw StateError("keyframe " + std::to_string(keyframe.value) + " is not part of the bundle");
}

Eigen::Vector2f SightingAlignment::raw_of(std::size_t observation) const {
  return raw_pixel(frame_of(bundle_.problem.observations[observation]),
                   bundle_.keypoints[observation]);
}

void SightingAlignment::take_references(KeyFrameId keyframe, const cv::Mat& grey) {
  const std::uint32_t camera = camera_of(keyframe);
  const Frame& frame = *frames_[camera];
  check_image(grey, *frame.camera, keyframe, "the image");
  const ImagePyramid images = build_pyramid(grey, *frame.scales);
  for (const std::uint32_t i : seen_by_[camera]) {
    Point& point = points_[bundle_.problem.observations[i].point];
    if (point.reference != i) continue;
    point.has_patch = cut_patch_at(frame, bundle_.keypoints[i], images, point.patch);
  }
}

void SightingAlignment::begin_round() {
  const BundleProblem& problem = bundle_.problem;
  for (Sighting& sighting : sightings_) sighting.left = sighting.right = Match();
  for_each_in_parallel(points_.size(), threads_for(4), [&](std::size_t k) {
    Point& point = points_[k];
    if (!point.has_patch) return;
    const auto& o = problem.observations[point.reference];
    const Pose& T_cw = problem.cameras[o.camera].T_cw;
    const Eigen::Vector3d p_c = T_cw * problem.points[k];
    const Camera& camera = *frame_of(o).camera;
    point.surface = parallel_patch(camera, T_cw.inverse(), raw_of(point.reference).cast<double>(),
                                   camera.is_flat() ? p_c.z() : p_c.norm());
  });
}

void SightingAlignment::align(KeyFrameId keyframe, const cv::Mat& grey, const cv::Mat& right) {
  const std::uint32_t camera = camera_of(keyframe);
  const Frame& frame = *frames_[camera];
  check_image(grey, *frame.camera, keyframe, "the image");
  Pyramids images{build_pyramid(grey, *frame.scales), {}};
  if (!right.empty()) {
    check_image(right, *frame.camera, keyframe, "the right image");
    images.right = build_pyramid(right, *frame.scales);
  }
  const std::vector<std::uint32_t>& seen = seen_by_[camera];
  const std::size_t n_chunks = (seen.size() + kChunk - 1) / kChunk;
  for_each_in_parallel(n_chunks, threads_for(4), [&](std::size_t chunk) {
    const std::size_t end = std::min(seen.size(), (chunk + 1) * kChunk);
    for (std::size_t k = chunk * kChunk; k < end; ++k) align_one(seen[k], images);
  });
}

void SightingAlignment::align_one(std::size_t observation, const Pyramids& images) {
  const auto& o = bundle_.problem.observations[observation];
  const Point& point = points_[o.point];
  if (!point.has_patch) return;
  const Frame& frame = frame_of(o);
  const Pose& T_cw = bundle_.problem.cameras[o.camera].T_cw;
  Sighting& sighting = sightings_[observation];
  const Eigen::Vector2f start = raw_of(observation);
  if (point.reference != observation) {
    sighting.left = match(point, frame, T_cw, images.left, start);
  }
  // Raw and undistorted pixels of a rectified pair are equal. The right camera of a fisheye pair is
  // not known here.
  if (images.right.levels.empty() || !o.has_depth || !frame.camera->is_pinhole()) return;
  const Pose T_rc(Eigen::Matrix3d::Identity(), {-frame.camera->baseline(), 0, 0});
  sighting.right = match(point, frame, T_rc * T_cw, images.right, {sighting.right_u, start.y()});
}

SightingAlignment::Match SightingAlignment::match(const Point& point, const Frame& frame,
                                                  const Pose& T_cw, const ImagePyramid& images,
                                                  const Eigen::Vector2f& start) const {
  Match result;
  result.tried = true;
  if (!point.surface) return result;
  const Frame& from = frame_of(bundle_.problem.observations[point.reference]);
  const int level = from.keypoints[bundle_.keypoints[point.reference]].level;
  static_cast<FoundPatch&>(result) =
      find_patch({&point.patch, from.camera.get(), from.scales.get(), level, *point.surface}, frame,
                 T_cw, images, start, options_);
  return result;
}

AlignmentCounts SightingAlignment::count(Match Sighting::*which) const {
  AlignmentCounts counts{};
  for (const Sighting& sighting : sightings_) {
    const Match& match = sighting.*which;
    if (match.tried) ++counts[static_cast<std::size_t>(match.failure)];
  }
  return counts;
}

/// By the median over the sightings, so that wrong ones do not count.
AlignmentNoise SightingAlignment::measure_noise(Match Sighting::*which) const {
  const BundleProblem& problem = bundle_.problem;
  const bool is_right = which == &Sighting::right;
  std::vector<double> squares, deviations;
  for (std::size_t i = 0; i < sightings_.size(); ++i) {
    const Match& match = sightings_[i].*which;
    const auto& o = problem.observations[i];
    const Camera& camera = *problem.cameras[o.camera].model;
    const Eigen::Vector3d p = problem.cameras[o.camera].T_cw * problem.points[o.point];
    Eigen::Vector2d seen;
    if (!match.ok() || !camera.project(p, seen)) continue;
    const double variance = match.variance;
    deviations.push_back(std::sqrt(variance) / match.level_scale);
    if (is_right) {
      const double error = match.u - camera.right_column(seen.x(), p.z());
      squares.push_back(error * error / variance);
    } else {
      squares.push_back((match.u - seen.x()) * (match.u - seen.x()) / variance);
      squares.push_back((match.v - seen.y()) * (match.v - seen.y()) / variance);
    }
  }
  AlignmentNoise noise;
  if (squares.empty()) return noise;
  noise.factor = std::sqrt(median(squares) / kMedianOfOne);
  noise.deviation = noise.factor * median(deviations);
  return noise;
}

void SightingAlignment::weigh() {
  noise_ = measure_noise(&Sighting::left);
  right_noise_ = measure_noise(&Sighting::right);
  auto& observations = bundle_.problem.observations;
  const auto weight = [](const AlignmentNoise& noise, float variance) {
    return static_cast<float>(1 / (noise.factor * noise.factor * static_cast<double>(variance)));
  };
  for (std::size_t begin = 0, end = 0; begin < observations.size(); begin = end) {
    const std::uint32_t point = observations[begin].point;
    double sum = 0;
    int n = 0;
    for (; end < observations.size() && observations[end].point == point; ++end) {
      auto& o = observations[end];
      const Sighting& was = sightings_[end];
      o.u = was.u;
      o.v = was.v;
      o.right_u = was.right_u;
      o.inverse_sigma2 = was.inverse_sigma2;
      if (was.left.ok()) {
        o.u = was.left.u;
        o.v = was.left.v;
        o.right_u += o.u - was.u;
        o.inverse_sigma2 = weight(noise_, was.left.variance);
        sum += static_cast<double>(o.inverse_sigma2);
        ++n;
      }
    }
    // The other sightings were aligned to the reference: it is as exact as they are.
    const std::size_t reference = points_[point].reference;
    if (n > 0) observations[reference].inverse_sigma2 = static_cast<float>(sum / n);
    for (std::size_t i = begin; i < end; ++i) {
      auto& o = observations[i];
      const Sighting& was = sightings_[i];
      float right = was.inverse_sigma2;
      if (was.right.ok()) {
        o.right_u = was.right.u;
        right = weight(right_noise_, was.right.variance);
      }
      o.right_factor = right / o.inverse_sigma2;
    }
  }
}

BundleSummary SightingAlignment::solve(const FullBundleOptions& options,
                                       const std::atomic<bool>* abort, int n_threads) {
  const bool was_solved = bundle_.solved;
  const auto cameras = bundle_.problem.cameras;
  const auto points = bundle_.problem.points;
  const BundleSummary summary = solve_full_bundle(bundle_, options, abort, n_threads);
  if (!bundle_.solved) {
    bundle_.problem.cameras = cameras;
    bundle_.problem.points = points;
    bundle_.solved = was_solved;
  }
  return summary;
}

double SightingAlignment::median_error() const {
  const BundleProblem& problem = bundle_.problem;
  std::vector<double> errors;
  for (const auto& o : problem.observations) {
    Eigen::Vector2d seen;
    const auto& camera = problem.cameras[o.camera];
    if (!camera.model->project(camera.T_cw * problem.points[o.point], seen)) continue;
    errors.push_back((Eigen::Vector2d(o.u, o.v) - seen).norm());
  }
  return median(errors);
}

}  // namespace orbslam

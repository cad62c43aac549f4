// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/patch_search.hpp"

#include <Eigen/LU>
#include <algorithm>

#include "features/level_placement.hpp"

namespace orbslam {
namespace {

/// Pixels of the image per pixel of the level.
Eigen::Vector2d scale_of(const LevelPlacement& place) {
  return {place.x.to_image(1) - place.x.to_image(0), place.y.to_image(1) - place.y.to_image(0)};
}

Eigen::Vector2d to_level(const LevelPlacement& place, const Eigen::Vector2f& pixel) {
  return {place.x.to_level(pixel.x()), place.y.to_level(pixel.y())};
}

}  // namespace

std::optional<PlacedPatch> place_patch(const PointPatch& patch, const Pose& T_rw,
                                       const Eigen::Vector3d& position) {
  const auto surface = parallel_patch(*patch.camera, T_rw.inverse(), patch.pixel.cast<double>(),
                                      (T_rw * position).z());
  if (!surface) return std::nullopt;
  return PlacedPatch{&patch.patch, patch.camera.get(), patch.scales.get(), patch.level, *surface};
}

FoundPatch find_patch(const PlacedPatch& placed, const Frame& frame, const Pose& T_cw,
                      const ImagePyramid& images, const Eigen::Vector2f& start,
                      const AlignmentOptions& options, int coarser) {
  FoundPatch result;
  const auto warp = warp_of(placed.surface, *frame.camera, T_cw);
  if (!warp) return result;
  const int level = std::min(warped_level(*frame.scales, placed.level, warp->A) + coarser,
                             static_cast<int>(images.levels.size()) - 1);
  const LevelPlacement there(*frame.scales, level, frame.camera->image_size());
  const LevelPlacement here(*placed.scales, placed.level, placed.camera->image_size());
  const Eigen::Vector2d scale = scale_of(there);
  const Eigen::Matrix2d A =
      scale.cwiseInverse().asDiagonal() * warp->A * scale_of(here).asDiagonal();
  const PatchAlignment aligned =
      align_patch(*placed.patch, A, images.levels[static_cast<std::size_t>(level)],
                  to_level(there, start), options);
  result.failure = aligned.failure;
  if (!aligned.ok()) return result;
  const Eigen::Vector2f raw(there.x.to_image(static_cast<float>(aligned.position.x())),
                            there.y.to_image(static_cast<float>(aligned.position.y())));
  const Eigen::Vector2f pixel = frame.camera->from_image(raw);
  result.raw = raw;
  result.level = level;
  result.u = pixel.x();
  result.v = pixel.y();
  result.level_scale = static_cast<float>(scale.x());
  const double level_variance = 0.5 * aligned.information.inverse().trace();
  result.variance =
      static_cast<float>((level_variance + kLeastAlignedVariance) * scale.x() * scale.x());
  return result;
}

bool cut_patch_at(const Frame& frame, std::size_t i, const ImagePyramid& images,
                  ReferencePatch& patch) {
  const int level = frame.keypoints[i].level;
  const LevelPlacement place(*frame.scales, level, frame.camera->image_size());
  return cut_patch(images.levels[static_cast<std::size_t>(level)],
                   to_level(place, raw_pixel(frame, i)), patch);
}

}  // namespace orbslam

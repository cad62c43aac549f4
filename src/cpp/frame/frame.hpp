// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <vector>

#include "base/ids.hpp"
#include "base/pose.hpp"
#include "base/scale_pyramid.hpp"
#include "camera/camera.hpp"
#include "features/keypoint.hpp"
#include "frame/frame_images.hpp"
#include "frame/keypoint_grid.hpp"
#include "frame/small_image.hpp"
#include "frame/words.hpp"

namespace orbslam {

/// Measurements of one image (or pair): features, depths, words. It holds no pose and no map
/// points. It is built once, then shared read-only by the tracker and the keyframe made from it.
struct Frame {
  FrameId id = -1;
  double timestamp = 0;  ///< seconds, as given by the caller
  std::shared_ptr<const Camera> camera;
  std::shared_ptr<const ScalePyramid> scales;

  std::vector<Keypoint> keypoints;      ///< undistorted coordinates
  std::vector<Keypoint> raw_keypoints;  ///< as extracted; empty when the lens does not distort
  std::vector<Descriptor> descriptors;
  std::vector<float> right_u;  ///< column in the right image; meaningful where depth > 0, else -1
  /// Metres, -1 when unknown; along the optical axis of a flat plane, along a fisheye lens's ray.
  std::vector<float> depth;
  /// Red, green, blue of the image at each keypoint; empty when the image was grey.
  std::vector<std::array<std::uint8_t, 3>> colours;
  KeypointGrid grid;
  /// Of each right column that was aligned (frame/right_alignment.hpp), else 0 [px^2]; may be
  /// empty.
  std::vector<float> right_variance;
  std::shared_ptr<FrameImages> images;  ///< null: patches are not aligned in this frame
  SmallImage small_image;  ///< of the image, the left one of a pair; empty when it was not kept

  WordVector words;          ///< filled by describe() (places/), before the frame is shared
  DirectIndex direct_index;  ///< same
  bool described = false;

  std::size_t size() const { return keypoints.size(); }
  /// True if keypoint i has a depth. Test depths and not right columns: a virtual right column may
  /// be negative.
  bool has_depth(std::size_t i) const { return depth[i] > 0.0F; }
  /// The depth can be trusted from one view: see docs/method/frame.md#close-and-far-points.
  bool is_close(std::size_t i) const {
    return depth[i] > 0.0F && depth[i] < static_cast<float>(camera->close_depth(keypoints[i].x));
  }
  /// Keypoint i at its measured depth in the camera frame; depth must be known.
  Eigen::Vector3d unproject(std::size_t i) const {
    return camera->unproject(keypoints[i].x, keypoints[i].y, depth[i]);
  }
  /// Centre (world) of the camera that keypoint i belongs to, for a pose of the frame.
  Eigen::Vector3d center_of(std::size_t i, const Pose& T_cw) const {
    if (!camera->is_rig()) return T_cw.center();
    return T_cw.rotation().conjugate() * (camera->centre(keypoints[i].x) - T_cw.translation());
  }
};

/// How many close keypoints have an inlier map point, and how many do not.
struct CloseCounts {
  int tracked = 0;
  int untracked = 0;
};

/// The keyframe that a frame's pose is relative to, as it was in the map in which the pose was
/// estimated. When the map moves, the frame follows (map/anchor.hpp).
struct Anchor {
  KeyFrameId keyframe;  ///< invalid: none
  Pose T_kw;
  double scale = 1;              ///< KeyFrame::scale
  std::uint64_t big_change = 0;  ///< Map::big_change_index()
  MapIndex map = kNoMap;         ///< KeyFrame::map of it
};

/// Pixel of a map point in a tracked frame, found by alignment of the point's patch.
struct AlignedPixel {
  MapPointId point;  ///< invalid: not aligned
  float u = 0, v = 0, right_u = 0;
  float inverse_sigma2 = 1;  ///< of u and v [px^-2]
  float right_factor = 1;    ///< inverse variance of the right column over that
};

/// A frame with what tracking estimates of it: its pose, and the map point of each keypoint.
/// `frame` holds the measurements: keypoints, descriptors and depths.
struct TrackedFrame {
  std::shared_ptr<const Frame> frame;
  std::optional<Pose> T_cw;
  Anchor anchor;

  // Per keypoint: the associated map point (invalid id: none), a copy of its position in the
  // world at association time, and whether the last pose optimisation called it an outlier.
  std::vector<MapPointId> map_points;
  std::vector<Eigen::Vector3d> positions;
  std::vector<std::uint8_t> outlier;
  /// Pixels of some keypoints by alignment of patches; empty, or one entry per keypoint. An entry
  /// is valid as long as its keypoint keeps the same point.
  std::vector<AlignedPixel> aligned;

  explicit TrackedFrame(std::shared_ptr<const Frame> f)
      : frame(std::move(f)),
        map_points(frame->size()),
        positions(frame->size(), Eigen::Vector3d::Zero()),
        outlier(frame->size(), 0) {}

  KeyFrameId reference_keyframe() const { return anchor.keyframe; }

  void associate(std::size_t i, MapPointId point, const Eigen::Vector3d& position) {
    map_points[i] = point;
    positions[i] = position;
    outlier[i] = 0;
  }
  void dissociate(std::size_t i) {
    map_points[i] = MapPointId();
    outlier[i] = 0;
  }
  void clear_associations();
  /// The aligned pixel of keypoint `i`; null if the observation uses the keypoint's own pixel.
  const AlignedPixel* aligned_at(std::size_t i) const {
    const bool is_aligned =
        !aligned.empty() && aligned[i].point.valid() && aligned[i].point == map_points[i];
    return is_aligned ? &aligned[i] : nullptr;
  }
  /// Takes over the associations of another tracked version of the same frame where `keep` is not
  /// 0; all others are dropped. Throws StateError when it is another frame.
  void copy_associations(const TrackedFrame& from, const std::vector<std::uint8_t>& keep);
  /// Dissociates the outliers. Returns the ids of their points, ascending.
  std::vector<MapPointId> discard_outliers();

  /// Keypoints with a map point, outliers included.
  std::size_t n_associated() const;
  /// Inliers among them that are points of the map, not temporary ones.
  std::size_t n_map_inliers() const;
  /// Over the close keypoints; both 0 without depth. They decide whether a keyframe is needed for
  /// new close points.
  CloseCounts n_close_tracked_untracked() const;
};

}  // namespace orbslam

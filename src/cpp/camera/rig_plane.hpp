// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "camera/camera.hpp"

namespace orbslam {

inline constexpr std::size_t kMostCameras = 8;  ///< of a rig

/// Columns of a rig's plane that a camera takes.
struct PlaneColumns {
  double zero;   ///< where column 0 of the camera lies
  double first;  ///< of what the camera's plane or image needs
  double last;
};

/// The planes of the cameras side by side, from left to right.
std::vector<PlaneColumns> plane_columns(const std::vector<RigMember>& members);

/// The options of a rig with what follows from its cameras: pinhole and depth limits of the first
/// active one that measures depths, and the size of the plane. Throws SettingsError when there are
/// not two to eight cameras, one is missing or itself a rig, or none is active.
CameraOptions checked_rig(const CameraOptions& options);

/// Of the whole plane of a rig.
ImageBounds bounds_of_rig(const CameraOptions& options);

/// A camera's plane is not its image.
bool any_distorts(const std::vector<RigMember>& members);

/// The largest limit below which a depth is trusted from one view [m].
double deepest_close(const std::vector<RigMember>& members);

}  // namespace orbslam

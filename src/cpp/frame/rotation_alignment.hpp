// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <optional>

#include "camera/camera.hpp"
#include "frame/small_image.hpp"

namespace orbslam {

/// Rotation of a camera between two images, estimated from the images alone.
struct ImageRotation {
  Eigen::Quaterniond R_21 = Eigen::Quaterniond::Identity();  ///< directions of camera 1 into 2
  double correlation = 0;  ///< of the grey values where both see, -1 to 1
};

/// Aligns small images of one size as if the camera had only turned, by up to a quarter of what it
/// sees: the shift with the best correlation first, then Gauss-Newton over the rotation, gain and
/// offset of the grey values (Klein and Murray 2008, sections 3 and 4.2; Benhimane and Malis 2004).
/// None when the images are missing or of different sizes, have no contrast, or the iterations
/// leave the image. `camera` is that of the whole image; its lens is left out. Near objects bias
/// the result by their parallax. Use it to place search windows, not as a pose. See
/// docs/method/tracking.md#harder-search.
std::optional<ImageRotation> align_rotation(const SmallImage& first, const SmallImage& second,
                                            const Camera& camera);

}  // namespace orbslam

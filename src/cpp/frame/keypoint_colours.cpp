// SPDX-License-Identifier: BSD-3-Clause
#include "frame/keypoint_colours.hpp"

#include <algorithm>

#include "base/errors.hpp"

namespace orbslam {

void sample_colours(const cv::Mat& image, bool is_rgb, Frame& frame, const Rectifier* rectifier) {
  frame.colours.clear();
  const ImageSize size = rectifier ? rectifier->raw().image_size() : frame.camera->image_size();
  const int channels = image.channels();
  if (image.depth() != CV_8U || image.cols != size.width || image.rows != size.height ||
      (channels != 1 && channels != 3 && channels != 4)) {
    throw ImageError("colours come from the image that the frame was made of: uint8, " +
                     std::to_string(size.width) + "x" + std::to_string(size.height) +
                     ", 1, 3 or 4 channels");
  }
  if (channels == 1) return;
  const auto& raw = frame.raw_keypoints.empty() ? frame.keypoints : frame.raw_keypoints;
  const int red = is_rgb ? 0 : 2, blue = 2 - red;
  frame.colours.resize(raw.size());
  for (std::size_t i = 0; i < raw.size(); ++i) {
    Eigen::Vector2f at(raw[i].x, raw[i].y);
    if (rectifier) {
      const Eigen::Vector2f found = rectifier->to_raw(at.cast<double>()).cast<float>();
      if (found.allFinite()) at = found;
    }
    const int column = std::clamp(static_cast<int>(at.x() + 0.5F), 0, image.cols - 1);
    const int row = std::clamp(static_cast<int>(at.y() + 0.5F), 0, image.rows - 1);
    const std::uint8_t* pixel = image.ptr<std::uint8_t>(row) + column * channels;
    frame.colours[i] = {pixel[red], pixel[1], pixel[blue]};
  }
}

}  // namespace orbslam

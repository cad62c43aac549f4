// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <opencv2/core/mat.hpp>

namespace orbslam {

/// The grey image (CV_8UC1) of a grey, colour (3 channels) or colour + alpha (4) image, uint8:
/// 0.299 R + 0.587 G + 0.114 B. `is_rgb`: the first channel is red, else blue. A grey image
/// comes back as it is, sharing its pixels. Throws ImageError for an empty image and for other
/// types. See docs/method/frame.md#images.
cv::Mat to_grey(const cv::Mat& image, bool is_rgb);
/// The same into `grey`, whose memory is reused if its size and type fit.
void to_grey(const cv::Mat& image, bool is_rgb, cv::Mat& grey);

/// Depth in float32 metres from raw sensor units (any numeric single channel): raw / factor.
/// A factor below 1e-5 counts as 1 (the image is in metres). Values <= 0 and NaN stay what they
/// are and mean "no depth". Float32 metres come back as they are, sharing their pixels.
/// Throws ImageError for an empty image or several channels, SettingsError for a negative or
/// non-finite factor.
cv::Mat to_depth_metres(const cv::Mat& raw, double factor);
/// The same into `metres`, whose memory is reused if its size and type fit.
void to_depth_metres(const cv::Mat& raw, double factor, cv::Mat& metres);

}  // namespace orbslam

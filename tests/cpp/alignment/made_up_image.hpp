// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <random>
#include <vector>

namespace orbslam::testing {

/// A texture whose grey value is known at every point: waves of random directions.
class Texture {
 public:
  explicit Texture(unsigned seed, double shortest_wave = 6, double contrast = 12) {
    std::mt19937 draw(seed);
    std::uniform_real_distribution<double> unit(0, 1);
    for (int i = 0; i < 24; ++i) {
      const double direction = 2 * M_PI * unit(draw);
      const double length = shortest_wave * (1 + 3 * unit(draw));
      waves_.push_back({2 * M_PI / length * std::cos(direction),
                        2 * M_PI / length * std::sin(direction), 2 * M_PI * unit(draw), contrast});
    }
  }

  double at(const Eigen::Vector2d& p) const {
    double sum = 128;
    for (const Wave& w : waves_) sum += w.height * std::sin(w.x * p.x() + w.y * p.y() + w.phase);
    return sum;
  }

 private:
  struct Wave {
    double x, y, phase, height;
  };
  std::vector<Wave> waves_;
};

struct Look {
  double gain = 1, offset = 0, noise = 0;  ///< of grey values; noise: standard deviation
  unsigned seed = 1;                       ///< of the noise
};

/// Pixel p of the image shows texture(to_texture(p)).
template <class ToTexture>
cv::Mat picture(const Texture& texture, const ToTexture& to_texture, const Look& look = {},
                cv::Size size = {64, 64}) {
  cv::Mat image(size, CV_8UC1);
  std::mt19937 draw(look.seed);
  std::normal_distribution<double> noise(0, 1);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      const double grey = look.gain * (texture.at(to_texture(Eigen::Vector2d(x, y))) - 128) + 128 +
                          look.offset + look.noise * noise(draw);
      image.at<std::uint8_t>(y, x) =
          static_cast<std::uint8_t>(std::lround(std::clamp(grey, 0.0, 255.0)));
    }
  }
  return image;
}

}  // namespace orbslam::testing

// SPDX-License-Identifier: BSD-3-Clause
#include "frame/rotation_alignment.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace orbslam {
namespace {

constexpr double kBlur = 1.5;           // pixels of the small image
constexpr int kBlurRadius = 6;          // four standard deviations
constexpr double kSearched = 0.25;      // of width and height, to each side
constexpr double kLeastContrast = 1.0;  // standard deviation of the blurred image, grey levels
constexpr int kIterations = 10;
constexpr double kSmallStep = 1e-4;    // radians
constexpr double kLeastOverlap = 0.4;  // of the pixels

using Vector5d = Eigen::Matrix<double, 5, 1>;
using Matrix5d = Eigen::Matrix<double, 5, 5>;

/// One pass of the blur: along each row of `image`, which comes out turned.
///
/// By hand, not by cv::GaussianBlur: that fuses multiplications and additions where OpenCV was
/// built to use such instructions, and the last bits differ from one build of it to another.
cv::Mat1f blurred_rows_as_columns(const cv::Mat1f& image, const cv::Mat1f& kernel) {
  const int radius = kernel.rows / 2, width = image.cols;
  cv::Mat1f turned(width, image.rows);
  std::vector<float> padded(static_cast<std::size_t>(width + 2 * radius));
  for (int y = 0; y < image.rows; ++y) {
    for (int x = -radius; x < width + radius; ++x) {
      const int from = cv::borderInterpolate(x, width, cv::BORDER_REFLECT_101);
      padded[static_cast<std::size_t>(x + radius)] = image(y, from);
    }
    for (int x = 0; x < width; ++x) {
      float sum = 0;
      for (int k = 0; k < kernel.rows; ++k) {
        sum += kernel(k, 0) * padded[static_cast<std::size_t>(x + k)];
      }
      turned(x, y) = sum;
    }
  }
  return turned;
}

/// The blurred image with float pixels.
cv::Mat1f blurred(const SmallImage& small) {
  const cv::Mat1b pixels(small.height, small.width, const_cast<std::uint8_t*>(small.pixels.data()));
  cv::Mat1f image;
  pixels.convertTo(image, CV_32F);
  const cv::Mat1f kernel = cv::getGaussianKernel(2 * kBlurRadius + 1, kBlur, CV_32F);
  return blurred_rows_as_columns(blurred_rows_as_columns(image, kernel), kernel);
}

/// Sums over pairs of grey values, and what follows from them.
struct Correlation {
  double n = 0, a = 0, b = 0, aa = 0, bb = 0, ab = 0;

  void add(double x, double y) {
    n += 1;
    a += x;
    b += y;
    aa += x * x;
    bb += y * y;
    ab += x * y;
  }
  /// -1 where one side has no contrast.
  double value() const {
    if (n == 0) return -1;
    const double variance_a = aa - a * a / n, variance_b = bb - b * b / n;
    const double least = n * kLeastContrast * kLeastContrast;
    if (!(variance_a > least && variance_b > least)) return -1;
    return (ab - a * b / n) / std::sqrt(variance_a * variance_b);
  }
};

/// Correlation of first(x, y) with second(x + dx, y + dy).
double correlation_at(const cv::Mat1f& first, const cv::Mat1f& second, int dx, int dy) {
  Correlation sums;
  for (int y = std::max(0, -dy); y < std::min(first.rows, first.rows - dy); ++y) {
    const float* a = first[y];
    const float* b = second[y + dy] + dx;
    for (int x = std::max(0, -dx); x < std::min(first.cols, first.cols - dx); ++x) {
      sums.add(static_cast<double>(a[x]), static_cast<double>(b[x]));
    }
  }
  return sums.value();
}

/// The whole shift with the best correlation, of equals the first.
Eigen::Vector2i best_shift(const cv::Mat1f& first, const cv::Mat1f& second, double& best) {
  const int across = static_cast<int>(kSearched * first.cols);
  const int down = static_cast<int>(kSearched * first.rows);
  Eigen::Vector2i shift(0, 0);
  best = -1;
  for (int dy = -down; dy <= down; ++dy) {
    for (int dx = -across; dx <= across; ++dx) {
      const double value = correlation_at(first, second, dx, dy);
      if (value > best) {
        best = value;
        shift = {dx, dy};
      }
    }
  }
  return shift;
}

/// The normal equations of one step over (rotation, gain, offset), and the fit they start from.
struct Fit {
  Matrix5d H = Matrix5d::Zero();
  Vector5d b = Vector5d::Zero();
  Correlation sums;
};

/// The image plane of the small images.
struct SmallPlane {
  Pinhole pinhole;
  const Camera* fisheye = nullptr;  ///< a lens that no pinhole stands for
  double shrink;

  SmallPlane(const Camera& camera, int shrink_by)
      : fisheye(camera.is_flat() ? nullptr : &camera), shrink(shrink_by) {
    const Pinhole& whole = camera.pinhole();
    const double middle = 0.5 * (shrink - 1);
    pinhole = {whole.fx / shrink, whole.fy / shrink, (whole.cx - middle) / shrink,
               (whole.cy - middle) / shrink};
  }

  /// Rays of all pixels, row by row.
  std::vector<Eigen::Vector3d> rays(int width, int height) const {
    std::vector<Eigen::Vector3d> all;
    all.reserve(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
    const double middle = 0.5 * (shrink - 1);
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        all.push_back(fisheye == nullptr ? pinhole.unproject(x, y, 1.0)
                                         : fisheye->ray(x * shrink + middle, y * shrink + middle));
      }
    }
    return all;
  }

  /// Pixel of a ray and its derivative; false where the lens shows nothing.
  bool project(const Eigen::Vector3d& ray, Seen& seen) const {
    if (fisheye == nullptr) return lens_models::PinholeLens{pinhole}.project(ray, seen);
    if (!ray.allFinite() || !fisheye->project(ray, seen)) return false;
    seen.uv = (seen.uv.array() - 0.5 * (shrink - 1)) / shrink;
    seen.J /= shrink;
    return true;
  }

  Eigen::Matrix3d turned_by(const Eigen::Vector2i& shift) const {
    // A shift to the right (down) in the image is a rotation about +y (-x) of the camera.
    const Eigen::AngleAxisd yaw(std::atan(shift.x() / pinhole.fx), Eigen::Vector3d::UnitY());
    const Eigen::AngleAxisd pitch(-std::atan(shift.y() / pinhole.fy), Eigen::Vector3d::UnitX());
    return (yaw * pitch).toRotationMatrix();
  }
};

Fit linearise(const cv::Mat1f& first, const cv::Mat1f& second, const SmallPlane& plane,
              const std::vector<Eigen::Vector3d>& rays, const Eigen::Matrix3d& R_21, double gain,
              double offset) {
  Fit fit;
  for (int y = 1; y < first.rows - 1; ++y) {
    for (int x = 1; x < first.cols - 1; ++x) {
      const Eigen::Vector3d ray = R_21 * rays[static_cast<std::size_t>(y * first.cols + x)];
      Seen seen;
      if (!plane.project(ray, seen)) continue;
      const Eigen::Vector2d& at = seen.uv;
      if (!(at.x() >= 1 && at.y() >= 1 && at.x() < second.cols - 2 && at.y() < second.rows - 2)) {
        continue;
      }
      const int u = static_cast<int>(at.x()), v = static_cast<int>(at.y());
      const double fu = at.x() - u, fv = at.y() - v;
      const auto sample = [&](int du, int dv) {
        const float* upper = second[v + dv] + u + du;
        const float* lower = second[v + dv + 1] + u + du;
        return (1 - fv) *
                   ((1 - fu) * static_cast<double>(upper[0]) + fu * static_cast<double>(upper[1])) +
               fv * ((1 - fu) * static_cast<double>(lower[0]) + fu * static_cast<double>(lower[1]));
      };
      const double grey = sample(0, 0), wanted = static_cast<double>(first(y, x));
      fit.sums.add(wanted, grey);
      // The mean of both images' gradients converges in fewer steps (second-order minimisation).
      const double gu = 0.25 * (sample(1, 0) - sample(-1, 0) +
                                gain * static_cast<double>(first(y, x + 1) - first(y, x - 1)));
      const double gv = 0.25 * (sample(0, 1) - sample(0, -1) +
                                gain * static_cast<double>(first(y + 1, x) - first(y - 1, x)));
      const Eigen::Vector3d by_point =
          gu * seen.J.row(0).transpose() + gv * seen.J.row(1).transpose();
      Vector5d row;
      // A small turn w moves the ray by w x ray.
      row << ray.cross(by_point), -wanted, -1;
      const double residual = grey - gain * wanted - offset;
      fit.H.noalias() += row * row.transpose();
      fit.b.noalias() -= row * residual;
    }
  }
  return fit;
}

}  // namespace

std::optional<ImageRotation> align_rotation(const SmallImage& first, const SmallImage& second,
                                            const Camera& camera) {
  if (first.empty() || first.width != second.width || first.height != second.height) return {};
  const cv::Mat1f a = blurred(first), b = blurred(second);
  double correlation = -1;
  const SmallPlane plane(camera, first.shrink);
  const std::vector<Eigen::Vector3d> rays = plane.rays(a.cols, a.rows);
  Eigen::Matrix3d R_21 = plane.turned_by(best_shift(a, b, correlation));
  if (!(correlation > 0)) return {};
  double gain = 1, offset = 0;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    const Fit fit = linearise(a, b, plane, rays, R_21, gain, offset);
    if (fit.sums.n < kLeastOverlap * static_cast<double>(a.total())) return {};
    const Eigen::LDLT<Matrix5d> factor(fit.H);
    const Vector5d step = factor.solve(fit.b);
    if (factor.info() != Eigen::Success || !step.allFinite()) return {};
    const Eigen::Vector3d turn = step.head<3>();
    if (turn.norm() > 0) R_21 = Eigen::AngleAxisd(turn.norm(), turn.normalized()) * R_21;
    gain += step(3);
    offset += step(4);
    if (turn.norm() < kSmallStep) break;
  }
  const Fit fit = linearise(a, b, plane, rays, R_21, gain, offset);
  correlation = fit.sums.value();
  if (fit.sums.n < kLeastOverlap * static_cast<double>(a.total()) || !(correlation > 0)) return {};
  return ImageRotation{Eigen::Quaterniond(R_21), correlation};
}

}  // namespace orbslam

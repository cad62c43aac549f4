// SPDX-License-Identifier: BSD-3-Clause
// Written from S. Baker, I. Matthews, "Lucas-Kanade 20 years on", IJCV 2004 (inverse compositional)
// and C. Forster et al., "SVO", T-RO 2017 (the warped patch moves over the image).
//
// Every step solves for gain and offset exactly. Gradients and values of the patch are made
// orthogonal to a change of gain or offset, so a step needs three sums of products.
#include "alignment/align_patch.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

#include "alignment/smooth.hpp"

namespace orbslam {
namespace {

constexpr int kHalf = 4;
constexpr int kSide = 2 * kHalf + 1;
constexpr int kPixels = kSide * kSide;
constexpr int kColumns = 12;  // of a row with its padding: whole vectors of four numbers
constexpr int kVectors = kColumns / 4;

// Pixels that the patch can reach on each side of the pixel nearest to the start: the shift, the
// rounding of the start, and the neighbour for interpolation.
constexpr int kReach = kHalf + static_cast<int>(AlignmentOptions::kMostShift) + 2;
constexpr int kWindow = 2 * kReach + 1;
constexpr int kStride = 28;  // of a row of the window: loads of padding stay in it

// Values have the unit 1/16 grey value (smooth.hpp).
constexpr double kGrey = 16;
/// Share of the variance of white noise that remains after smoothing and interpolation, per
/// direction.
constexpr double kLeftOfNoise = 0.316;
/// Correlation of that noise between a pixel and the two next to it, in one direction.
constexpr float kNear = 0.74F, kFar = 0.29F;
/// Degrees of freedom of the residuals: the pixels, minus the part of their noise that the fit of
/// position, gain and offset absorbs.
constexpr double kFreedom = kPixels - 16;
/// Variance of rounding to whole grey values in both images, after smoothing.
constexpr double kRounding = 2.0 / 12.0 * kLeftOfNoise * kLeftOfNoise;
/// Least mean square of the gradient in its weakest direction [grey values^2 / pixel^2].
constexpr double kLeastGradient = 1.0;
/// Least share of the weakest direction in the strongest one.
constexpr double kLeastShare = 1e-3;

/// Four numbers, which the compiler puts into one register of every vector unit.
using Four = float __attribute__((vector_size(16)));
using FourInts = std::int32_t __attribute__((vector_size(16)));

/// Weights of three pixels: the quadratic B-spline. Its smoothing is the same at all fractions of a
/// pixel, that of linear interpolation is not and would pull positions.
template <class Number>
struct Spline {
  /// `t`: position minus that of the middle pixel, -0.5 to 0.5.
  explicit Spline(Number t)
      : before(0.5F * (0.5F - t) * (0.5F - t)),
        at(0.75F - t * t),
        after(0.5F * (0.5F + t) * (0.5F + t)) {}

  Number before, at, after;
};

struct Plane {
  alignas(16) Four rows[kSide][kVectors];
};

Four load(const float* from) {
  Four four;
  __builtin_memcpy(&four, from, sizeof(four));
  return four;
}

Four all(float value) { return Four{value, value, value, value}; }

/// In a fixed order.
double total(const Four (&sums)[kVectors]) {
  const Four sum = (sums[0] + sums[1]) + sums[2];
  return (static_cast<double>(sum[0]) + sum[1]) + (static_cast<double>(sum[2]) + sum[3]);
}

double dot(const Plane& a, const Plane& b) {
  Four sums[kVectors] = {};
  for (int y = 0; y < kSide; ++y) {
    for (int k = 0; k < kVectors; ++k) sums[k] += a.rows[y][k] * b.rows[y][k];
  }
  return total(sums);
}

/// Ones where there are pixels, zeros in the padding.
constexpr Four kInside[kVectors] = {{1, 1, 1, 1}, {1, 1, 1, 1}, {1, 0, 0, 0}};

/// Makes the mean zero. The padding must be zero and stays zero.
void subtract_mean(Plane& plane) {
  Four sums[kVectors] = {};
  for (int y = 0; y < kSide; ++y) {
    for (int k = 0; k < kVectors; ++k) sums[k] += plane.rows[y][k];
  }
  const Four mean = all(static_cast<float>(total(sums) / kPixels));
  for (int y = 0; y < kSide; ++y) {
    for (int k = 0; k < kVectors; ++k) plane.rows[y][k] -= mean * kInside[k];
  }
}

void subtract(Plane& from, double factor, const Plane& what) {
  const Four f = all(static_cast<float>(factor));
  for (int y = 0; y < kSide; ++y) {
    for (int k = 0; k < kVectors; ++k) from.rows[y][k] -= f * what.rows[y][k];
  }
}

/// Multiplies by the correlation matrix of smoothed white noise.
void correlate(const Plane& in, Plane& out) {
  constexpr int kBorder = 2;
  const auto weigh = [](const Four& a, const Four& b, const Four& c, const Four& d, const Four& e) {
    return c + kNear * (b + d) + kFar * (a + e);
  };
  Four down[kSide + 2 * kBorder][kVectors] = {};
  for (int y = 0; y < kSide; ++y) {
    for (int k = 0; k < kVectors; ++k) down[y + kBorder][k] = in.rows[y][k];
  }
  // All rows are written before the first is read: a load that spans two stores waits for both.
  float rows[kSide][kColumns + 2 * kBorder] = {};
  for (int y = 0; y < kSide; ++y) {
    for (int k = 0; k < kVectors; ++k) {
      const Four sum =
          weigh(down[y][k], down[y + 1][k], down[y + 2][k], down[y + 3][k], down[y + 4][k]);
      __builtin_memcpy(rows[y] + kBorder + 4 * k, &sum, sizeof(sum));
    }
  }
  for (int y = 0; y < kSide; ++y) {
    for (int k = 0; k < kVectors; ++k) {
      const float* at = rows[y] + 4 * k;
      out.rows[y][k] = weigh(load(at), load(at + 1), load(at + 2), load(at + 3), load(at + 4));
    }
  }
}

/// The warped patch, and the sums that every step needs.
struct Template {
  Plane values;        // mean 0
  Plane gx, gy;        // gradients, orthogonal to constant and values
  double square = 0;   // of the values
  Eigen::Matrix2d H;   // of the gradients
  Eigen::Matrix2d H1;  // inverse
};

/// The warped patch with a border of one pixel for gradients, and room to load whole vectors.
using WarpedPatch = float[kSide + 2][kColumns + 4];

Four grey_values(const std::uint16_t* from) {
  using FourShorts = std::uint16_t __attribute__((vector_size(8)));
  FourShorts four;
  __builtin_memcpy(&four, from, sizeof(four));
  return __builtin_convertvector(__builtin_convertvector(four, FourInts), Four);
}

/// Four pixels of the reference at the given places.
void sample(const ReferencePatch& reference, const Four& x, const Four& y, float* out) {
  const FourInts column = __builtin_convertvector(x + 0.5F, FourInts);
  const FourInts line = __builtin_convertvector(y + 0.5F, FourInts);
  const Spline<Four> across(x - __builtin_convertvector(column, Four));
  const Spline<Four> down(y - __builtin_convertvector(line, Four));
  for (int k = 0; k < 4; ++k) {
    const std::uint16_t* at = &reference.values[static_cast<std::size_t>(line[k] - 1)]
                                               [static_cast<std::size_t>(column[k] - 1)];
    const Four sum = all(down.before[k]) * grey_values(at) +
                     all(down.at[k]) * grey_values(at + ReferencePatch::kSize) +
                     all(down.after[k]) * grey_values(at + 2 * ReferencePatch::kSize);
    out[k] = across.before[k] * sum[0] + across.at[k] * sum[1] + across.after[k] * sum[2];
  }
}

/// False when the reference does not reach that far.
bool warp(const ReferencePatch& reference, const Eigen::Matrix2d& A, WarpedPatch& out) {
  const Eigen::Matrix2f back = A.inverse().cast<float>();
  constexpr float kLast = ReferencePatch::kSize - 2.5F;  // four pixels are loaded at a time
  const Eigen::Vector2f centre =
      reference.fraction + Eigen::Vector2f::Constant(ReferencePatch::kCentre);
  const Eigen::Vector2f most = back.cwiseAbs() * Eigen::Vector2f::Constant(kHalf + 1);
  const bool inside = (centre - most).minCoeff() >= 0.5F && (centre + most).maxCoeff() < kLast;
  if (!inside) return false;  // also of NaN
  // The last column is there to fill the vector.
  constexpr Four kOffsets[kVectors] = {{-5, -4, -3, -2}, {-1, 0, 1, 2}, {3, 4, 5, 5}};
  for (int j = 0; j < kSide + 2; ++j) {
    const auto dy = static_cast<float>(j - kHalf - 1);
    const float x = centre.x() + back(0, 1) * dy, y = centre.y() + back(1, 1) * dy;
    for (int k = 0; k < kVectors; ++k) {
      const Four dx = kOffsets[k];
      sample(reference, x + back(0, 0) * dx, y + back(1, 0) * dx, out[j] + 4 * k);
    }
    std::fill_n(out[j] + kColumns, 4, 0.0F);
  }
  return true;
}

bool is_flat(const Eigen::Matrix2d& H) {
  const double half = 0.5 * H.trace();
  const double spread = std::hypot(0.5 * (H(0, 0) - H(1, 1)), H(0, 1));
  const double least = half - spread, most = half + spread;
  return !(least > kLeastGradient * kGrey * kGrey * kPixels && least > kLeastShare * most);
}

AlignmentFailure make_template(const ReferencePatch& reference, const Eigen::Matrix2d& A,
                               Template& made) {
  WarpedPatch grey;
  if (!warp(reference, A, grey)) return AlignmentFailure::kOutside;
  for (int y = 0; y < kSide; ++y) {
    for (int k = 0; k < kVectors; ++k) {
      const float *above = grey[y] + 4 * k, *at = grey[y + 1] + 4 * k, *below = grey[y + 2] + 4 * k;
      const Four inside = kInside[k];
      made.values.rows[y][k] = inside * load(at + 1);
      made.gx.rows[y][k] = inside * (0.5F * (load(at + 2) - load(at)));
      made.gy.rows[y][k] = inside * (0.5F * (load(below + 1) - load(above + 1)));
    }
  }
  for (Plane* plane : {&made.values, &made.gx, &made.gy}) {
    subtract_mean(*plane);
  }
  made.square = dot(made.values, made.values);
  if (!(made.square > 0)) return AlignmentFailure::kFlat;
  for (Plane* plane : {&made.gx, &made.gy}) {
    subtract(*plane, dot(*plane, made.values) / made.square, made.values);
  }
  const double xy = dot(made.gx, made.gy);
  made.H << dot(made.gx, made.gx), xy, xy, dot(made.gy, made.gy);
  if (is_flat(made.H)) return AlignmentFailure::kFlat;
  made.H1 = made.H.inverse();
  return AlignmentFailure::kNone;
}

/// The part of the image that the patch can reach.
class Window {
 public:
  /// Pixels beyond the border of the image repeat it; is_inside() says which positions are valid.
  Window(const cv::Mat& level, int x, int y)
      : x_(x - kReach), y_(y - kReach), columns_(level.cols), rows_(level.rows) {
    constexpr int kBytes = kWindow + 2;
    const int left = x_ - 1, top = y_ - 1;
    const bool whole =
        left >= 0 && top >= 0 && left + kBytes <= level.cols && top + kBytes <= level.rows;
    if (whole) {
      fill(level.ptr<std::uint8_t>(top) + left, static_cast<std::ptrdiff_t>(level.step[0]));
      return;
    }
    std::uint8_t bytes[kBytes][kBytes];
    for (int j = 0; j < kBytes; ++j) {
      const auto* row = level.ptr<std::uint8_t>(std::clamp(top + j, 0, level.rows - 1));
      for (int i = 0; i < kBytes; ++i) bytes[j][i] = row[std::clamp(left + i, 0, level.cols - 1)];
    }
    fill(bytes[0], kBytes);
  }

  /// The patch at a position lies in the image.
  bool is_inside(const Eigen::Vector2d& position) const {
    return position.x() >= kHalf && position.x() < columns_ - 1 - kHalf && position.y() >= kHalf &&
           position.y() < rows_ - 1 - kHalf;
  }

  /// Calls visit(y, k, values) with the interpolated values of the patch, four at a time. The
  /// values of the padding are meaningless.
  template <class Visit>
  void sample(const Eigen::Vector2d& position, const Visit& visit) const {
    const double left = position.x() - kHalf, top = position.y() - kHalf;
    const double column = std::floor(left + 0.5), line = std::floor(top + 0.5);
    const Spline<float> across(static_cast<float>(left - column));
    const Spline<float> down(static_cast<float>(top - line));
    const Four w0 = all(across.before), w1 = all(across.at), w2 = all(across.after);
    const Four v0 = all(down.before), v1 = all(down.at), v2 = all(down.after);
    const int x = static_cast<int>(column) - x_ - 1, y = static_cast<int>(line) - y_ - 1;
    Four rows[kSide + 2][kVectors];
    for (int j = 0; j < kSide + 2; ++j) {
      const float* at = &grey_[static_cast<std::size_t>(y + j)][static_cast<std::size_t>(x)];
      for (int k = 0; k < kVectors; ++k, at += 4) {
        rows[j][k] = w0 * load(at) + w1 * load(at + 1) + w2 * load(at + 2);
      }
    }
    for (int j = 0; j < kSide; ++j) {
      for (int k = 0; k < kVectors; ++k) {
        visit(j, k, v0 * rows[j][k] + v1 * rows[j + 1][k] + v2 * rows[j + 2][k]);
      }
    }
  }

 private:
  void fill(const std::uint8_t* bytes, std::ptrdiff_t stride) {
    alignment::smooth<kWindow>(bytes, stride, grey_);
    for (auto& row : grey_) std::fill(row.begin() + kWindow, row.end(), 0.0F);
  }

  int x_, y_, columns_, rows_;
  std::array<std::array<float, kStride>, kWindow> grey_;
};
static_assert(2 * kReach + 1 - kSide + kColumns + 1 <= kStride);

/// Gain, correlation and information at the final position.
void judge(const Template& patch, const Window& window, PatchAlignment& result) {
  Plane seen{};
  window.sample(result.position,
                [&](int y, int k, const Four& values) { seen.rows[y][k] = values * kInside[k]; });
  subtract_mean(seen);
  const double square = dot(seen, seen), product = dot(seen, patch.values);
  result.gain = product / patch.square;
  result.correlation = square > 0 ? product / std::sqrt(square * patch.square) : 0;
  subtract(seen, result.gain, patch.values);
  const double floor = kRounding * kGrey * kGrey;
  const double variance = std::max(dot(seen, seen) / kFreedom, floor);
  Plane x, y;
  correlate(patch.gx, x);
  correlate(patch.gy, y);
  const double xy = 0.5 * (dot(x, patch.gy) + dot(y, patch.gx));
  Eigen::Matrix2d scatter;  // of the sums in a step, over the variance of a pixel
  scatter << dot(x, patch.gx), xy, xy, dot(y, patch.gy);
  result.information =
      (result.gain * result.gain / variance) * patch.H * scatter.inverse() * patch.H;
}

/// One step; false when no step can be computed.
bool step(const Template& patch, const Window& window, const Eigen::Vector2d& position,
          Eigen::Vector2d& move) {
  Four x[kVectors] = {}, y[kVectors] = {}, value[kVectors] = {};
  window.sample(position, [&](int j, int k, const Four& seen) {
    x[k] += patch.gx.rows[j][k] * seen;
    y[k] += patch.gy.rows[j][k] * seen;
    value[k] += patch.values.rows[j][k] * seen;
  });
  const double gain = total(value) / patch.square;
  if (!(gain > 0)) return false;
  move = patch.H1 * Eigen::Vector2d(total(x), total(y)) * (-1 / gain);
  return true;
}

bool is_usable(const cv::Mat& level, const Eigen::Vector2d& start, const Eigen::Matrix2d& A) {
  return start.allFinite() && A.allFinite() && std::abs(A.determinant()) > 1e-6 && start.x() >= 0 &&
         start.y() >= 0 && start.x() < level.cols && start.y() < level.rows;
}

}  // namespace

PatchAlignment align_patch(const ReferencePatch& reference, const Eigen::Matrix2d& A,
                           const cv::Mat& level, const Eigen::Vector2d& start,
                           const AlignmentOptions& options) {
  PatchAlignment result;
  if (!is_usable(level, start, A)) return result;
  Template patch;
  result.failure = make_template(reference, A, patch);
  if (result.failure != AlignmentFailure::kNone) return result;
  const Window window(level, static_cast<int>(std::lround(start.x())),
                      static_cast<int>(std::lround(start.y())));
  const double most = std::min(options.max_shift, AlignmentOptions::kMostShift);
  Eigen::Vector2d move;
  result.position = start;
  bool converged = false;
  while (!converged) {
    if (!window.is_inside(result.position)) {
      result.failure = AlignmentFailure::kOutside;
      return result;
    }
    result.failure = AlignmentFailure::kNotConverged;
    if (result.iterations >= options.iterations) return result;
    ++result.iterations;
    if (!step(patch, window, result.position, move)) return result;
    result.position += move;
    // The condition is negated, so that NaN ends the loop.
    if (!((result.position - start).norm() <= most)) return result;
    converged = move.norm() < options.converged;
  }
  if (!window.is_inside(result.position)) {
    result.failure = AlignmentFailure::kOutside;
    return result;
  }
  judge(patch, window, result);
  const bool alike = result.correlation >= options.min_correlation;
  result.failure = alike ? AlignmentFailure::kNone : AlignmentFailure::kLowCorrelation;
  return result;
}

}  // namespace orbslam

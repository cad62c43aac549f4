// SPDX-License-Identifier: BSD-3-Clause
#pragma once

// No C++ library header here: this file is also read by a source that is compiled for another
// instruction set, and inline functions shared with it would break the one-definition rule.

/// The inner loops of the bundle solver by blocks as plain functions over pointers. Every
/// implementation gives the same bytes: four lanes, no fused multiply-add, one order of sums. See
/// docs/method/adjustment.md#blocks.
namespace orbslam::bundle_kernels {

using Index = unsigned int;
using Size = decltype(sizeof(0));

inline constexpr int kLanes = 4;
inline constexpr int kViewSize = 12;   ///< rows of (R_cw | t_cw)
inline constexpr int kPointSize = 4;   ///< x, y, z and 0; world
inline constexpr int kBlockSize = 36;  ///< six by six, by columns
inline constexpr int kCameraSize =
    28;  ///< lower triangle of H by rows (21), right-hand side (6), 0
inline constexpr int kReducedSize = 8;  ///< right-hand side (6) and 2 without meaning
inline constexpr int kStepSize = 8;     ///< rotation, 0, translation, 0
/// Inverse of the lower Cholesky factor (6), that times g (3), g (3), damping (3), 0.
inline constexpr int kPointStateSize = 16;
/// Per observation of a point: three columns of six numbers, in the layout that the products need.
inline constexpr int kRecordSize = 60;
/// Arrays of scratch memory, each `scratch_stride` long, before the records.
inline constexpr int kScratchArrays = 27;
/// Observations that are linearised before their points are eliminated.
inline constexpr Index kBatch = 192;

/// Observations. Of pinholes they lie on the normalised image plane: residuals in units of the
/// focal length, which is in the weights. With sights residuals are in pixels, u and v are not
/// read, right_u is the disparity [px] and base is the baseline times the focal length [px m].
/// Weight 0 takes an observation out. Arrays are readable for kLanes more.
struct Observations {
  const double* u;
  const double* v;
  const double* right_u;
  const double* base;  ///< baseline of the camera [m]
  const double* weight_u;
  const double* weight_v;
  const double* weight_right;  ///< 0 without depth
  const Index* view;
  const Index* point;
  /// By rows of three, then the last column; null: all cameras are pinholes.
  const double* sight[12];
};

/// Where the observations of a point begin and end, by free and by fixed cameras.
struct PointRange {
  Index free_begin, free_end, fixed_begin, fixed_end;
};

/// Input of a kernel: a run of points, with its own memory for sums.
struct Task {
  Observations free, fixed;
  const PointRange* ranges;
  Index point_begin, point_end;
  double huber_mono, huber_stereo;  ///< widths of the kernels; 0: none
  double damping;
  bool damp_scaled;  ///< damping by each unknown's curvature; otherwise equal damping
  Index n_free;      ///< cameras
  // The present estimate.
  const double* views;
  const double* points;
  // Written by linearisation, shared: observation by observation, point by point.
  double* camera_frame;  ///< 3 arrays of the points in the camera frame
  double* coupling;      ///< 9 arrays, a matrix by rows
  Size stride;           ///< of these arrays
  double* point_states;
  // Sums of this task alone.
  double* blocks;   ///< added to H by elimination: columns of the lower triangle
  double* cameras;  ///< H and right-hand sides before elimination
  double* reduced;  ///< subtracted from the right-hand sides by elimination
  double* scratch;
  Size scratch_stride;
  // Of the back substitution.
  const double* steps;  ///< of free cameras
  double* moved_points;
};

struct Kernels {
  const char* name;
  /// The (robustified) sum of squares.
  double (*cost)(const Task& task);
  /// Largest diagonal entry that belongs to a point; sums `cameras` as well.
  double (*curvature)(const Task& task);
  /// Linearises, sums `cameras` and eliminates the points: `blocks` and `reduced`.
  void (*eliminate)(const Task& task);
  /// Moves the points after the steps of the cameras. Returns the points' part of the predicted
  /// decrease of the cost.
  double (*back_substitute)(const Task& task);
  /// Cholesky factor in place of a matrix of blocks; false when it is not positive definite.
  bool (*factorise)(double* blocks, Index n, double* scratch);
  /// Solves with that factor in place; 6 numbers per block.
  void (*solve)(const double* blocks, Index n, double* x);
};

/// Doubles of scratch memory per camera that `factorise` needs.
inline constexpr Size kFactoriseSize = 121;

/// For any processor.
const Kernels& portable_kernels();
/// Null where the library was built without them (not an x86 processor).
const Kernels* avx2_kernels();
/// The fastest this processor can run, unless ORBSLAM2PY_PORTABLE_KERNELS=1 is set.
const Kernels& best_kernels();

}  // namespace orbslam::bundle_kernels

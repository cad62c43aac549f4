// SPDX-License-Identifier: BSD-3-Clause
#pragma once

// No C++ library header here, for the reason that bundle_kernels.hpp gives.

/// The inner loops of a frame's pose as plain functions over pointers. Every implementation gives
/// the same bytes: four lanes, no fused multiply-add, one order of sums. See
/// docs/method/adjustment.md#pose-of-a-frame.
namespace orbslam::pose_sums {

using Size = decltype(sizeof(0));

inline constexpr Size kLanes = 4;
inline constexpr Size kSystemSize = 27;  ///< lower triangle of H by rows (21), right-hand side (6)
/// Points closer to the camera's plane than this are not projected.
inline constexpr double kTinyDepth = 1e-9;

/// Observations of one kind (all with, or all without a right column), and where they are seen
/// from.
struct Task {
  Size n;  ///< a multiple of kLanes
  const double* x;
  const double* y;
  const double* z;  ///< world
  const double* u;
  const double* v;
  const double* right_u;  ///< pixels; read in the group with depth alone
  const double* weight;
  const double* right_factor;  ///< weight of the right column over that of u and v
  bool has_sights;             ///< false: the camera is a pinhole, and u and v suffice
  const double* sight[12];     ///< by rows of three, then the last column
  double rotation[9];          ///< R_cw by rows
  double translation[3];
  double fx, fy, cx, cy;
  double base;   ///< baseline [m]
  double bf;     ///< baseline times fx [pixel metre]
  double huber;  ///< width on whitened residuals; 0: plain least squares
};

/// The (robustified) sum of squares. `system`, if given, gets H and the right-hand side of the
/// group.
using Accumulate = double (*)(const Task& task, double* system);

struct Kernels {
  const char* name;
  Accumulate mono, stereo;
};

/// For any processor.
const Kernels& portable_kernels();
/// Null where the library was built without them (not an x86 processor).
const Kernels* avx2_kernels();
/// The fastest this processor can run, unless ORBSLAM2PY_PORTABLE_KERNELS=1 is set.
const Kernels& best_kernels();

}  // namespace orbslam::pose_sums

// SPDX-License-Identifier: BSD-3-Clause
#include "frame/stereo_kernels.hpp"

#include "base/vector_targets.hpp"
// A row of the window fills half a vector of AVX-512: compiled for it, the loop made stereo
// matching 7 % slower than compiled for AVX2.
#undef HWY_DISABLED_TARGETS
#define HWY_DISABLED_TARGETS (ORBSLAM2PY_DISABLED_TARGETS | HWY_AVX3)

// Compiled for every vector unit: no header may be included between HWY_BEFORE_NAMESPACE and
// HWY_AFTER_NAMESPACE (features/kernels.cpp says why).
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "frame/stereo_kernels.cpp"
#include <hwy/foreach_target.h>
// Behind it.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace orbslam::stereo {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

/// A row of the window with its padding in one vector or in two.
using Columns = hn::CappedTag<short, 16>;
using Bytes = hn::Rebind<unsigned char, Columns>;
constexpr int n_columns = static_cast<int>(hn::MaxLanes(Columns()));
constexpr int n_parts = 16 / n_columns;

/// One in the 11 columns of the window, zero in the padding: the multiply-add at the end sums
/// neighbours to 32 bits and drops the padding in one instruction. The 16-bit columns cannot
/// overflow: 11 rows of at most 510.
alignas(32) constexpr short window_columns[16] = {1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0};

}  // namespace

void shifted_sad(const WindowPair& windows, int* sums) {
  const Columns d;
  const Bytes d8;
  const hn::RepartitionToWide<Columns> d32;
  hn::Vec<Columns> left[n_parts][kWindow];
  for (int part = 0; part < n_parts; ++part) {
    for (int row = 0; row < kWindow; ++row) {
      left[part][row] = hn::PromoteTo(d, hn::Load(d8, windows.left[row] + n_columns * part));
    }
  }
  const int left_centre = windows.left[kHalfWindow][kHalfWindow];
  for (int k = 0; k < kShifts; ++k) {
    const int offset = left_centre - windows.right[kHalfWindow][k + kHalfWindow];
    const auto offsets = hn::Set(d, static_cast<short>(offset));
    auto sum = hn::Zero(d32), more = hn::Zero(d32);
    for (int part = 0; part < n_parts; ++part) {
      auto columns = hn::Zero(d);
      for (int row = 0; row < kWindow; ++row) {
        const auto right =
            hn::PromoteTo(d, hn::LoadU(d8, windows.right[row] + k + n_columns * part));
        const auto difference = hn::Sub(hn::Sub(left[part][row], right), offsets);
        columns = hn::Add(columns, hn::Abs(difference));
      }
      sum = hn::ReorderWidenMulAccumulate(
          d32, columns, hn::Load(d, window_columns + n_columns * part), sum, more);
    }
    sums[k] = hn::GetLane(hn::SumOfLanes(d32, hn::Add(sum, more)));
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace orbslam::stereo
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace orbslam::stereo {

ShiftedSad shifted_sad_for(VectorUnit unit) {
  ShiftedSad found = nullptr;
  if (unit == VectorUnit::avx2 || unit == VectorUnit::avx512) {
    found = HWY_CHOOSE_AVX2(shifted_sad);
  }
  return found != nullptr ? found : HWY_STATIC_DISPATCH(shifted_sad);
}

}  // namespace orbslam::stereo
#endif

// SPDX-License-Identifier: BSD-3-Clause
#include "synthetic/row_kernels.hpp"

#include "base/vector_targets.hpp"

// Compiled for every vector unit: no header may be included between HWY_BEFORE_NAMESPACE and
// HWY_AFTER_NAMESPACE (features/kernels.cpp says why).
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "synthetic/row_kernels.cpp"
#include <hwy/foreach_target.h>
// Behind it.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace orbslam::synthetic {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

using Floats = hn::ScalableTag<float>;
using HalfFloats = hn::Half<Floats>;
using Doubles = hn::RepartitionToWide<Floats>;
using Integers = hn::RebindToSigned<Floats>;
using Words = hn::RebindToUnsigned<Floats>;
using LongIntegers = hn::RebindToSigned<Doubles>;
using LongWords = hn::RebindToUnsigned<Doubles>;
using FloatVector = hn::Vec<Floats>;
using DoubleVector = hn::Vec<Doubles>;
using IntegerVector = hn::Vec<Integers>;
using WordVector = hn::Vec<Words>;
using LongVector = hn::Vec<LongWords>;
constexpr int n_floats = static_cast<int>(hn::MaxLanes(Floats()));
constexpr int n_doubles = static_cast<int>(hn::MaxLanes(Doubles()));
static_assert(n_floats <= kRowPadding);

void claim(Line inverse_depth, int first, int last, std::int64_t owner, double* nearest,
           std::int64_t* owners) {
  const Doubles d;
  const LongIntegers di;
  const auto at_zero = hn::Set(d, inverse_depth.at_zero), slope = hn::Set(d, inverse_depth.slope);
  int x = first;
  for (; x + n_doubles <= last + 1; x += n_doubles) {
    const auto w = hn::Add(at_zero, hn::Mul(slope, hn::Iota(d, static_cast<double>(x))));
    const auto before = hn::LoadU(d, nearest + x);
    const auto nearer = hn::Gt(w, before);
    hn::StoreU(hn::IfThenElse(nearer, w, before), d, nearest + x);
    const auto other = hn::LoadU(di, owners + x);
    hn::StoreU(hn::IfThenElse(hn::RebindMask(di, nearer), hn::Set(di, owner), other), di,
               owners + x);
  }
  for (; x <= last; ++x) {
    const double w = inverse_depth.at_zero + inverse_depth.slope * x;
    if (w > nearest[x]) {
      nearest[x] = w;
      owners[x] = owner;
    }
  }
}

/// Data of the bitmaps of `index` for shade(); the index is usually the same for all lanes.
struct Level {
  IntegerVector offset, stride;
  FloatVector scale, max_x, max_y;

  HWY_INLINE Level(const TextureLevels& levels, IntegerVector index) {
    const Floats d;
    const Integers di;
    // 2^-index by its bits.
    scale = hn::BitCast(d, hn::ShiftLeft<23>(hn::Sub(hn::Set(di, 127), index)));
    const int first = hn::GetLane(index);
    if (hn::AllTrue(di, hn::Eq(index, hn::Set(di, first)))) {
      offset = hn::Set(di, levels.offset[first]);
      stride = hn::Set(di, levels.stride[first]);
      max_x = hn::Set(d, levels.max_x[first]);
      max_y = hn::Set(d, levels.max_y[first]);
    } else {
      offset = hn::GatherIndex(di, levels.offset, index);
      stride = hn::GatherIndex(di, levels.stride, index);
      max_x = hn::GatherIndex(d, levels.max_x, index);
      max_y = hn::GatherIndex(d, levels.max_y, index);
    }
  }
};

/// The byte at each offset, and above it the next byte; higher bits have no influence.
HWY_INLINE WordVector neighbours(const std::uint8_t* pixels, IntegerVector offset) {
#if HWY_TARGET == HWY_AVX2 || HWY_TARGET == HWY_AVX3
  return hn::GatherOffset(Words(), reinterpret_cast<const std::uint32_t*>(pixels), offset);
#else
  HWY_ALIGN std::int32_t offsets[n_floats];
  HWY_ALIGN std::uint32_t words[n_floats];
  hn::Store(offset, Integers(), offsets);
  for (int i = 0; i < n_floats; ++i) {
    const std::uint8_t* bytes = pixels + offsets[i];
    words[i] = bytes[0] | static_cast<std::uint32_t>(bytes[1]) << 8U;
  }
  return hn::Load(Words(), words);
#endif
}

/// Between the lowest two bytes of each word.
HWY_INLINE FloatVector mixed(WordVector bytes, FloatVector f) {
  const Words dw;
  const Integers di;
  const auto mask = hn::Set(dw, 0xffU);
  const auto a = hn::BitCast(di, hn::And(bytes, mask));
  const auto b = hn::BitCast(di, hn::And(hn::ShiftRight<8>(bytes), mask));
  const Floats d;
  return hn::Add(hn::ConvertTo(d, a), hn::Mul(f, hn::ConvertTo(d, hn::Sub(b, a))));
}

/// Texture::sample() of each lane.
HWY_INLINE FloatVector sample(const std::uint8_t* pixels, const Level& level, FloatVector u,
                              FloatVector v) {
  const Floats d;
  const Integers di;
  const auto zero = hn::Zero(d), half = hn::Set(d, 0.5F);
  const auto x = hn::Min(hn::Max(hn::Sub(hn::Mul(u, level.scale), half), zero), level.max_x);
  const auto y = hn::Min(hn::Max(hn::Sub(hn::Mul(v, level.scale), half), zero), level.max_y);
  const auto x0 = hn::ConvertTo(di, x), y0 = hn::ConvertTo(di, y);
  const auto fx = hn::Sub(x, hn::ConvertTo(d, x0)), fy = hn::Sub(y, hn::ConvertTo(d, y0));
  const auto row = hn::Add(hn::Add(level.offset, hn::Mul(y0, level.stride)), x0);
  const auto top = mixed(neighbours(pixels, row), fx);
  const auto bottom = mixed(neighbours(pixels, hn::Add(row, level.stride)), fx);
  return hn::Add(top, hn::Mul(fy, hn::Sub(bottom, top)));
}

/// log2 for positive normal numbers, linear between powers of two (error below 0.09).
HWY_INLINE FloatVector rough_log2(FloatVector value) {
  const Floats d;
  const auto bits = hn::ConvertTo(d, hn::BitCast(Integers(), value));
  return hn::Sub(hn::Mul(bits, hn::Set(d, 0x1p-23F)), hn::Set(d, 127.0F));
}

/// Texture coordinates [texels] of the pixels of a row, and the steps to their neighbours to the
/// right (ux, vx) and below (uy, vy).
struct Footprints {
  FloatVector u, v, ux, vx, uy, vy;
};

HWY_INLINE FloatVector filtered(const TextureLevels& levels, const Footprints& at) {
  const Floats d;
  const Integers di;
  const auto zero = hn::Zero(d), one = hn::Set(d, 1.0F), most = hn::Set(d, 1.0F * kMostTaps);
  const auto length_x = hn::Sqrt(hn::Add(hn::Mul(at.ux, at.ux), hn::Mul(at.vx, at.vx)));
  const auto length_y = hn::Sqrt(hn::Add(hn::Mul(at.uy, at.uy), hn::Mul(at.vy, at.vy)));
  const auto longer = hn::Max(length_x, length_y);
  const auto cross = hn::Sub(hn::Mul(at.ux, at.vy), hn::Mul(at.uy, at.vx));
  const auto shorter = hn::Div(hn::Abs(cross), longer);
  // If the shorter side is almost zero, the quotient is not used.
  const auto narrow = hn::Ge(longer, hn::Mul(most, shorter));
  const auto ratio = hn::Div(longer, hn::IfThenElse(narrow, one, shorter));
  const auto rounded =
      hn::ConvertTo(d, hn::ConvertTo(di, hn::Min(hn::Add(ratio, hn::Set(d, 0.5F)), most)));
  const auto tiny = hn::Le(longer, one);
  const auto taps = hn::IfThenElse(tiny, one, hn::IfThenElse(narrow, most, hn::Max(rounded, one)));
  const auto size = hn::Max(shorter, hn::Div(longer, taps));
  const auto detail = hn::IfThenZeroElse(tiny, rough_log2(size));

  const auto last = hn::Set(di, levels.count - 1);
  const auto index = hn::Min(hn::ConvertTo(di, hn::Max(detail, zero)), last);
  const auto is_last = hn::RebindMask(d, hn::Eq(index, last));
  const auto fraction =
      hn::IfThenZeroElse(is_last, hn::Max(hn::Sub(detail, hn::ConvertTo(d, index)), zero));
  const bool between = !hn::AllTrue(d, hn::Eq(fraction, zero));
  const Level fine(levels, index);
  const Level coarse(levels, hn::Min(hn::Add(index, hn::Set(di, 1)), last));

  const auto along_x = hn::Gt(length_x, length_y);
  const auto du = hn::Div(hn::IfThenElse(along_x, at.ux, at.uy), taps);
  const auto dv = hn::Div(hn::IfThenElse(along_x, at.vx, at.vy), taps);
  const auto middle = hn::Mul(hn::Set(d, 0.5F), hn::Sub(taps, one));
  auto sum = zero;
  for (int i = 0; i < kMostTaps; ++i) {
    const auto tap = hn::Set(d, static_cast<float>(i));
    const auto wanted = hn::Lt(tap, taps);
    if (hn::AllFalse(d, wanted)) break;
    const auto offset = hn::Sub(tap, middle);
    const auto u = hn::Add(at.u, hn::Mul(offset, du)), v = hn::Add(at.v, hn::Mul(offset, dv));
    auto value = sample(levels.pixels, fine, u, v);
    if (between) {
      const auto blurred = sample(levels.pixels, coarse, u, v);
      value = hn::Add(value, hn::Mul(fraction, hn::Sub(blurred, value)));
    }
    sum = hn::Add(sum, hn::IfThenElseZero(wanted, value));
  }
  return hn::Div(sum, taps);
}

/// As floats, the first half lowest.
HWY_INLINE FloatVector joined(const DoubleVector (&halves)[2]) {
  const HalfFloats d;
  return hn::Combine(Floats(), hn::DemoteTo(d, halves[1]), hn::DemoteTo(d, halves[0]));
}

void shade(const TexturedRow& row, int begin, int end, float* grey, float* depth) {
  const Floats d;
  const Doubles dd;
  const auto line = [dd](Line of, DoubleVector x) HWY_ATTR {
    return hn::Add(hn::Set(dd, of.at_zero), hn::Mul(hn::Set(dd, of.slope), x));
  };
  const auto per_texel = hn::Set(dd, row.texels_per_metre);
  // Lanes behind the end repeat the last pixel.
  const auto last = hn::Set(dd, static_cast<double>(end - 1));
  for (int begin_of_block = begin; begin_of_block < end; begin_of_block += n_floats) {
    DoubleVector z[2], u[2], v[2], ux[2], vx[2], uy[2], vy[2];
    for (int half = 0; half < 2; ++half) {
      const auto x =
          hn::Min(hn::Iota(dd, static_cast<double>(begin_of_block + half * n_doubles)), last);
      const auto depths = hn::Div(hn::Set(dd, 1.0), line(row.inverse_depth, x));
      const auto a = hn::Mul(line(row.a, x), depths), b = hn::Mul(line(row.b, x), depths);
      const auto scale = hn::Mul(depths, per_texel);
      const auto slope = [dd, scale](DoubleVector value, double of_value,
                                     double of_depth) HWY_ATTR {
        return hn::Mul(hn::Sub(hn::Set(dd, of_value), hn::Mul(value, hn::Set(dd, of_depth))),
                       scale);
      };
      z[half] = depths;
      u[half] = hn::Mul(a, per_texel);
      v[half] = hn::Mul(b, per_texel);
      ux[half] = slope(a, row.a.slope, row.inverse_depth.slope);
      vx[half] = slope(b, row.b.slope, row.inverse_depth.slope);
      uy[half] = slope(a, row.a_down, row.inverse_depth_down);
      vy[half] = slope(b, row.b_down, row.inverse_depth_down);
    }
    hn::StoreU(joined(z), d, depth + begin_of_block);
    const Footprints at{joined(u), joined(v), joined(ux), joined(vx), joined(uy), joined(vy)};
    hn::StoreU(filtered(*row.levels, at), d, grey + begin_of_block);
  }
}

/// a * b modulo 2^64; of 32-bit products, which every unit has.
HWY_INLINE LongVector product(LongVector a, std::uint64_t b) {
  const LongWords dl;
  const Words dw;
  const auto low = hn::BitCast(dw, hn::Set(dl, b & 0xffffffffU));
  const auto high = hn::BitCast(dw, hn::Set(dl, b >> 32U));
  const auto a_low = hn::BitCast(dw, a), a_high = hn::BitCast(dw, hn::ShiftRight<32>(a));
  const auto crossed = hn::Add(hn::MulEven(a_high, low), hn::MulEven(a_low, high));
  return hn::Add(hn::MulEven(a_low, low), hn::ShiftLeft<32>(crossed));
}

/// mix() of base/mix.hpp.
HWY_INLINE LongVector mixed_bits(LongVector x) {
  x = hn::Add(x, hn::Set(LongWords(), 0x9e3779b97f4a7c15U));
  x = product(hn::Xor(x, hn::ShiftRight<30>(x)), 0xbf58476d1ce4e5b9U);
  x = product(hn::Xor(x, hn::ShiftRight<27>(x)), 0x94d049bb133111ebU);
  return hn::Xor(x, hn::ShiftRight<31>(x));
}

/// The sum of the four 16-bit numbers of each hash, in the lower half of it.
HWY_INLINE LongVector sum_of_parts(LongVector bits) {
  const LongWords dl;
  const auto mask = hn::Set(dl, 0x0000ffff0000ffffU);
  const auto pairs = hn::Add(hn::And(bits, mask), hn::And(hn::ShiftRight<16>(bits), mask));
  return hn::Add(pairs, hn::ShiftRight<32>(pairs));
}

void expose(const float* grey, int width, float exposure, float noise, std::uint64_t noise_seed,
            std::uint32_t y, std::uint8_t* out) {
  const Floats d;
  const Integers di;
  const LongWords dl;
  constexpr std::uint64_t step = 0x9e3779b97f4a7c15U;  // from pixel to pixel
  constexpr float mean = 2 * 65535.0F;
  constexpr float deviation = 37837.2F;  // sqrt(4 * (65536^2 - 1) / 12)
  HWY_ALIGN std::uint64_t first[n_floats];
  for (int i = 0; i < n_floats; ++i) {
    first[i] = noise_seed +
               ((static_cast<std::uint64_t>(y) << 32U) + static_cast<std::uint64_t>(i)) * step;
  }
  auto low = hn::Load(dl, first), high = hn::Load(dl, first + n_doubles);
  const auto stride = hn::Set(dl, step * static_cast<std::uint64_t>(n_floats));
  for (int x = 0; x < width; x += n_floats) {
    auto value = hn::Mul(hn::LoadU(d, grey + x), hn::Set(d, exposure));
    if (noise > 0) {
      const auto sums = hn::ConcatEven(di, hn::BitCast(di, sum_of_parts(mixed_bits(high))),
                                       hn::BitCast(di, sum_of_parts(mixed_bits(low))));
      const auto normal =
          hn::Div(hn::Sub(hn::ConvertTo(d, sums), hn::Set(d, mean)), hn::Set(d, deviation));
      value = hn::Add(value, hn::Mul(hn::Set(d, noise), normal));
      low = hn::Add(low, stride);
      high = hn::Add(high, stride);
    }
    value = hn::Min(hn::Max(value, hn::Zero(d)), hn::Set(d, 255.0F));
    const auto rounded = hn::ConvertTo(di, hn::Add(value, hn::Set(d, 0.5F)));
    const hn::Rebind<std::uint8_t, Integers> d8;
    hn::StoreU(hn::DemoteTo(d8, rounded), d8, out + x);
  }
}

}  // namespace

extern const RowKernels kernels;
const RowKernels kernels = {claim, shade, expose};

}  // namespace HWY_NAMESPACE
}  // namespace orbslam::synthetic
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace orbslam::synthetic {

const RowKernels& row_kernels_for(VectorUnit unit) {
  const RowKernels* found = nullptr;
  if (unit == VectorUnit::avx2) found = HWY_CHOOSE_AVX2(kernels);
  if (unit == VectorUnit::avx512) found = HWY_CHOOSE_AVX3(kernels);
  return found != nullptr ? *found : HWY_STATIC_DISPATCH(kernels);
}

}  // namespace orbslam::synthetic
#endif

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace orbslam {

// Chi-square limits (95 %) of squared whitened residuals with two and three degrees of freedom,
// and the widths of the Huber kernels that start there (spec 16, sections 1 and 8).
inline constexpr double kGateMono = 5.991;
inline constexpr double kGateStereo = 7.815;
inline constexpr double kHuberMono = 2.4476519360399265;    // sqrt(5.991)
inline constexpr double kHuberStereo = 2.7955321496988725;  // sqrt(7.815)

// A minimisation ends after this many successive iterations whose relative decrease of the cost
// is below the given fraction.
inline constexpr double kSmallDecrease = 1e-3;
inline constexpr int kSmallDecreases = 3;

}  // namespace orbslam

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace orbslam {

// Chi-square limits (95 %) of squared whitened residuals with two and three degrees of freedom,
// and the widths of the Huber kernels that start there. See
// docs/method/adjustment.md#gates-and-kernels.
inline constexpr double kGateMono = 5.991;
inline constexpr double kGateStereo = 7.815;
inline constexpr double kHuberMono = 2.4476519360399265;    // sqrt(5.991)
inline constexpr double kHuberStereo = 2.7955321496988725;  // sqrt(7.815)

// A minimisation ends after this many successive iterations whose relative decrease of the cost
// is below the given fraction. See docs/method/adjustment.md#stopping.
inline constexpr double kSmallDecrease = 1e-3;
inline constexpr int kSmallDecreases = 3;

// Levenberg-Marquardt with damping by the identity, as the published system has it: the first
// damping is this part of the largest diagonal entry of the normal matrix. A step is accepted when
// its gain, the decrease over the predicted one plus kGainOffset, is positive; the damping is then
// multiplied by 1 - (2 gain - 1)^3, at least kLeastDampingFactor and at most kMostDampingFactor.
// Otherwise it is multiplied by 2, 4, 8 and so on.
inline constexpr double kFirstDamping = 1e-5;
inline constexpr double kGainOffset = 1e-3;
inline constexpr double kLeastDampingFactor = 1.0 / 3.0;
inline constexpr double kMostDampingFactor = 2.0 / 3.0;

}  // namespace orbslam

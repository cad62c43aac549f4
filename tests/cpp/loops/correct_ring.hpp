// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gtest/gtest.h>

#include "loops/loop_correction.hpp"
#include "loops/ring_scene.hpp"

namespace orbslam::testing {

inline RingOptions single_camera() {
  RingOptions options;
  options.monocular = true;
  options.log_scale_drift = 0.002;
  return options;
}

inline LoopCorrection planned(RingScene& scene) {
  LoopCorrection correction = plan_loop_correction(scene.map, scene.loop, !scene.options.monocular);
  const PoseGraphSummary summary = optimize_essential_graph(correction, nullptr);
  EXPECT_FALSE(summary.aborted);
  return correction;
}

inline LoopCorrectionResult correct(RingScene& scene) {
  const LoopCorrectionResult result = apply_loop_correction(scene.map, planned(scene));
  EXPECT_EQ(scene.violations(), "");
  return result;
}

}  // namespace orbslam::testing

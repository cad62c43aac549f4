// SPDX-License-Identifier: BSD-3-Clause
// Planning a correction, and its graph; loop_correction_apply.cpp carries it out.
#include "loops/loop_correction.hpp"

#include <optional>

#include "loops/essential_graph.hpp"
#include "loops/fusion_draft.hpp"
#include "loops/seam.hpp"
#include "loops/upright.hpp"

namespace orbslam {
namespace {

void carry_points(const Map& map, const FusionDraft& draft, LoopCorrection& correction) {
  const auto lock = map.read_lock();
  correction.carried.reserve(map.n_points());
  map.for_each_point([&](const MapPoint& point) {
    if (!map.is_in(point, correction.map)) return;
    KeyFrameId carrier = draft.carrier(point.id);
    if (!carrier.valid()) carrier = point.reference_keyframe;
    const std::size_t vertex = vertex_before(correction.keyframes, carrier);
    correction.carried.emplace_back(point.id, static_cast<std::uint32_t>(vertex));
  });
}

}  // namespace

LoopCorrection plan_loop_correction(const Map& map, const Loop& loop, bool fix_scale) {
  LoopCorrection correction;
  correction.loop = loop;
  correction.fix_scale = fix_scale;
  std::optional<Seam> seam = draft_seam(map, loop, fix_scale);
  if (!seam || seam->near_map != seam->far_map) return correction;
  correction.epoch = seam->epoch;
  if (is_upright(map, seam->near_map)) {
    const auto turn = upright_correction(seam->draft.T_cw(0), seam->group.corrected.front());
    correction.upright = turn.has_value();
    if (turn) {
      for (Similarity& corrected : seam->group.corrected) corrected = corrected * *turn;
    }
  }
  build_essential_graph(map, seam->group, correction);
  if (correction.keyframes.empty()) return correction;
  correction.fusions = seam->draft.take_fusions();
  correction.group = seam->group.keyframes;
  carry_points(map, seam->draft, correction);
  return correction;
}

PoseGraphSummary optimize_essential_graph(LoopCorrection& correction,
                                          const std::atomic<bool>* abort, int n_threads) {
  if (correction.keyframes.empty()) return {};
  PoseGraphOptions options;
  options.fix_scale = correction.fix_scale;
  options.upright = correction.upright;
  options.n_threads = n_threads;
  return optimize_pose_graph(correction.graph, options, abort);
}

}  // namespace orbslam
